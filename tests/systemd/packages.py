"""Packages of other versions made from one that was built: the same program under another name, changed, or broken."""

import re
import shutil
import subprocess
from pathlib import Path

BROKEN = "raise SystemExit('this release is broken on purpose')\n"


def version_of(deb: Path) -> str:
    """The version in a package's control file."""
    ran = subprocess.run(["dpkg-deb", "--field", str(deb), "Version"], capture_output=True, text=True, check=True)
    return ran.stdout.strip()


def repack(deb: Path, release: str, folder: Path, *, broken: bool = False) -> Path:
    """A package of `release` with the program of `deb`, and with another example of the settings.

    `broken`: its daemon ends at the start, though its commands work.
    """
    tree = folder / f"tree-{release}"
    subprocess.run(["dpkg-deb", "--raw-extract", str(deb), str(tree)], check=True)
    package = tree / "opt/handeyed/package"
    before = (package / "share/handeyed/version").read_text().strip()
    suffix = version_of(deb).rpartition("+")[2]
    (package / "share/handeyed/version").write_text(f"{release}\n")
    _replace(package / "bin/handeyed", before, release)
    _replace(tree / "DEBIAN/control", r"^Version: .*$", f"Version: {release}+{suffix}")
    (tree / "DEBIAN/md5sums").unlink()
    (info,) = package.glob("lib/python3.*/site-packages/handeyed-*.dist-info")
    _replace(info / "METADATA", r"^Version: .*$", f"Version: {release}")
    info.rename(info.with_name(f"handeyed-{release}.dist-info"))
    for example in (package / "share/handeyed/deploy", tree / "usr/share/doc/handeyed"):
        with (example / "handeyed.example.toml").open("a") as text:
            text.write(f"# new in {release}\n")
    if broken:
        (composition,) = package.glob("lib/python3.*/site-packages/handeyed/daemon/composition.py")
        composition.write_text(BROKEN)
    made = folder / f"handeyed_{release}+{suffix}_{deb.name.rpartition('_')[2]}"
    command = ["dpkg-deb", "--root-owner-group", "-Zgzip", "-z1", "--build", str(tree), str(made)]
    subprocess.run(command, check=True, capture_output=True)
    shutil.rmtree(tree)
    return made


def _replace(file: Path, pattern: str, text: str) -> None:
    """Replace every match; a pattern without special characters is a text."""
    before = file.read_text()
    literal = pattern if pattern.startswith("^") else re.escape(pattern)
    after, count = re.subn(literal, lambda _: text, before, flags=re.MULTILINE)
    if not count:
        raise ValueError(f"{file} has no {pattern}")
    file.write_text(after)

"""The version of a build, from its tag or its commit: `python3 hatch_version.py` prints it, hatchling asks for it.

`0.2.0` at the tag v0.2.0; between tags `0.2.0.dev1056+g00fb5088`: the next version, whose section heads CHANGELOG.md,
the number of commits, which only grows, and the commit; `.dirty` where a file differs from it. A source tree without
git has what HANDEYED_VERSION says, or its PKG-INFO.
"""

import os
import re
import subprocess
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parent
HEADING = re.compile(r"^## (\d+)\.(\d+)\.(\d+)", re.MULTILINE)
PKG_INFO_VERSION = re.compile(r"^Version: (.+)$", re.MULTILINE)


def version(root: Path = ROOT, environment: Mapping[str, str] = os.environ) -> str:
    """The version of the source tree at `root`, as PEP 440 writes it."""
    if given := environment.get("HANDEYED_VERSION"):
        return given
    if (packed := root / "PKG-INFO").exists() and (found := PKG_INFO_VERSION.search(packed.read_text("utf-8"))):
        return found[1]
    return _of_commit(root) or f"{_next_version(root, '')}.dev0+unknown"


def debian(pep440: str) -> str:
    """The same version for dpkg, to which a tilde sorts before the end: 0.2.0~dev1056+g00fb5088 comes before 0.2.0."""
    return re.sub(r"\.?(dev|rc|a|b)(?=\d)", r"~\1", pep440.partition("+")[0]) + pep440[len(pep440.partition("+")[0]) :]


def _of_commit(root: Path) -> str | None:
    """From git; None where `root` is not the top of a work tree."""
    if not (root / ".git").exists() or (commit := _git(root, "rev-parse", "--short=8", "HEAD")) is None:
        return None
    dirty = ".dirty" if _git(root, "status", "--porcelain", "--untracked-files=no") else ""
    tag = _git(root, "describe", "--tags", "--abbrev=0", "--match", "v[0-9]*") or ""
    if tag and not dirty and _git(root, "rev-list", "-n1", tag) == _git(root, "rev-parse", "HEAD"):
        return tag.removeprefix("v")
    count = _git(root, "rev-list", "--count", "HEAD")
    return f"{_next_version(root, tag)}.dev{count}+g{commit}{dirty}"


def _next_version(root: Path, tag: str) -> str:
    """That of the first section of CHANGELOG.md; one patch later where it has its tag already."""
    found = HEADING.search((root / "CHANGELOG.md").read_text("utf-8"))
    major, minor, patch = found.groups() if found else ("0", "0", "0")
    released = tag == f"v{major}.{minor}.{patch}"
    return f"{major}.{minor}.{int(patch) + released}"


def _git(root: Path, *arguments: str) -> str | None:
    """What git prints; None where it is not here or refuses."""
    try:
        command = ["git", "-C", str(root), *arguments]
        ran = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return ran.stdout.strip()


if __name__ == "__main__":
    import sys

    print(debian(version()) if "--debian" in sys.argv else version())  # noqa: T201

"""What is deployed for many cells: the nightly backup fails when either end of its pipe does."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

DEPLOY = Path(__file__).resolve().parents[2] / "deploy"
UNIT = DEPLOY / "fleet" / "handeyed-backup.service"


@pytest.mark.parametrize(
    ("handeyed", "backup_to", "fails"),
    [
        ("echo the store", "cat >sent", False),
        ("echo the store", "sed s/the/a/ >sent && touch pruned", False),
        ("echo half; exit 1", "cat >sent", True),
        ("echo the store", "cat >sent; false", True),
        ("echo the store", "no-such-program", True),
    ],
)
def test_a_backup_that_breaks_off_at_either_end_fails_the_unit(
    tmp_path: Path, handeyed: str, backup_to: str, fails: bool
) -> None:
    (line,) = re.findall(r"^ExecStart=/bin/bash -o pipefail -c '(.*)'$", UNIT.read_text(), re.MULTILINE)
    program = tmp_path / "handeyed"
    program.write_text(f"#!/bin/sh\n[ \"$*\" = 'backup /etc/handeyed/handeyed.toml --out -' ] || exit 9\n{handeyed}\n")
    program.chmod(0o755)
    line = line.replace("$$", "$").replace("/opt/handeyed/current/bin/handeyed", str(program))
    environment = {**os.environ, "BACKUP_TO": backup_to}
    ran = subprocess.run(
        ["/bin/bash", "-o", "pipefail", "-c", line], cwd=tmp_path, env=environment, capture_output=True, check=False
    )
    assert (ran.returncode != 0) is fails, ran.stderr
    assert fails or "store" in (tmp_path / "sent").read_text()


def test_what_thins_out_backups_follows_a_whole_one_only() -> None:
    """systemd runs ExecStartPost after an ExecStart that succeeded (systemd.service(5))."""
    assert re.search(r"^ExecStartPost=.*BACKUP_THEN", UNIT.read_text(), re.MULTILINE)
    docs = (DEPLOY.parent / "docs" / "fleet.md").read_text()
    commands = dict(re.findall(r"^(BACKUP_\w+)='(.*)'$", docs, re.MULTILINE))
    assert "forget" in commands["BACKUP_THEN"]
    assert not any("forget" in line for line in re.findall(r"^BACKUP_TO=.*", docs, re.MULTILINE))


def test_systemd_finds_nothing_wrong_with_the_units(tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not here: apt-get install systemd")
    for name in ("handeyed-backup.service", "handeyed-backup.timer", "handeyed-opcua.service"):
        unit = (DEPLOY / "fleet" / name).read_text()
        (tmp_path / name).write_text(unit.replace("/opt/handeyed/current/bin/handeyed", "/bin/true"))
    command = ["systemd-analyze", "verify", "--man=no", *map(str, sorted(tmp_path.iterdir()))]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")


def test_package_and_installer_bring_the_units_and_an_uninstallation_disables_the_timer() -> None:
    build, prerm = (DEPLOY / "deb" / "build.sh").read_text(), (DEPLOY / "deb" / "prerm").read_text()
    assert "deploy/fleet/handeyed-backup.service" in build
    assert "deploy/fleet/handeyed-backup.timer" in build
    assert "deploy/fleet/handeyed-opcua.service" in build
    assert "handeyed-backup.timer" in prerm
    assert "handeyed-opcua.service" in prerm
    assert " fleet " in (DEPLOY / "venv.sh").read_text()
    assert "deploy/fleet" in (DEPLOY / "install.sh").read_text()

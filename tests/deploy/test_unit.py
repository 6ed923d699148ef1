"""deploy/: what systemd and the shell say of our files."""

import fcntl
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.docs_site import docs_site

DEPLOY = Path(__file__).resolve().parents[2] / "deploy"
UNIT = DEPLOY / "handeyed.service"


def _said(*command: str | Path) -> str:
    """What a command prints; it must succeed."""
    ran = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return ran.stdout + ran.stderr


def _need(program: str, package: str) -> None:
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not here (Debian: {package})")


def _settings() -> dict[str, list[str]]:
    """The unit's [Service] settings."""
    settings: dict[str, list[str]] = {}
    for key, value in re.findall(r"^(\w+)=(.*)$", UNIT.read_text(), re.MULTILINE):
        settings.setdefault(key, []).append(value)
    return settings


def test_systemd_finds_nothing_wrong_with_the_unit(tmp_path: Path) -> None:
    _need("systemd-analyze", "systemd")
    program = tmp_path / "handeyed"
    program.symlink_to(sys.executable)
    copy = tmp_path / "handeyed.service"
    copy.write_text(UNIT.read_text().replace("/opt/handeyed/current/bin/handeyed", str(program)))

    assert _said("systemd-analyze", "verify", "--man=no", copy) == ""


def test_the_unit_is_exposed_no_more_than_it_must_be() -> None:
    _need("systemd-analyze", "systemd")
    said = _said("systemd-analyze", "security", "--offline=true", "--no-pager", UNIT)

    exposure = re.search(r"Overall exposure level for handeyed.service: ([\d.]+)", said)
    assert exposure is not None
    assert float(exposure[1]) <= 1.5


def test_network_serial_lines_and_cameras_still_work() -> None:
    settings = _settings()

    families = {"AF_INET", "AF_INET6", "AF_UNIX", "AF_NETLINK"}
    assert families == set(settings["RestrictAddressFamilies"][0].split())
    assert {"char-ttyS rw", "char-ttyUSB rw", "char-ttyACM rw", "char-video4linux rw"} == set(settings["DeviceAllow"])
    assert settings["SupplementaryGroups"] == ["dialout video"]
    assert "PrivateNetwork" not in settings
    assert "PrivateDevices" not in settings
    assert {"192.168.0.0/16", "255.255.255.255/32"} <= set(settings["IPAddressAllow"][0].split())


def test_memory_has_a_limit_that_ends_the_daemon_and_starts_it_again() -> None:
    settings = _settings()
    assert settings["MemoryMax"] == ["2G"]
    assert settings["Restart"] == ["on-failure"]  # which an end for want of memory is


def test_the_watchdog_is_fed_by_the_daemon_and_state_lies_where_the_settings_say() -> None:
    settings = _settings()

    assert settings["Type"] == ["notify"]
    assert int(settings["WatchdogSec"][0]) >= 10
    assert settings["StateDirectory"] == settings["ConfigurationDirectory"] == ["handeyed"]
    assert "PYTHONSAFEPATH=1" in settings["Environment"][0].split()
    assert 'folder = "/var/lib/handeyed"' in (DEPLOY / "handeyed.example.toml").read_text()


def test_a_healthy_service_is_never_left_down_and_wrong_settings_are_not_retried() -> None:
    settings = _settings()
    assert settings["StartLimitIntervalSec"] == ["0"]  # restarts by hand count, too
    assert settings["RestartPreventExitStatus"] == ["2"]  # ExitStatus.UNREADABLE
    assert settings["RuntimeDirectoryPreserve"] == ["restart"]  # what ended it stands there for the next start
    assert "/run/handeyed/ends" in settings["ExecStopPost"][0]
    assert "kill -HUP" in settings["ExecReload"][0]
    assert "--ready-file /run/handeyed/daemon.json" in settings["ExecStart"][0]


SCRIPTS = [
    "deploy/install.sh",
    "deploy/venv.sh",
    "deploy/release.sh",
    "deploy/apt-repository.sh",
    "deploy/handeyed-release",
    *(f"deploy/deb/{name}" for name in ("build.sh", "build-in.sh", "preinst", "postinst", "prerm", "postrm")),
    ".ci/run",
]


@pytest.mark.parametrize("script", SCRIPTS)
def test_the_shell_finds_nothing_wrong_with_the_scripts(script: str) -> None:
    _need("shellcheck", "shellcheck")

    assert _said("shellcheck", DEPLOY.parent / script) == ""


def test_the_installer_wants_root_and_knows_its_options() -> None:
    script = (DEPLOY / "install.sh").read_text() + (DEPLOY / "venv.sh").read_text()

    _said("sh", "-n", DEPLOY / "install.sh")
    for place in ("handeyed.service", "99-handeyed.rules", "handeyed.example.toml", "requirements.lock", "build.lock"):
        assert place in script
        assert (DEPLOY / place).exists()


def stub(folder: Path, **programs: str) -> dict[str, str]:
    """The environment of a script for which `programs` are these lines of shell."""
    folder.mkdir()
    for name, line in programs.items():
        (folder / name).write_text(f"#!/bin/sh\n{line}\n")
        (folder / name).chmod(0o755)
    return {"PATH": f"{folder}:{os.environ['PATH']}"}


def test_a_second_installer_waits_for_nobody_and_changes_nothing(tmp_path: Path) -> None:
    text = (DEPLOY / "install.sh").read_text().replace("ROOT=/opt/handeyed", f"ROOT={tmp_path}/opt/handeyed")
    script = tmp_path / "install.sh"
    script.write_text(text)
    (tmp_path / "opt").mkdir()
    first = os.open(tmp_path / "opt", os.O_RDONLY)
    try:
        fcntl.flock(first, fcntl.LOCK_EX)
        root = stub(tmp_path / "bin", id="echo 0")
        ran = subprocess.run(["sh", str(script)], env=root, capture_output=True, text=True, check=False)
    finally:
        os.close(first)
    assert (ran.returncode, "another install.sh is at work" in ran.stderr) == (1, True), ran.stderr
    assert not [*(tmp_path / "opt").iterdir()]


CONFIGURED = [
    ("", None, "the example"),  # the first installation writes the settings
    ("", "the cell's", "the cell's"),  # left from a removal
    ("0.1.0", "the cell's", "the cell's"),
    ("0.1.0", None, None),  # an administrator has deleted them
]


@pytest.mark.parametrize(("before", "there", "expected"), CONFIGURED)
def test_the_package_writes_the_settings_once(
    tmp_path: Path, before: str, there: str | None, expected: str | None
) -> None:
    text = (DEPLOY / "deb/postinst").read_text()
    for place in ("/etc/handeyed", "/opt/handeyed", "/var/lib/handeyed", "/run/systemd", "/run/udev"):
        text = text.replace(place, f"{tmp_path}{place}")
    script, etc, package = tmp_path / "postinst", tmp_path / "etc/handeyed", tmp_path / "opt/handeyed/package"
    script.write_text(text)
    share = package / "share/handeyed"
    (share / "deploy").mkdir(parents=True)
    (share / "deploy/handeyed.example.toml").write_text("the example")
    (share / "version").write_text("0.2.0\n")
    (package / "bin").mkdir()
    (package / "bin/python3").symlink_to(sys.executable)
    etc.mkdir(parents=True)
    if there is not None:
        (etc / "handeyed.toml").write_text(there)
    stubs = stub(tmp_path / "bin", adduser="true", getent="true", chown="true", handeyed="true",
                 install='[ "$1" = -d ] || { for file; do before=$last last=$file; done; cp "$before" "$last"; }',
                 **{"handeyed-release": "echo $1 $2"})  # fmt: skip
    ran = subprocess.run(
        ["sh", str(script), "configure", before], env=stubs, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    settings = etc / "handeyed.toml"
    assert (settings.read_text() if settings.exists() else None) == expected
    assert expected is None or settings.stat().st_mode & 0o777 == 0o640
    assert "use 0.2.0" in ran.stdout
    assert (tmp_path / "opt/handeyed/releases/0.2.0/share/handeyed/version").samefile(share / "version")


def test_installer_and_package_put_the_program_where_the_unit_looks() -> None:
    program = "/opt/handeyed/current"

    assert f"ExecStart={program}/bin/handeyed" in UNIT.read_text()
    for script in ("deb/postinst", "install.sh"):
        assert "\nROOT=/opt/handeyed\n" in (DEPLOY / script).read_text()
    assert "ROOT=${HANDEYED_ROOT:-/opt/handeyed}" in (DEPLOY / "handeyed-release").read_text()
    assert "release=/opt/handeyed/releases/$HANDEYED_VERSION" in (DEPLOY / "deb/build.sh").read_text()


def test_the_container_is_asked_for_its_health_at_the_settings_that_it_serves() -> None:
    text = (DEPLOY / "Containerfile").read_text()
    program = "/opt/handeyed/current/bin/handeyed"
    (asked,) = re.findall(r"^HEALTHCHECK .* CMD (\[.*\])$", text, re.MULTILINE)
    (entry,) = re.findall(r"^ENTRYPOINT (\[.*\])$", text, re.MULTILINE)
    (served,) = re.findall(r"^CMD (\[.*\])$", text, re.MULTILINE)
    assert json.loads(asked) == [program, "health", json.loads(served)[1]]
    assert (json.loads(entry), json.loads(served)[0]) == ([program], "serve")


ABOUT_THE_SOURCE = ("architecture.md", "reliability.md")


def test_a_release_brings_what_the_runbook_speaks_of() -> None:
    """Both ways of installing build a release; no source tree is left on the cell's PC."""
    script, docs = (DEPLOY / "venv.sh").read_text(), DEPLOY.parent / "docs"
    patterns = re.search(r'docs" && cp -R ([^&]*) "\$share/docs/', script)[1].split()  # type: ignore[index]
    brought = {path for pattern in patterns for path in docs.glob(pattern.removeprefix("./"))}
    linked = {
        docs / target
        for page in brought
        if page.suffix == ".md" and page.name not in ABOUT_THE_SOURCE
        for target in re.findall(r"\]\(([^)#:]+)[)#]", page.read_text())
    }

    assert docs / "runbook.md" in brought
    brought |= {docs / "../SECURITY.md", docs / "../CHANGELOG.md"}  # copied beside them
    site = {docs / place for place in docs_site().generated_pages()}  # daemon/site, which the daemon serves
    assert {path for path in linked - site if not brought & {path, *path.parents}} == set()
    assert {"prometheus", "grafana", "rapid"} <= set(script.split())
    assert "share/handeyed/docs/runbook.md" in UNIT.read_text()


def test_the_manual_page_names_no_command_that_is_not_there() -> None:
    page = (DEPLOY / "deb/handeyed.1").read_text()
    named = set(re.findall(r"^\.BR? (\w+)(?: \", \" | *$)", page, re.MULTILINE)) - {"handeyed"}
    helped = _said(sys.executable, "-m", "daemon.cli", "--help")

    assert named >= {"demo", "check", "serve", "solve", "target"}
    assert all(re.search(rf"\b{name}\b", helped) for name in named)

"""A Debian that is booted with systemd in a container: files in, commands run in it, and power off."""

import os
import shutil
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

PACKAGES = (
    "systemd", "systemd-sysv", "dbus", "udev", "python3", "adduser", "libstdc++6", "ca-certificates", "curl",
    "iproute2", "procps", "gpgv",
)  # fmt: skip
"""What a cell's PC has before handeyed; curl is the person's."""

PROGRAMS = {"mmdebstrap": "mmdebstrap", "systemd-nspawn": "systemd-container", "nsenter": "util-linux"}
"""Programs that it takes, and Debian's packages of them."""

ENVIRONMENT = ("PATH=/usr/sbin:/usr/bin:/sbin:/bin", "LC_ALL=C.UTF-8", "HOME=/root", "TERM=dumb")
BOOT_S = 90
ADDRESS = "192.168.125.5"
"""The PC's in the cell's network, in docs/plc.md, too."""


class Failed(Exception):
    """A command in the machine, or the story, did not go as it must."""


def missing() -> list[str]:
    """What is not here: sentences for people."""
    found = [f"{name} is not here (Debian: {package})" for name, package in PROGRAMS.items() if not shutil.which(name)]
    return (["this needs root"] if os.geteuid() else []) + found


def make_root(suite: str, archive: Path, mirror: str | None) -> None:
    """Write a Debian of `suite` into the tar file `archive`, once."""
    if archive.exists():
        return
    archive.parent.mkdir(parents=True, exist_ok=True)
    written = archive.with_suffix(".part.tar")
    include = f"--include={','.join(PACKAGES)}"
    command = [
        "mmdebstrap",
        "--quiet",
        "--variant=minbase",
        include,
        suite,
        str(written),
        *([mirror] if mirror else []),
    ]
    subprocess.run(command, check=True)
    written.rename(archive)


@dataclass
class Ran:
    """What a command printed, both streams together, its exit status, and how long it took."""

    command: str
    text: str
    status: int
    took_s: float


class Machine:
    """The booted machine; `close` ends it. Its network has only a loopback."""

    def __init__(self, archive: Path, folder: Path) -> None:
        self.root = folder / "root"
        self.root.mkdir(parents=True)
        subprocess.run(["tar", "-xf", str(archive), "-C", str(self.root)], check=True)
        (self.root / "etc/apt/sources.list").unlink(missing_ok=True)  # it is offline, as many cells are
        (self.root / "etc/apt/apt.conf.d/90yes").write_text('APT::Get::Assume-Yes "true";\n')  # not to dpkg's
        self._log = (folder / "console.log").open("wb")
        self._process: subprocess.Popen[bytes] | None = None
        self._leader = 0

    def boot(self) -> None:
        """Boot, and wait until nothing starts any more. Raises Failed."""
        command = ["systemd-nspawn", "--quiet", "--register=no", "--keep-unit", f"--directory={self.root}", "--boot",
                   "--private-network", "--console=pipe", "--machine=handeyed-cell"]  # fmt: skip
        environment = {**os.environ, "SYSTEMD_NSPAWN_UNIFIED_HIERARCHY": "1"}
        self._process = subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=self._log, stderr=subprocess.STDOUT
        )
        until_s = time.monotonic() + BOOT_S
        while True:
            children = subprocess.run(
                ["pgrep", "-P", str(self._process.pid)], capture_output=True, text=True, check=False
            ).stdout.split()
            if children:
                self._leader = int(children[0])
                state = self.run("systemctl is-system-running", check=False)
                if state.text.strip() in ("running", "degraded"):
                    return
            if self._process.poll() is not None or time.monotonic() > until_s:
                raise Failed(f"the machine does not boot: {Path(self._log.name).read_text(errors='replace')[-2000:]}")
            time.sleep(0.3)

    def run(self, command: str, *, check: bool = True, limit_s: float = 300, user: str = "root") -> Ran:
        """Run a line of shell in it. Raises Failed when it fails, unless `check` is False."""
        inside = ["runuser", "-u", user, "--"] if user != "root" else []
        began_s = time.monotonic()
        process = subprocess.run(
            ["nsenter", "--all", f"--target={self._leader}", "env", "-i", *ENVIRONMENT, *inside, "sh", "-c", command],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
            check=False, timeout=limit_s,
        )  # fmt: skip
        ran = Ran(command, process.stdout, process.returncode, time.monotonic() - began_s)
        if check and ran.status:
            raise Failed(f"$ {command}\n{ran.text}\nexit status {ran.status}")
        return ran

    def start(self, command: str) -> "subprocess.Popen[str]":
        """Start a line of shell in it, and go on beside it."""
        enter = ["nsenter", "--all", f"--target={self._leader}", "env", "-i", *ENVIRONMENT]
        return subprocess.Popen(
            [*enter, "sh", "-c", command], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip

    def until(self, command: str, holds: Sequence[str], limit_s: float = 60) -> Ran:
        """Repeat a command until its output has all these texts. Raises Failed with the last output."""
        until_s = time.monotonic() + limit_s
        while True:
            ran = self.run(command, check=False)
            if all(text in ran.text for text in holds):
                return ran
            if time.monotonic() > until_s:
                raise Failed(f"$ {command}\n{ran.text}\nit does not have {list(holds)} within {limit_s:g} s")
            time.sleep(0.3)

    def close(self) -> None:
        """Power off."""
        if self._process is not None and self._process.poll() is None:
            self.run("systemctl poweroff", check=False)
            try:
                self._process.wait(30)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._log.close()

"""Cameras without hardware: pylon's emulation, the producer in EMVA's wheel, aravis's GigE Vision camera."""

import contextlib
import fcntl
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from ctypes.util import find_library
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.support.waiting import eventually_blocking

FAKE = "arv-fake-gv-camera-0.8"
SERIAL = "HE1"


def require_pylon(monkeypatch: pytest.MonkeyPatch, cameras: int = 1) -> None:
    """Have pylon emulate cameras 0815-0000, 0815-0001 ...; skip where it is not installed."""
    _require("pypylon.pylon", "pip install pypylon")
    monkeypatch.setenv("PYLON_CAMEMU", str(cameras))


def viky() -> Path:
    """The GenTL producer in EMVA's genicam wheel; skips where it or harvesters is not installed."""
    for name in ("genicam.gentl", "harvesters.core"):
        _require(name, "pip install harvesters genicam")
    found = find_spec("genicam")
    assert found is not None and found.origin is not None
    producer = Path(found.origin).with_name("viky.cti")
    if not producer.exists():
        pytest.skip("this genicam wheel has no viky.cti")
    return producer


def _require(module: str, install: str) -> None:
    """Import a library whose generated code warns, and crashes where the warning is an error; skip without it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pytest.importorskip(module, reason=f"{module.partition('.')[0]} is not installed: {install}")


@contextlib.contextmanager
def gigabit_camera(lost_per_thousand: int = 0) -> Iterator[subprocess.Popen[bytes]]:
    """A GigE Vision camera at 127.0.0.1 with serial number SERIAL, by aravis; one at a time on this machine.

    Skips where aravis-tools is not installed.
    """
    if shutil.which(FAKE) is None or (find_library("aravis-0.8") is None and not _has_aravis()):
        pytest.skip("aravis is not installed: apt install aravis-tools")
    with _one_at_a_time():
        camera = start_gigabit_camera(lost_per_thousand)
        try:
            yield camera
        finally:
            stop(camera)


@contextlib.contextmanager
def gigabit_scene(url: str) -> Iterator[subprocess.Popen[bytes]]:
    """A GigE Vision camera as `gigabit_camera`, whose pictures are those of `url`. Skips without libaravis."""
    if not _has_aravis():
        pytest.skip("aravis is not installed: apt install libaravis-0.8-0")
    with _one_at_a_time():
        camera = _start([sys.executable, "-m", "tests.support.gigabit_scene", SERIAL, url])
        try:
            yield camera
        finally:
            stop(camera)


def start_gigabit_camera(lost_per_thousand: int = 0) -> subprocess.Popen[bytes]:
    """Start the program and wait until it listens."""
    return _start([FAKE, "-i", "127.0.0.1", "-s", SERIAL, "-r", str(lost_per_thousand)])


def _start(command: list[str]) -> subprocess.Popen[bytes]:
    camera = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    eventually_blocking(lambda: _listens() or camera.poll() is not None)
    if camera.poll() is not None:
        pytest.skip(f"{command[0]} does not start here")
    return camera


def stop(camera: subprocess.Popen[bytes]) -> None:
    """End the program."""
    camera.send_signal(signal.SIGKILL)
    camera.communicate()


def _listens() -> bool:
    """Whether a socket is bound to 127.0.0.1:3956, GigE Vision's port for control (0xF74)."""
    return any(":0F74" in line.split()[1] for line in Path("/proc/net/udp").read_text().splitlines()[1:])


def _has_aravis() -> bool:
    from drivers.cameras.genicam.aravis_library import Aravis
    from drivers.errors import LibraryMissing

    try:
        Aravis()
    except LibraryMissing:
        return False
    return sys.platform == "linux"


@contextlib.contextmanager
def _one_at_a_time() -> Iterator[None]:
    """The port is fixed: tests of other processes wait."""
    path = Path(tempfile.gettempdir()) / f"handeyed-gige-{os.getuid()}.lock"
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield

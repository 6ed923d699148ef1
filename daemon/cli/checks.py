"""What `handeyed check` looks at, each as one Result. Devices are asked at the same time; nothing moves."""

import asyncio
import getpass
import os
import shutil
from collections.abc import Awaitable, Callable
from math import degrees
from pathlib import Path
from typing import Any, TypeVar

from calibration.detection.detect import detect
from calibration.errors import DetectionError
from daemon.cell.cell import motion_obstacles
from daemon.cell.devices import open_devices
from daemon.cell.vibration import Quiet
from daemon.cli.checks_modbus import check_interlocks, check_plc
from daemon.cli.errors import CommandError
from daemon.cli.output import Result
from daemon.cli.rest_client import DaemonClient
from daemon.config.settings import Settings
from daemon.errors import NotStill
from daemon.runtime.clock import Clock
from drivers.errors import DeviceError, DeviceTimeout, DeviceUnreachable, NothingMeasured
from drivers.interfaces import Camera, Robot, Scanner

CONNECT_LIMIT_S = 4.0
RETRY_S = 0.1

Answer = TypeVar("Answer")


def check_storage(settings: Settings) -> Result:
    """Can files be written where the store will lie, and is there room?"""
    folder = Path(settings.storage.folder)
    existing = next(place for place in (folder, *folder.parents) if place.exists())
    if not os.access(existing, os.W_OK | os.X_OK) or not existing.is_dir():
        what = f"{folder} cannot be written by user {getpass.getuser()}"
        return Result("storage", False, what, "correct [storage] folder or its owner, or check as the daemon's user")
    free_mb = shutil.disk_usage(existing).free / 1e6
    if free_mb < settings.storage.reserve_mb:
        return Result("storage", False, f"only {free_mb:.0f} MB are left in {folder}", "free some space")
    return Result("storage", True, f"{folder}, {free_mb / 1000:.1f} GB free")


async def check_devices(settings: Settings) -> list[Result]:
    """Every device, asked directly; or through a daemon that already runs with these settings and holds them."""
    with DaemonClient(_url(settings), limit_s=CONNECT_LIMIT_S) as daemon:
        if (software := _running(daemon)) is not None:
            return _through(daemon, software)
    try:
        devices = open_devices(settings, Clock())
    except DeviceError as error:
        return [Result("devices", False, f"{error.device}: {error.what}", error.fix)]
    opened: list[Any] = [device for device in vars(devices).values() if device is not None]
    try:
        checks = [
            _asked("robot", devices.robot, _robot_words),
            _asked("camera", devices.camera, lambda camera: _camera_words(camera, settings)),
        ]
        if devices.scanner is not None:
            checks.append(_asked("scanner", devices.scanner, _scanner_words))
        if devices.quiet is not None:
            checks.append(_asked("egm", devices.quiet, _vibration_words))
        modbus: list[Awaitable[list[Result]]] = []
        if settings.interlocks is not None:
            modbus.append(check_interlocks(settings.interlocks))
        if settings.plc is not None:
            modbus.append(check_plc(settings.plc))
        one, several = await asyncio.gather(asyncio.gather(*checks), asyncio.gather(*modbus))
        return [*one, *(result for results in several for result in results)]
    finally:
        await asyncio.gather(*(device.close() for device in opened))


def _url(settings: Settings) -> str:
    """Where a daemon with these settings would answer from here."""
    server = settings.server
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(server.host, server.host)
    scheme = "http" if server.certificate is None else "https"
    return f"{scheme}://[{host}]:{server.port}" if ":" in host else f"{scheme}://{host}:{server.port}"


def _running(daemon: DaemonClient) -> str | None:
    """The version of the daemon that answers there; None: none does, and the devices are free."""
    try:
        version: str = daemon.get("/health")["software"]
    except CommandError:
        return None
    return version


def _through(daemon: DaemonClient, software: str) -> list[Result]:
    running = Result("daemon", True, f"{software} runs at {daemon.url} and holds the devices")
    try:
        readiness = daemon.get("/calibrate")
    except CommandError as error:
        return [running, Result("cell", False, error.what, f"{error.fix}; this command takes it from HANDEYED_KEY")]
    reasons = [Result("cell", False, reason, "put this right at the cell") for reason in readiness["reasons"]]
    return [running, *(reasons or [Result("cell", True, "ready to calibrate")])]


async def _asked(name: str, device: Answer, words: Callable[[Answer], Awaitable[Result]]) -> Result:
    """`words` about the device, once it is connected."""
    limit_s = asyncio.get_running_loop().time() + CONNECT_LIMIT_S
    while True:
        try:
            return await words(device)
        except (DeviceUnreachable, DeviceTimeout) as error:
            if asyncio.get_running_loop().time() > limit_s:
                return _failed(name, error)
            await asyncio.sleep(RETRY_S)
        except DeviceError as error:
            return _failed(name, error)


def _failed(name: str, error: DeviceError) -> Result:
    return Result(name, False, f"{error.device.removeprefix(f'{name} ')}: {error.what}", error.fix)


async def _robot_words(robot: Robot) -> Result:
    reasons = motion_obstacles(await robot.read_status())
    pose = await robot.read_pose()
    at = ", ".join(f"{value:.1f}" for value in pose.base_T_flange[:3, 3])
    if reasons:
        found = "; ".join(reason.removeprefix("robot: ") for reason in reasons)
        return Result("robot", False, f"answers, but {found}", "put this right at the controller")
    return Result("robot", True, f"answers and could move; the flange stands at ({at}) mm")


async def _camera_words(camera: Camera, settings: Settings) -> Result:
    frame = await camera.grab(Clock().monotonic_s())
    height, width = frame.image.shape[:2]
    picture = f"a picture of {width} x {height}"
    expected = settings.camera.intrinsics
    if expected is not None and (width, height) != expected.image_size:
        size = f"{expected.image_size[0]} x {expected.image_size[1]}"
        return Result("camera", False, f"{picture}, but the intrinsics are for {size}", "correct one of them")
    target = settings.target.target()
    try:
        found = await asyncio.to_thread(detect, frame.image, target)
    except DetectionError:
        return Result("camera", True, f"{picture}; the target is not in view now")
    return Result(
        "camera", True, f"{picture}; it shows {len(found.ids)} of the target's {len(target.points_mm)} points"
    )


async def _vibration_words(quiet: Quiet) -> Result:
    try:
        vibration = await quiet.wait(CONNECT_LIMIT_S, Clock())
    except NotStill as error:
        return Result("egm", False, error.what, error.fix)
    seen = f"{vibration.translation_mm:.3f} mm and {degrees(vibration.rotation_rad):.4f}°"
    return Result("egm", True, f"the controller streams; the flange vibrates by {seen}")


async def _scanner_words(scanner: Scanner) -> Result:
    try:
        cloud = await scanner.scan(Clock().monotonic_s())
    except NothingMeasured:
        return Result("scanner", True, "it answers; from here it sees nothing")
    return Result("scanner", True, f"a cloud of {len(cloud.content) / 1e3:.0f} kB ({cloud.media_type})")

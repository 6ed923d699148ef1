"""The checks of `handeyed check`, each a CheckResult. Devices are checked concurrently; nothing moves."""

import asyncio
import getpass
import os
import shutil
from collections.abc import Awaitable, Callable
from contextlib import aclosing
from functools import partial
from math import degrees
from pathlib import Path
from typing import Any, TypeVar

from calibration.detection.detect import detect
from calibration.detection.image import grey_image
from calibration.detection.recognition import find_alternative
from calibration.errors import DetectionError
from daemon.cell.devices import open_devices
from daemon.cell.vibration import VibrationGate
from daemon.cli.checks_daemon import check_daemon
from daemon.cli.checks_modbus import check_interlocks, check_plc
from daemon.cli.checks_robot import check_robot
from daemon.cli.output import CheckResult
from daemon.config.settings import MAIN_CAMERA, MAIN_SCANNER, Settings, SettingsFile
from daemon.errors import NotStill
from daemon.runtime.clock import Clock
from daemon.tools.first_setup.devices import MAX_CONNECT_S, ask, name_of
from drivers.errors import DeviceError, NothingMeasured
from drivers.interfaces import Camera, CaptureSettings, ProfileSource, Scanner

Answer = TypeVar("Answer")


def check_storage(settings: Settings) -> CheckResult:
    """Check that the store's folder is writable and has free space."""
    folder = Path(settings.storage.folder)
    existing = next(place for place in (folder, *folder.parents) if place.exists())
    if not os.access(existing, os.W_OK | os.X_OK) or not existing.is_dir():
        what = f"{folder} cannot be written by user {getpass.getuser()}"
        return CheckResult(
            "storage", False, what, "correct [storage] folder or its owner, or check as the daemon's user"
        )
    free_mb = shutil.disk_usage(existing).free / 1e6
    if free_mb < settings.storage.reserve_mb:
        return CheckResult("storage", False, f"only {free_mb:.0f} MB are left in {folder}", "free some space")
    return CheckResult("storage", True, f"{folder}, {free_mb / 1000:.1f} GB free")


async def check_devices(settings: Settings, loaded: SettingsFile | None = None) -> list[CheckResult]:
    """Check every device: directly, or through the daemon of this machine, which holds them.

    `loaded`: the file of the settings, to compare with the daemon's.
    """
    through_daemon = check_daemon(settings, loaded)
    if through_daemon is not None:
        return through_daemon
    try:
        devices = open_devices(settings, Clock())
    except DeviceError as error:
        return [CheckResult("devices", False, f"{error.device}: {error.what}", error.fix)]
    cameras = {MAIN_CAMERA: devices.camera, **devices.cameras}
    scanners = {**({} if devices.scanner is None else {MAIN_SCANNER: devices.scanner}), **devices.scanners}
    opened: list[Any] = [devices.robot, *cameras.values(), *scanners.values()]
    opened += [] if devices.vibration_gate is None else [devices.vibration_gate]
    try:
        checks = [
            _check_device("robot", devices.robot, lambda robot: check_robot(robot, settings)),
            *(_check_device(name, camera, partial(_check_camera, name, settings)) for name, camera in cameras.items()),
            *(_check_device(name, scanner, partial(_check_scanner, name)) for name, scanner in scanners.items()),
        ]
        if devices.vibration_gate is not None:
            checks.append(_check_device("egm", devices.vibration_gate, _check_vibration))
        modbus: list[Awaitable[list[CheckResult]]] = []
        if settings.interlocks is not None:
            modbus.append(check_interlocks(settings.interlocks))
        if settings.plc is not None:
            modbus.append(check_plc(settings.plc))
        one, several = await asyncio.gather(asyncio.gather(*checks), asyncio.gather(*modbus))
        return [*one, *(result for results in several for result in results)]
    finally:
        await asyncio.gather(*(device.close() for device in opened))


async def _check_device(name: str, device: Answer, check: Callable[[Answer], Awaitable[CheckResult]]) -> CheckResult:
    """Run `check` on the device, repeating until it is connected."""
    try:
        return await ask(device, check)
    except DeviceError as error:
        return CheckResult(name, False, f"{error.device.removeprefix(f'{name} ')}: {error.what}", error.fix)


async def _check_camera(name: str, settings: Settings, camera: Camera) -> CheckResult:
    view = settings.of_camera(name)
    frame = await camera.grab(Clock().monotonic_s())
    height, width = frame.image.shape[:2]
    who = await name_of(camera)
    picture = f"{f'found {who}; ' if who else ''}a picture of {width} x {height}{_how(frame.capture)}"
    expected = view.camera.intrinsics
    if expected is not None and (width, height) != expected.image_size:
        size = f"{expected.image_size[0]} x {expected.image_size[1]}"
        return CheckResult(name, False, f"{picture}, but the intrinsics are for {size}", "correct one of them")
    target = view.target
    try:
        found = await asyncio.to_thread(detect, frame.image, target)
    except DetectionError as error:
        other = await asyncio.to_thread(find_alternative, grey_image(frame.image), target)
        if other is not None:
            refusal = other.error(error)
            return CheckResult(name, False, f"{picture}; {refusal.what}", refusal.fix)
        return CheckResult(name, True, f"{picture}; the target is not in view now")
    return CheckResult(
        name, True, f"{picture}; it shows {len(found.ids)} of the target's {len(target.points_mm)} points"
    )


def _how(capture: CaptureSettings | None) -> str:
    """Bits, exposure and gain of a frame, after a comma; empty when they are not known."""
    if capture is None:
        return ""
    exposure = "" if capture.exposure_us is None else f", exposed for {capture.exposure_us / 1e3:g} ms"
    gain = "" if capture.gain_db is None else f" at {capture.gain_db:g} dB"
    return f", {capture.bits} bits{exposure}{gain}"


async def _check_vibration(gate: VibrationGate) -> CheckResult:
    try:
        vibration = await gate.wait(MAX_CONNECT_S, Clock())
    except NotStill as error:
        return CheckResult("egm", False, error.what, error.fix)
    seen = f"{vibration.translation_mm:.3f} mm and {degrees(vibration.rotation_rad):.4f}°"
    return CheckResult("egm", True, f"the controller streams; the flange vibrates by {seen}")


async def _check_scanner(name: str, scanner: Scanner) -> CheckResult:
    if isinstance(scanner, ProfileSource):
        if scanner.lag_s and scanner.link.connected:  # files, which are written while a sweep runs
            return CheckResult(name, True, f"a line profiler: {scanner.link.detail}; its files are read during a sweep")
        async with aclosing(scanner.profiles()) as profiles:  # type: ignore[type-var]
            block = await anext(profiles)
        return CheckResult(name, True, f"a line profiler: {block.z_mm.shape[1]} points a profile")
    try:
        cloud = await scanner.scan(Clock().monotonic_s())
    except NothingMeasured:
        return CheckResult(name, True, "it answers; from here it sees nothing")
    return CheckResult(name, True, f"a cloud of {len(cloud.content) / 1e3:.0f} kB ({cloud.media_type})")

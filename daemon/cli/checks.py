"""The checks of `handeyed check`, each a CheckResult. Devices are checked concurrently; nothing moves."""

import asyncio
import getpass
import ipaddress
import os
import shutil
from collections.abc import Awaitable, Callable, Iterator
from contextlib import aclosing
from functools import partial
from math import degrees
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import serial

from calibration.detection.detect import detect
from calibration.detection.image import grey_image
from calibration.detection.recognition import find_alternative
from calibration.errors import DetectionError
from calibration.kinematics.abb_arms import find_any_arm
from calibration.kinematics.load import Load
from calibration.transforms import difference as pose_difference
from calibration.transforms import quaternion_from_rotation
from daemon.access.errors import CertificateUnusable
from daemon.cell.cell import motion_obstacles
from daemon.cell.devices import open_devices
from daemon.cell.frame_check import frame_difference
from daemon.cell.readings import read_setup
from daemon.cell.settling import VibrationGate
from daemon.cli.rest_client import client_of, connect, running_service
from daemon.config.plc_settings import InterlockSettings, PlcSerialSettings, PlcSettings
from daemon.config.settings import MAIN_CAMERA, MAIN_SCANNER, RobotSettings, Settings, SettingsFile
from daemon.errors import NotStill, PortTaken
from daemon.http.listen_socket import late_addresses, open_listener
from daemon.model.check_result import CheckResult
from daemon.runtime.clock import Clock
from daemon.tools.first_setup.devices import MAX_CONNECT_S, ask, name_of
from drivers.errors import DeviceError, DeviceUnreachable, GarbledAnswer, NothingMeasured, RequestRefused
from drivers.interfaces import Camera, CaptureSettings, ProfileSource, Robot, RobotSetup, Scanner
from drivers.robots.base_frame import read_base_frame
from drivers.serial_errors import SERIAL_ERRORS, reason_of
from handeyed.client import Client
from handeyed.errors import ClientError, NoDaemon, Refused

# A device that a daemon holds is never opened: an ABB controller would refuse, a camera be taken from the run.

MAX_ANSWER_S = 20.0
WITH_A_KEY = "give a key in HANDEYED_KEY, or check as root or as the daemon's user"


def check_daemon(settings: Settings, loaded: SettingsFile | None) -> list[CheckResult] | None:
    """What the daemon says that holds the cell: the one at the settings' address, or the service of this machine.

    None when there is none: the devices are free then.
    """
    found = _ask(lambda: client_of(settings, MAX_ANSWER_S), loaded)
    service = running_service()
    if found is None and service is not None and not service.is_at(settings.server.local_url):
        found = _ask(lambda: connect(service.url, MAX_ANSWER_S), loaded)
    return found


def _ask(ask: Callable[[], Client], loaded: SettingsFile | None) -> list[CheckResult] | None:
    """The results through one daemon; None when nothing listens there."""
    try:
        with ask() as daemon:
            software = daemon.get("/health")["software"]
            return _results(daemon, f"{software} runs at {daemon.url} and holds the devices", loaded)
    except NoDaemon:
        return None
    except (ClientError, CertificateUnusable, KeyError, TypeError, ValueError) as error:
        where = error.where if isinstance(error, ClientError) else "the port"
        what = error.what if isinstance(error, ClientError | CertificateUnusable) else "no daemon's answer"
        said = f"something answers at {where}, but not as a daemon with these settings ({what}); no device was asked"
        return [CheckResult("daemon", False, said, "see who listens there: ss -ltnp")]


def _results(daemon: Client, runs: str, loaded: SettingsFile | None) -> list[CheckResult]:
    try:
        about, readiness = daemon.get("/about"), daemon.get("/calibrate")
    except ClientError as error:
        cell = CheckResult("cell", False, error.what, WITH_A_KEY if isinstance(error, Refused) else error.fix)
        return [CheckResult("daemon", True, runs), cell]
    other = other_settings(about.get("settings"), loaded)
    if other is not None:
        return [CheckResult("daemon", False, f"{runs}, {other[0]}; no device was asked", other[1])]
    reasons = [CheckResult("cell", False, reason, "put this right at the cell") for reason in readiness["reasons"]]
    running = CheckResult("daemon", True, runs if loaded is None else f"{runs}, with this file")
    return [running, *(reasons or [CheckResult("cell", True, "ready to calibrate")])]


def other_settings(running: dict[str, str] | None, loaded: SettingsFile | None) -> tuple[str, str] | None:
    """How the daemon's settings differ from the file that is checked, and what to do; None when they are the same."""
    if running is None or loaded is None or running["sha256"] == loaded.sha256:
        return None
    if running["file"] == loaded.file:
        return "but with this file as it was when it started", "systemctl restart handeyed; then check again"
    return (
        f"with {running['file']}, which is another than this file",
        "check that one; or stop the daemon to test this one",
    )


CELL = "put this right at the cell"
TERMINAL = "see that the device answers there, and that [interlocks] names its unit and addresses"


async def check_interlocks(settings: InterlockSettings) -> list[CheckResult]:
    """Read each interlock signal once."""
    interlocks = settings.open()
    try:
        readings = await interlocks.readings()
    finally:
        await interlocks.close()
    return [
        CheckResult("interlock", True, f"{reading.name}: allows motion")
        if reading.allows
        else CheckResult(
            "interlock", False, f"{reading.name} {reading.why}", TERMINAL if "cannot be read" in reading.why else CELL
        )
        for reading in readings
    ]


async def check_plc(settings: PlcSettings) -> list[CheckResult]:
    """Check the TCP port, and the serial line if the settings name one."""
    lines = [check_port(settings)]
    if settings.serial is not None:
        lines.append(await asyncio.to_thread(check_line, settings.serial))
    return lines


def check_port(settings: PlcSettings) -> CheckResult:
    """Check that the port is free, and that the writers of [plc] can reach it."""
    try:
        open_listener(settings.host, settings.port, "plc").close()
    except PortTaken as error:
        return CheckResult("plc", False, error.what, error.fix)
    if late := late_addresses({"plc": settings.host}):
        return CheckResult("plc", False, late[0])
    here = f"Modbus TCP can listen on {settings.host} port {settings.port}"
    if settings.motion and not settings.writers and settings.serial is None:
        return CheckResult("plc", False, f"{here}, but motion is allowed to nobody", "name the PLC in [plc] writers")
    elsewhere = [writer for writer in settings.writers if not ipaddress.ip_network(writer).is_loopback]
    if elsewhere and ipaddress.ip_address(settings.host).is_loopback:
        what = f"{here}, which {', '.join(elsewhere)} cannot reach"
        return CheckResult("plc", False, what, "set [plc] host to this PC's address in the cell's network")
    who = f"{', '.join(settings.writers)} may write" if settings.writers else "nobody may write"
    return CheckResult("plc", True, f"{here}; {who}, triggers {'may' if settings.motion else 'may not'} move the arm")


def check_line(settings: PlcSerialSettings) -> CheckResult:
    """Check that the serial line opens."""
    try:
        serial.serial_for_url(settings.port, baudrate=settings.baud, parity=settings.parity, timeout=0).close()
    except (*SERIAL_ERRORS, ValueError) as error:
        reason = getattr(error, "strerror", None) or reason_of(error)
        what = f"the line {settings.port} cannot be opened ({reason})"
        fix = "correct [plc.serial] port, baud or parity, or the rights of the daemon's user (group dialout)"
        return CheckResult("plc", False, what, fix)
    return CheckResult("plc", True, f"the line {settings.port} opens, {settings.baud} baud, as unit {settings.unit}")


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


MIN_LOAD_KG = 0.01
"""A load below this is the 1 gram of tool0: nobody measured it."""
MAX_FRAME_MM, MAX_FRAME_RAD = 1.0, np.radians(0.1)
"""Differences between the base frame of settings and controller that are named."""
IDENTIFY = (
    "identify it: mount camera and bracket, manual mode, motors on; pendant: Program Editor, Debug, Call Routine,"
    " LoadIdentify, tool load; write what it finds into cell_flange (CELL_shared.sys, or handeyed robot setup --set)"
)


async def check_robot(robot: Robot, settings: Settings) -> CheckResult:
    """Check state, frame and settings of the robot and its program. Raises DeviceError."""
    reasons = motion_obstacles(await robot.read_status())
    pose = await robot.read_pose()
    at = ", ".join(f"{value:.1f}" for value in pose.base_T_flange[:3, 3])
    if reasons:
        found = "; ".join(reasons)
        return CheckResult("robot", False, f"answers, but {found}", "put this right at the controller")
    frame_problem = await _base_frame_problem(robot, settings.robot)
    if frame_problem is not None:
        return CheckResult("robot", False, *frame_problem)
    if settings.robot.model is not None:
        difference = frame_difference(find_any_arm(settings.robot.model), await robot.read_joints(), pose)
        if not difference.agrees:
            return CheckResult("robot", False, difference.what, difference.fix)
    setup = await read_setup(robot)
    for what, fix in [] if setup is None else setup_problems(setup, settings.robot):
        return CheckResult("robot", False, what, fix)
    could = "could move" if robot.capabilities.moves else "is read only: pictures are taken by hand, with --manual"
    frame = robot.capabilities.pose_frame
    carries = "" if setup is None else f", carries {setup.load_kg:g} kg"
    stands = f"the flange stands at ({at}) mm in the {frame} frame{carries}"
    return CheckResult("robot", True, f"answers and {could}; {stands}")


async def _base_frame_problem(robot: Robot, settings: RobotSettings) -> tuple[str, str] | None:
    """A base frame of the controller, read over Robot Web Services, that the settings do not have; None without."""
    in_base = robot.capabilities.pose_frame == "base" and settings.base_frame is None
    try:
        world_T_base = None if in_base else await read_base_frame(robot)
    except (DeviceUnreachable, RequestRefused, GarbledAnswer):
        return None
    if world_T_base is None:
        return None
    ours = np.eye(4) if settings.world_T_base is None else settings.world_T_base
    off_mm, off_rad = pose_difference(ours, world_T_base)
    if off_mm <= MAX_FRAME_MM and off_rad <= MAX_FRAME_RAD:
        return None
    numbers = ", ".join(f"{value:.3f}" for value in world_T_base[:3, 3])
    turn = ", ".join(f"{value:.7f}" for value in quaternion_from_rotation(world_T_base[:3, :3]))
    return (
        f"the controller's base frame is {off_mm:.0f} mm and {np.degrees(off_rad):.1f} deg from [robot] base_frame",
        f"base_frame = {{ translation_mm = [{numbers}], quaternion_wxyz = [{turn}] }}",
    )


def setup_problems(setup: RobotSetup, robot: RobotSettings) -> Iterator[tuple[str, str]]:
    """What is wrong with the program's settings beside ours, each with its remedy."""
    if setup.load_kg < MIN_LOAD_KG:
        yield f"the load on the flange is the 1 gram of tool0 ({setup.load_kg:g} kg): the arm is not armed", IDENTIFY
    if robot.load is not None:
        off_mm = float(np.linalg.norm(np.subtract(setup.load_centre_mm, robot.load.centre_mm)))
        if not robot.load.load().is_as(Load(setup.load_kg, setup.load_centre_mm)):
            yield (
                f"the controller moves with a load of {setup.load_kg:g} kg; that of [robot.load] is"
                f" {robot.load.mass_kg:g} kg, and its centre {off_mm:.0f} mm away",
                f"correct one of them; {IDENTIFY}",
            )
    farthest_mm = float(np.linalg.norm(robot.points_mm, axis=-1).max())
    if farthest_mm > setup.reach_mm:
        yield (
            f"[robot] carried_mm has a point {farthest_mm:.0f} mm from the flange, cell_reach is {setup.reach_mm:g} mm:"
            " it would move faster than speed_mm_s when the flange turns",
            "raise cell_reach in CELL_shared.sys",
        )
    if robot.speed_mm_s > setup.speed_max_mm_s:
        yield (
            f"[robot] speed_mm_s is {robot.speed_mm_s:g}, and the controller allows {setup.speed_max_mm_s:g}",
            "lower it, or raise cell_speed_max in CELL_shared.sys",
        )

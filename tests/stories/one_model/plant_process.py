"""The daemon of the one model, in a process of its own that may be killed, at the mock cell of its parent.

Camera and clock obey files beside the store: while `camera lost` exists the camera gives nothing, and the wall clock is
off by the seconds in `clock`. A sabotage takes one safeguard away: the model must notice.
"""

import asyncio
import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import uvloop

from calibration.transforms import difference
from daemon.access.roles import Role
from daemon.api.middleware import authentication
from daemon.application import Application
from daemon.cell.cell import Cell, Devices
from daemon.cell.motion_rules import MotionRules
from daemon.cell.safe_stop import SafeStop
from daemon.composition import build
from daemon.config.settings import RobotSettings, Settings
from daemon.model.records import AppliedCalibration, CalibrationRecord, RunRecord, ScanRecord
from daemon.runs.supervisor import Supervisor
from daemon.runtime.clock import Clock
from daemon.store import actor
from daemon.store.store import Store
from drivers.errors import DeviceUnreachable
from drivers.interfaces import CameraFrame, LinkHealth
from drivers.registry import open_robot
from extensions.plc.extension import PlcSwitch
from extensions.touch import approach as touch_approach
from extensions.touch.approach import Approach
from tests.daemon.access_keys import TEST
from tests.daemon.calibrations import document_with_covariance
from tests.daemon.cell_under_test import pose_json, settings_for
from tests.daemon.fakes import FakeScanner, picture_of_the_board, poses_around_the_target
from tests.extensions.plc.plcs import MOVING
from tests.support.serving import serve_for_tests

WARM = ["tests.stories.one_model.plant_process", "anyio._backends._asyncio", "uvicorn.lifespan.on", "scipy.optimize",
        "uvicorn.protocols.websockets.websockets_sansio_impl", "websockets.server"]  # fmt: skip
"""What a forked daemon need not import again."""

ARM = "IRB 1600-6/1.45"
TAUGHT = poses_around_the_target()[:3]
PICTURES = [picture_of_the_board(pose) for pose in TAUGHT]
"""Drawn once, in the fork server."""
BOX_MM = ((560.0, -420.0, 300.0), (1240.0, 340.0, 1000.0))
CARRIED_MM = ((60.0, 40.0, 120.0),)
CAMERA_LOST, CLOCK = "camera lost", "clock"
ROLES_WITH_KEYS = (Role.ADMIN, Role.OPERATOR, Role.VIEWER)


def settings_of(folder: Path, robot_port: int) -> Settings:
    """Taught poses, a box around them, a PLC that may move the arm."""
    robot = {
        "address": f"tcp://127.0.0.1:{robot_port}", "model": ARM, "box_mm": BOX_MM, "carried_mm": CARRIED_MM,
        "speed_mm_s": 250, "limit_s": 5.0, "settling": {"gap_s": 0.005, "limit_s": 5.0},
    }  # fmt: skip
    taught = {"poses": [pose_json(pose) for pose in TAUGHT]}
    return settings_for(folder, robot=robot, calibration=taught, plc=MOVING, scanner={"poses": taught["poses"][:2]})


@dataclass
class BoardCamera:
    """Sees the board of the fakes from where the robot says that it stands."""

    robot: Any
    folder: Path
    frames: int = field(default=0, init=False)

    @property
    def link(self) -> LinkHealth:
        lost = (self.folder / CAMERA_LOST).exists()
        return LinkHealth(not lost, "lost" if lost else "connected", 0.0)

    def start(self) -> None:
        pass

    async def grab(self, newer_than_s: float) -> CameraFrame:
        if not self.link.connected:
            raise DeviceUnreachable("camera", "it is lost", "look at the cable")
        taken_at_s = asyncio.get_running_loop().time()
        pose = (await self.robot.read_pose()).base_T_flange
        near = [difference(taught, pose)[0] < 0.01 for taught in TAUGHT]
        image = PICTURES[near.index(True)] if any(near) else picture_of_the_board(pose)
        self.frames += 1  # no two frames of a real camera are equal
        image = image.copy()
        image[0, 0] = self.frames % 251
        return CameraFrame(image, taken_at_s)

    async def close(self) -> None:
        pass


def plant_process(folder: str, robot_port: int, sabotage: str, ready: Connection) -> None:
    """Serve until a signal comes. To `ready`: URL, port of the PLC, and at the first start the keys by role."""
    logging.getLogger().addHandler(logging.NullHandler())
    if sabotage:
        SABOTAGES[sabotage]()
    uvloop.run(_serve(Path(folder), robot_port, ready))


async def _serve(folder: Path, robot_port: int, ready: Connection) -> None:
    settings = settings_of(folder / "store", robot_port)
    clock = Clock(utc_now=partial(_now, folder / CLOCK))

    def devices(made: Settings, _clock: Clock) -> Devices:
        robot = open_robot(made.robot.address, limit_s=made.robot.limit_s)
        return Devices(robot, BoardCamera(robot, folder), FakeScanner())

    application = build(settings, devices, clock=clock)
    async with serve_for_tests(application) as served:
        keys = await _first_keys(application)
        plc = application.service(PlcSwitch).service
        ready.send((served.url, plc.tcp.port, keys))
        await served.task


async def _first_keys(application: Application) -> dict[str, str]:
    """One a role, and a calibration of the fakes' truth to apply, at the first start; nothing later."""
    if await application.store.access_keys.any_ever():
        return {}
    for number in (1, 2):
        document = document_with_covariance().model_copy(update={"id": f"cal-{number}"})
        await application.store.save_calibration(
            CalibrationRecord(document.id, None, document.created_at, True, document)
        )
    return {role.word: (await application.key_service.add(role.word, role, TEST, None))[0] for role in ROLES_WITH_KEYS}


def _now(file: Path) -> datetime:
    off_s = 0.0
    with suppress(OSError, ValueError):
        off_s = float(file.read_text())
    return datetime.now(UTC) + timedelta(seconds=off_s)


# --- safeguards taken away, one at a time, for the positive controls ---


async def _abort_nothing(self: Supervisor, run_id: str, by: str) -> RunRecord:
    return await self.run(run_id)


async def _done(*_args: Any, **_kwargs: Any) -> None:
    return None


def _stop_nothing() -> None:
    Supervisor.abort = _abort_nothing  # type: ignore[method-assign,assignment]
    Cell.stop_motion = lambda self: None  # type: ignore[method-assign]


def _leave_armed() -> None:
    SafeStop.stop_and_disarm = _done  # type: ignore[method-assign,assignment]
    SafeStop.start = _done  # type: ignore[method-assign]


def _no_box() -> None:
    RobotSettings.inside_box = lambda self, pose: True  # type: ignore[method-assign]
    MotionRules._check_path = lambda *_: None  # type: ignore[method-assign,assignment]


def _approach_anyhow() -> None:
    touch_approach.MAX_BEYOND_MM = 1e6
    Approach.require_in_sight = lambda *_: None  # type: ignore[method-assign,assignment]
    Approach.require_tip_first = lambda *_: None  # type: ignore[method-assign,assignment]


def _let_anybody() -> None:
    authentication.role_for = lambda method, path: Role.NOBODY


def _keep_no_audit() -> None:
    append = actor.append_audit

    def skip(db: Any, context: Any, at: str, action: str, subject: str, **detail: object) -> None:
        if action != "run":
            append(db, context, at, action, subject, **detail)

    actor.append_audit = skip


async def _apply_nothing(self: Store, applied: AppliedCalibration, *_: Any) -> AppliedCalibration:
    return replace(applied, sequence=1)


def _forget_scans() -> None:
    save = Store.save_scan

    async def forget(self: Store, scan: ScanRecord) -> None:
        await save(self, scan)
        await self._database.write(lambda db: db.execute("DELETE FROM scans WHERE id = ?", (scan.id,)))

    Store.save_scan = forget  # type: ignore[method-assign]


SABOTAGES: dict[str, Callable[[], None]] = {
    "an abort stops nothing": _stop_nothing,
    "nobody disarms": _leave_armed,
    "there is no box": _no_box,
    "an approach is not held against the point": _approach_anyhow,
    "roles are not asked": _let_anybody,
    "runs are not audited": _keep_no_audit,
    "scans are forgotten": _forget_scans,
    "nothing is applied": partial(setattr, Store, "apply", _apply_nothing),
}

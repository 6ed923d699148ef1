"""Externally Guided Motion of a RAPID program: a stream of positions to a sensor, and its corrections of the arm."""

import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calibration.kinematics.arm import UnreachablePoseError
from calibration.transforms import (
    Array,
    inverse,
    rotation_from_vector,
    transform,
    transform_from_quaternion,
    vector_from_rotation,
)
from mock_robot.cabinet.panel import robot_sample
from mock_robot.rapid.unit import MotionUnit
from protocols.egm.messages import Correction, RobotSample, decode_correction, encode
from protocols.egm.protobuf import NotEgm

PERIOD_S = 0.004
MAX_SPEED_DEG_S, MAX_DEVIATION_DEG = 1.0, 1000.0
"""\\MaxSpeedDeviation and \\MaxPosDeviation as delivered."""
LOOPBACK = "127.0.0.1"


Target = Callable[[Correction], Array | None]
"""Axes (6,) in rad that a correction gives; None for one that names nothing of this guidance."""


@dataclass
class EgmSession:
    """One EGM identity, from EGMGetId to EGMReset. It sends from its own thread while it streams or guides.

    `target`: port on this machine that it sends to, whatever address the device has; None sends nothing. `state`:
    taken, set up, streams, activated or runs. `guide`: where corrections move the arm, from `start`, while it runs.
    """

    unit: MotionUnit
    clock: Callable[[], float]
    state: str = "taken"
    kind: str = "joint"
    target: int | None = None
    every: int = 1
    settings: dict[str, Any] = field(default_factory=dict)
    guide: Target | None = None
    start: Array = field(default_factory=lambda: np.zeros(6))
    newest: Correction | None = None
    _ended: threading.Event = field(default_factory=threading.Event)
    _thread: threading.Thread | None = None
    _switching: threading.Lock = field(default_factory=threading.Lock)
    _freed: bool = False

    def begin(self) -> None:
        """Start sending; a no-op while it sends, and once it is freed: a statement may be under way then."""
        with self._switching:
            if self._thread is None and not self._freed:
                self._ended.clear()
                self._thread = threading.Thread(target=self._live, name="rapid EGM", daemon=True)
                self._thread.start()

    def end(self, free: bool = False) -> None:
        """Stop sending and guiding; `free`: for good."""
        self.guide = None
        with self._switching:
            self._freed |= free
            self._ended.set()
            thread, self._thread = self._thread, None
        if thread is not None and thread is not threading.current_thread():
            thread.join()

    def _live(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
            own.bind((LOOPBACK, self.unit.egm_ports.get(self.target, 0)))  # a device keeps its port
            self.unit.egm_ports[self.target] = own.getsockname()[1]
            own.setblocking(False)
            turn = 0
            while not self._ended.wait(PERIOD_S):
                turn += 1
                if self.target is not None and turn % self.every == 0:
                    with suppress(OSError):
                        own.sendto(encode(self._sample(turn)), (LOOPBACK, self.target))
                self._hear(own)
                self._follow()

    def _hear(self, own: socket.socket) -> None:
        with suppress(OSError):  # no more has come
            while True:
                data = own.recv(2048)
                with suppress(NotEgm):
                    self.newest = decode_correction(data)

    def _follow(self) -> None:
        """Move the arm by as much as one period allows; a correction out of its reach moves nothing."""
        guide, newest, unit = self.guide, self.newest, self.unit
        if guide is None or newest is None or unit.held or unit.stopped_by:
            return
        here, most_rad = unit.joints_now(), self._setting_rad("max_deviation", MAX_DEVIATION_DEG)
        with suppress(UnreachablePoseError):
            wanted = guide(newest)
            if wanted is None:
                return
            wanted = self.start + np.clip(wanted - self.start, -most_rad, most_rad)
            unit.arm.require_within_limits(wanted)
            period_s = PERIOD_S * unit.time_scale
            step = self._setting_rad("max_speed", MAX_SPEED_DEG_S) * period_s
            unit.cabinet.arm.guide(here + np.clip(wanted - here, -step, step), period_s, unit.now_s())

    def _setting_rad(self, name: str, usual_deg: float) -> float:
        given = self.settings.get(name)
        return float(np.radians(usual_deg if given is None else given))

    def _sample(self, number: int) -> RobotSample:
        """Pose of the tool in the work object that the program named: of the flange in the world without them."""
        unit, now_s = self.unit, self.clock()
        pose = inverse(self.settings.get("world_T_object", np.eye(4))) @ self.world_T_tool()
        return robot_sample(number, now_s, unit.joints_now(), pose, unit.cabinet.panel)

    def world_T_tool(self) -> Array:
        """Pose (4, 4) of the program's tool now."""
        world_T_flange = self.unit.world_T_flange(self.unit.joints_now(), self.unit.external_axes())
        pose: Array = world_T_flange @ self.settings.get("flange_T_tool", np.eye(4))
        return pose


def guide_joints(session: EgmSession, axes: list[bool]) -> Target:
    """Corrections are angles of the axes; those that are not named stay."""
    start, moves = session.unit.joints_now(), np.array(axes)

    def target(correction: Correction) -> Array | None:
        if len(correction.joints_deg) < len(start):
            return None
        joints: Array = np.where(moves, np.radians(correction.joints_deg[: len(start)]), start)
        return joints

    return target


def guide_pose(session: EgmSession, parts: list[bool]) -> Target:
    """Corrections are poses in the sensor's frame; the parts of the correction frame that are not named stay."""
    unit, settings, world_T_start = session.unit, session.settings, session.world_T_tool()
    corrected, sensed = settings["world_T_correction"], settings["world_T_sensor"]
    tool, external, moves = settings["flange_T_tool"], unit.external_axes(), np.array(parts)
    first = inverse(corrected) @ world_T_start

    def target(correction: Correction) -> Array | None:
        if len(correction.position_mm) != 3:
            return None
        turned = correction.quaternion_wxyz
        wanted = transform_from_quaternion(correction.position_mm, turned if len(turned) == 4 else (1.0, 0, 0, 0))
        wanted = inverse(corrected) @ sensed @ wanted
        shift = np.where(moves[:3], wanted[:3, 3], first[:3, 3])
        turn = np.where(moves[3:], vector_from_rotation(wanted[:3, :3] @ first[:3, :3].T), 0.0)
        goal = transform(rotation_from_vector(turn) @ first[:3, :3], shift)
        world_T_base = unit.cabinet.mounting.reported_world_T_base(tuple(external))
        joints: Array = unit.arm.nearest(inverse(world_T_base) @ corrected @ goal @ inverse(tool), unit.joints_now())
        return joints

    return target

"""Checks that the arm is at rest (two readings agree), is where it was sent, and did not move during a capture.

In cells that have EGM, also that the flange no longer vibrates.
"""

import asyncio
from dataclasses import dataclass
from math import degrees, radians

import numpy as np

from calibration.documents.external_axis import ExternalAxisDocument, external_axes_of
from calibration.sentences.sentence import Sentence
from calibration.transforms import (
    Array,
    difference,
    quaternion_from_rotation,
    rotation_angle_rad,
    rotation_from_quaternion,
)
from daemon.config.robot_settings import EgmSettings, SettlingSettings
from daemon.errors import CellNotReady, NotStill, PoseMismatch
from daemon.runtime.clock import Clock
from drivers.interfaces import PoseReading, Robot, Vibration, VibrationMonitor

ARRIVAL_TOLERANCE_MM, ARRIVAL_TOLERANCE_RAD = 2.0, radians(0.2)
"""Largest deviation of the reported pose from the commanded one; normally hundredths of a millimetre."""

MAX_EXTERNAL_MOVE = 0.05
"""Most that an external axis (mm or deg) moves while it is held."""


@dataclass(frozen=True)
class PoseDelta:
    """The difference of two pose readings; `external`: the most that an external axis moved, mm or deg."""

    translation_mm: float
    rotation_rad: float
    external: float = 0.0

    @classmethod
    def between(cls, before: PoseReading, after: PoseReading) -> "PoseDelta":
        axes = zip(before.external_axes, after.external_axes, strict=False)
        external = max((abs(now - then) for then, now in axes), default=0.0)
        return cls(*difference(before.base_T_flange, after.base_T_flange), external)

    def within(self, settling: SettlingSettings) -> bool:
        stands = self.translation_mm <= settling.translation_mm and self.rotation_rad <= settling.rotation_rad
        return stands and self.external <= MAX_EXTERNAL_MOVE

    @property
    def words(self) -> Sentence:
        moved = {"mm": self.translation_mm, "deg": degrees(self.rotation_rad)}
        if self.external > MAX_EXTERNAL_MOVE:
            return Sentence("moved-by-with-axis", **moved, external=self.external)
        return Sentence("moved-by", **moved)


async def settle(robot: Robot, settling: SettlingSettings, clock: Clock) -> PoseReading:
    """Wait until two readings `gap_s` apart agree and the controller reports no motion. Raises NotStill."""
    began_s = clock.monotonic_s()
    before = await robot.read_pose()
    while True:
        await clock.sleep(settling.gap_s)
        after = await robot.read_pose()
        delta = PoseDelta.between(before, after)
        if before.still and after.still and delta.within(settling):
            return after
        if clock.monotonic_s() - began_s > settling.limit_s:
            what = Sentence("not-at-rest-in-time", limit_s=settling.limit_s, delta=delta.words)
            raise NotStill(what, Sentence("look-for-vibration"))
        before = after


async def read_if_standing(robot: Robot, settling: SettlingSettings, clock: Clock) -> PoseReading:
    """The pose of an arm that an operator moves, from two readings that agree. Does not wait. Raises NotStill."""
    before = await robot.read_pose()
    await clock.sleep(settling.gap_s)
    after = await robot.read_pose()
    delta = PoseDelta.between(before, after)
    if before.still and after.still and delta.within(settling):
        return after
    what = Sentence("arm-not-at-rest-reported")
    if not delta.within(settling):
        what = Sentence("arm-not-at-rest-moved", delta=delta.words, gap_s=settling.gap_s)
    raise NotStill(what, Sentence("let-arm-stand"))


def check_external_axes(
    first: tuple[float, ...], now: tuple[float, ...], declared: ExternalAxisDocument | None = None
) -> None:
    """Raises NotStill when a track moved since the first reading: only some controllers include it in their poses.

    The axis `declared` in [robot.external_axis] may move; raises CellNotReady when the controller does not report it.
    """
    if declared is not None and declared.reading(external_axes_of(now)) is None:
        raise CellNotReady((Sentence("external-axis-missing", number=declared.number),))
    for number, (before, after) in enumerate(zip(first, now, strict=False), 1):
        if declared is not None and number == declared.number:
            continue
        if abs(after - before) > MAX_EXTERNAL_MOVE:
            what = Sentence("external-axis-moved", number=number, before=before, after=after)
            raise NotStill(what, Sentence("bring-axis-back", before=before))


def check_still(before: PoseReading, after: PoseReading, settling: SettlingSettings) -> None:
    """Raises NotStill when the arm moved between two readings, so that a capture in between has no pose."""
    delta = PoseDelta.between(before, after)
    if not (after.still and delta.within(settling)):
        raise NotStill(Sentence("moved-during-capture", delta=delta.words), Sentence("keep-arm-still"))


def check_arrival(sent_base_T_flange: Array, reading: PoseReading, pose_convention: str) -> None:
    """Raises PoseMismatch when the reported pose differs from the commanded one.

    This detects a wrong unit, quaternion order, tool or work object at the first move, before a picture is taken.
    """
    off_mm, off_rad = difference(sent_base_T_flange, reading.base_T_flange)
    if off_mm <= ARRIVAL_TOLERANCE_MM and off_rad <= ARRIVAL_TOLERANCE_RAD:
        return
    (x_mm, y_mm, z_mm), read_mm = sent_base_T_flange[:3, 3], reading.base_T_flange[:3, 3]
    what = Sentence(
        "stands-elsewhere", x_mm=x_mm, y_mm=y_mm, z_mm=z_mm, read_x_mm=read_mm[0], read_y_mm=read_mm[1],
        read_z_mm=read_mm[2], off_mm=off_mm, off_deg=degrees(off_rad),
    )  # fmt: skip
    raise PoseMismatch(what, _explanation(sent_base_T_flange, reading.base_T_flange, pose_convention))


def _explanation(sent: Array, read: Array, pose_convention: str) -> Sentence:
    """The likely cause of a deviation, and what to do."""
    w, x, y, z = quaternion_from_rotation(sent[:3, :3])
    scalar_last = rotation_from_quaternion([x, y, z, w])
    if np.linalg.norm(1000.0 * read[:3, 3] - sent[:3, 3]) <= ARRIVAL_TOLERANCE_MM:
        return Sentence("program-reports-metres")
    if rotation_angle_rad(scalar_last.T @ read[:3, :3]) <= ARRIVAL_TOLERANCE_RAD:
        return Sentence("program-scalar-last")
    return Sentence("program-pose-convention", convention=pose_convention)


POLL_S = 0.02


@dataclass(frozen=True)
class VibrationGate:
    """A vibration monitor with the allowed limits."""

    monitor: VibrationMonitor
    limits: EgmSettings

    async def wait(self, limit_s: float, clock: Clock) -> Vibration:
        """Wait until the vibration is within the limits; returns it. Raises NotStill, DeviceTimeout."""
        ends_s = clock.monotonic_s() + limit_s
        while True:
            try:
                return self.check()
            except NotStill:
                if clock.monotonic_s() > ends_s:
                    raise
            await clock.sleep(POLL_S)

    def check(self) -> Vibration:
        """The present vibration, if within the limits. Raises NotStill, DeviceTimeout."""
        vibration = self.monitor.vibration(self.limits.window_s)
        mm, deg = vibration.translation_mm, degrees(vibration.rotation_rad)
        if mm <= self.limits.translation_mm and deg <= self.limits.rotation_deg:
            return vibration
        raise NotStill(Sentence("flange-vibrates", mm=mm, deg=deg), Sentence("look-what-shakes"))

    async def close(self) -> None:
        await asyncio.to_thread(self.monitor.close)

"""When does the arm stand, and where? Two readings that agree with each other, with where it was sent, and with a third
after the picture."""

from dataclasses import dataclass
from math import degrees, radians

import numpy as np

from calibration.transforms import (
    Array,
    difference,
    quaternion_from_rotation,
    rotation_angle_rad,
    rotation_from_quaternion,
)
from daemon.config.settings import SettlingSettings
from daemon.errors import NotStill, PoseMismatch
from daemon.runtime.clock import Clock
from drivers.interfaces import PoseReading, Robot

ARRIVAL_TOLERANCE_MM, ARRIVAL_TOLERANCE_RAD = 2.0, radians(0.2)
"""A controller stops within hundredths of a millimetre of the goal, in its own numbers."""


@dataclass(frozen=True)
class PoseDelta:
    """How far two readings are apart."""

    translation_mm: float
    rotation_rad: float

    @classmethod
    def between(cls, before: PoseReading, after: PoseReading) -> "PoseDelta":
        return cls(*difference(before.base_T_flange, after.base_T_flange))

    def within(self, settling: SettlingSettings) -> bool:
        return self.translation_mm <= settling.translation_mm and self.rotation_rad <= settling.rotation_rad

    def __str__(self) -> str:
        return f"{self.translation_mm:.3f} mm and {degrees(self.rotation_rad):.4f}°"


async def settle(robot: Robot, settling: SettlingSettings, clock: Clock) -> PoseReading:
    """The pose once two readings `gap_s` apart agree and the controller says it stands. Raises NotStill."""
    began_s = clock.monotonic_s()
    before = await robot.read_pose()
    while True:
        await clock.sleep(settling.gap_s)
        after = await robot.read_pose()
        drift = PoseDelta.between(before, after)
        if before.still and after.still and drift.within(settling):
            return after
        if clock.monotonic_s() - began_s > settling.limit_s:
            raise NotStill(
                f"the arm did not come to rest within {settling.limit_s:g} s (it still moved by {drift})",
                "look for vibration or a soft servo; or allow more in [robot.settling]",
            )
        before = after


async def read_if_standing(robot: Robot, settling: SettlingSettings, clock: Clock) -> PoseReading:
    """The pose of an arm that somebody else moves, and that stands now: two readings. Raises NotStill at once."""
    before = await robot.read_pose()
    await clock.sleep(settling.gap_s)
    after = await robot.read_pose()
    drift = PoseDelta.between(before, after)
    if before.still and after.still and drift.within(settling):
        return after
    moved = (
        f"it moved by {drift} within {settling.gap_s:g} s" if not drift.within(settling) else "the controller says so"
    )
    raise NotStill(
        f"the arm is not at rest: {moved}", "let go of the joystick, wait until the arm stands, and ask again"
    )


def check_still(before: PoseReading, after: PoseReading, settling: SettlingSettings) -> None:
    """Raises NotStill when the arm moved between two readings: what was seen in between belongs to no pose."""
    drift = PoseDelta.between(before, after)
    if not (after.still and drift.within(settling)):
        raise NotStill(
            f"the arm moved by {drift} while it was looked at", "keep everything else from moving it, and look again"
        )


def check_arrival(sent_base_T_flange: Array, reading: PoseReading, pose_convention: str) -> None:
    """Raises ElsewhereThanSent when the pose that is read is not the one that was commanded.

    A wrong unit, quaternion order, tool or work object shows here at the first move, before a picture is taken.
    """
    off_mm, off_rad = difference(sent_base_T_flange, reading.base_T_flange)
    if off_mm <= ARRIVAL_TOLERANCE_MM and off_rad <= ARRIVAL_TOLERANCE_RAD:
        return
    raise PoseMismatch(
        f"the arm was sent to {_place(sent_base_T_flange)} mm and says it stands at {_place(reading.base_T_flange)} mm,"
        f" {off_mm:.4g} mm and {degrees(off_rad):.3g}° away",
        _explanation(sent_base_T_flange, reading.base_T_flange, pose_convention),
    )


def _place(base_T_flange: Array) -> str:
    return "({:.4g}, {:.4g}, {:.4g})".format(*base_T_flange[:3, 3])


def _explanation(sent: Array, read: Array, pose_convention: str) -> str:
    """What would explain it."""
    w, x, y, z = quaternion_from_rotation(sent[:3, :3])
    scalar_last = rotation_from_quaternion([x, y, z, w])
    if np.linalg.norm(1000.0 * read[:3, 3] - sent[:3, 3]) <= ARRIVAL_TOLERANCE_MM:
        return "it tells metres where millimetres belong: correct the controller's program"
    if rotation_angle_rad(scalar_last.T @ read[:3, :3]) <= ARRIVAL_TOLERANCE_RAD:
        return "its quaternion has the scalar part last where it belongs first: correct the controller's program"
    return f"see that the controller's program gives {pose_convention}"

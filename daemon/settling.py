"""When does the arm stand? Two readings that agree; and after the picture a third that agrees with them."""

from dataclasses import dataclass
from math import degrees

from calibration.transforms import difference
from daemon.clock import Clock
from daemon.errors import NotStill
from daemon.settings import SettlingSettings
from drivers.interfaces import PoseReading, Robot


@dataclass(frozen=True)
class Drift:
    """How far two readings are apart."""

    translation_mm: float
    rotation_rad: float

    @classmethod
    def between(cls, before: PoseReading, after: PoseReading) -> "Drift":
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
        drift = Drift.between(before, after)
        if before.still and after.still and drift.within(settling):
            return after
        if clock.monotonic_s() - began_s > settling.limit_s:
            raise NotStill(
                f"the arm did not come to rest within {settling.limit_s:g} s (it still moved by {drift})",
                "look for vibration or a soft servo; or allow more in [robot.settling]",
            )
        before = after


async def standing(robot: Robot, settling: SettlingSettings, clock: Clock) -> PoseReading:
    """The pose of an arm that somebody else moves, and that stands now: two readings. Raises NotStill at once."""
    before = await robot.read_pose()
    await clock.sleep(settling.gap_s)
    after = await robot.read_pose()
    drift = Drift.between(before, after)
    if before.still and after.still and drift.within(settling):
        return after
    moved = (
        f"it moved by {drift} within {settling.gap_s:g} s" if not drift.within(settling) else "the controller says so"
    )
    raise NotStill(
        f"the arm is not at rest: {moved}", "let go of the joystick, wait until the arm stands, and ask again"
    )


def require_still(before: PoseReading, after: PoseReading, settling: SettlingSettings) -> None:
    """Raises NotStill when the arm moved between two readings: what was seen in between belongs to no pose."""
    drift = Drift.between(before, after)
    if not (after.still and drift.within(settling)):
        raise NotStill(
            f"the arm moved by {drift} while it was looked at", "keep everything else from moving it, and look again"
        )

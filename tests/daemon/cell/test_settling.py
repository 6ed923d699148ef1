"""When does the arm stand?"""

from dataclasses import dataclass, field, replace

import pytest

from calibration.documents.external_axis import ExternalAxisDocument
from calibration.transforms import transform_from_quaternion
from daemon.cell.settling import check_arrival, check_external_axes, check_still, settle
from daemon.config.robot_settings import SettlingSettings
from daemon.errors import CellNotReady, NotStill, PoseMismatch
from daemon.runtime.clock import Clock
from drivers.interfaces import PoseReading
from drivers.robots.abb.robtarget import POSE_CONVENTION, UNUSED_AXIS
from tests.daemon.fakes import FakeRobot, pose_reading

SETTLING = SettlingSettings()


@dataclass
class Scripted(FakeRobot):
    """Gives the readings one after another, then the last for ever."""

    readings: list[PoseReading] = field(default_factory=list)

    async def read_pose(self) -> PoseReading:
        return self.readings.pop(0) if len(self.readings) > 1 else self.readings[0]


@dataclass
class Time:
    """A clock that a sleep moves."""

    now_s: float = 0.0

    async def sleep(self, seconds: float) -> None:
        self.now_s += seconds

    def clock(self) -> Clock:
        return replace(Clock(), monotonic_s=lambda: self.now_s, sleep=self.sleep)


@pytest.mark.parametrize(
    ("readings", "looks"),
    [
        ([pose_reading(0), pose_reading(0)], 1),
        ([pose_reading(0), pose_reading(0.019)], 1),
        ([pose_reading(0), pose_reading(0.021), pose_reading(0.021)], 2),
        ([pose_reading(0), pose_reading(turn_deg=0.0049)], 1),
        ([pose_reading(0), pose_reading(turn_deg=0.0051), pose_reading(turn_deg=0.0051)], 2),
        ([pose_reading(0, still=False), pose_reading(0), pose_reading(0)], 2),
        ([pose_reading(0), pose_reading(0, still=False), pose_reading(0), pose_reading(0)], 3),
        ([pose_reading(5), pose_reading(3), pose_reading(1), pose_reading(0), pose_reading(0)], 4),
    ],
)
async def test_two_readings_that_agree_while_the_controller_says_still(readings: list[PoseReading], looks: int) -> None:
    time, last = Time(), readings[-1]
    assert await settle(Scripted(readings=readings), SETTLING, time.clock()) is last
    assert time.now_s == pytest.approx(looks * SETTLING.gap_s)


async def test_an_arm_that_never_rests_is_reported_with_how_far_it_moves() -> None:
    time = Time()
    readings = [pose_reading(k % 2) for k in range(1000)]
    with pytest.raises(NotStill, match=r"did not come to rest within 10 s.*1\.000 mm"):
        await settle(Scripted(readings=readings), SETTLING, time.clock())
    assert time.now_s == pytest.approx(10, abs=0.2)


def test_what_was_seen_while_the_arm_moved_belongs_to_no_pose() -> None:
    check_still(pose_reading(0), pose_reading(0.01), SETTLING)
    for after in (pose_reading(0.03), pose_reading(turn_deg=0.01), pose_reading(0, still=False)):
        with pytest.raises(NotStill, match="during the capture"):
            check_still(pose_reading(0), after, SETTLING)


SENT = transform_from_quaternion([515.0, -20.0, 712.0], [0.7, 0.1, 0.7, -0.1])


def read_as(position_mm: list[float], quaternion_wxyz: list[float]) -> PoseReading:
    return replace(pose_reading(), base_T_flange=transform_from_quaternion(position_mm, quaternion_wxyz))


@pytest.mark.parametrize(
    ("told", "fix"),
    [
        (read_as([0.515, -0.02, 0.712], [0.7, 0.1, 0.7, -0.1]), "metres where millimetres belong"),
        (read_as([515, -20, 712], [0.1, 0.7, -0.1, 0.7]), "scalar part last"),
        (read_as([515, -20, 912], [0.7, 0.1, 0.7, -0.1]), "tool0 in wobj0"),
        (read_as([515, -20, 712], [0.7, 0.11, 0.7, -0.1]), "tool0 in wobj0"),
    ],
)
def test_a_pose_that_is_not_where_the_arm_was_sent(told: PoseReading, fix: str) -> None:
    with pytest.raises(PoseMismatch, match=fix):
        check_arrival(SENT, told, POSE_CONVENTION)


def test_a_controller_stops_within_its_own_resolution() -> None:
    check_arrival(SENT, read_as([515.3, -20.0, 712.2], [0.7, 0.1001, 0.7, -0.1]), POSE_CONVENTION)


TRACK = ExternalAxisDocument(kind="track", number=2, direction=(0.0, 1.0, 0.0))


def axes(first: float, second: float) -> tuple[float, ...]:
    return (first, second, *(UNUSED_AXIS,) * 4)


def test_a_track_that_creeps_is_not_still_although_the_pose_does_not_show_it() -> None:
    before = replace(pose_reading(0), external_axes=axes(UNUSED_AXIS, 100.0))
    after = replace(before, external_axes=axes(UNUSED_AXIS, 100.1))
    with pytest.raises(NotStill, match=r"an external axis by 0\.10"):
        check_still(before, after, SETTLING)


def test_the_declared_axis_may_move_between_views_and_no_other() -> None:
    check_external_axes(axes(10.0, 0.0), axes(10.0, 900.0), TRACK)
    with pytest.raises(NotStill, match="external axis 1 moved"):
        check_external_axes(axes(10.0, 0.0), axes(30.0, 900.0), TRACK)
    with pytest.raises(NotStill, match=r"declare it in \[robot.external_axis\]"):
        check_external_axes(axes(10.0, 0.0), axes(10.0, 900.0))
    with pytest.raises(CellNotReady, match="no external axis 2"):
        check_external_axes(axes(10.0, 0.0), axes(10.0, UNUSED_AXIS), TRACK)

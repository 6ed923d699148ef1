"""Whether the arm stands between a camera beside it and the target on its flange."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from calibration.kinematics.abb_arms import find_arm
from calibration.planning.line_of_sight import ARM_RADIUS_MM, LineOfSight, distance_of_segments, line_of_sight
from calibration.planning.reachability import reachable_by
from calibration.targets import Chessboard
from calibration.transforms import Array, transform

ARM = find_arm("IRB 1600-6/1.45")
TARGET = Chessboard(9, 6, 20.0)
AHEAD = np.radians([0.0, 27.0, 15.0, 0.0, -80.0, 0.0])
"""The flange is lifted in front of the robot and faces away from it."""

coordinate = st.floats(-500, 500)
point = st.tuples(coordinate, coordinate, coordinate).map(np.array)


def sight_from(camera_mm: tuple[float, float, float]) -> LineOfSight:
    """A camera that looks from there at a target on the flange."""
    found = line_of_sight("eye-to-hand", TARGET, transform(np.eye(3), camera_mm), transform(np.eye(3), [0, 0, 30]))
    assert found is not None
    return found


@given(point, point, point, point)
def test_the_distance_of_two_segments_is_that_of_their_nearest_points(a: Array, b: Array, c: Array, d: Array) -> None:
    share = np.linspace(0, 1, 101)[:, None]
    first, second = a + share * (b - a), c + share * (d - c)
    sampled = np.linalg.norm(first[:, None] - second[None], axis=-1).min()
    step = (np.linalg.norm(b - a) + np.linalg.norm(d - c)) / 200
    found = distance_of_segments(a, b, c, d)
    assert found <= sampled + 1e-6
    assert found >= sampled - step - 1e-6


def test_a_camera_in_front_sees_the_target_and_one_behind_the_robot_does_not() -> None:
    assert sight_from((1500.0, 0.0, 1300.0)).is_clear(ARM, AHEAD[None]).all()
    assert not sight_from((-900.0, 0.0, 900.0)).is_clear(ARM, AHEAD[None]).any()


def test_a_camera_on_the_flange_has_no_arm_in_its_way() -> None:
    assert line_of_sight("eye-in-hand", TARGET, np.eye(4), np.eye(4)) is None


def test_poses_that_hide_the_target_are_not_planned() -> None:
    pose = ARM.forward(AHEAD)[None]
    assert reachable_by(ARM, AHEAD, sight=sight_from((1500.0, 0.0, 1300.0)))(pose).all()
    assert not reachable_by(ARM, AHEAD, sight=sight_from((-900.0, 0.0, 900.0)))(pose).any()
    assert reachable_by(ARM, AHEAD)(pose).all()


def test_a_link_counts_with_its_thickness() -> None:
    shoulder, elbow = ARM.skeleton(AHEAD)[:2]
    beside = (shoulder + elbow) / 2 + [0.0, 0.9 * ARM_RADIUS_MM, 0.0]
    target = ARM.forward(AHEAD)[:3, 3]
    behind = beside - 2 * (target - beside)
    assert not sight_from(tuple(behind)).is_clear(ARM, AHEAD[None]).any()

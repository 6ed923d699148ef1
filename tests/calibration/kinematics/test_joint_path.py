"""The path of the flange and of what it carries in a joint move, against an independent chain of links."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import Arm
from calibration.kinematics.joint_path import (
    MAX_CHORD_ERROR_MM,
    MAX_STEP_RAD,
    Box,
    leaves_box,
    path_mm,
    stay_in_box,
)
from calibration.transforms import Array
from tests.calibration.kinematics.link_chain import DIFFERENT, LARGE, joints_of, urdf_chain

POINTS = [(0.0, 0.0, 0.0), (0.0, 0.0, 350.0), (200.0, -150.0, 100.0), (-400.0, 0.0, 0.0)]


def positions_mm(arm: Arm, start: Array, end: Array, along: Array, point_mm: Sequence[float] = POINTS[0]) -> Array:
    poses = np.array([urdf_chain(arm, start + each * (end - start)) for each in along])
    return poses[:, :3, :3] @ np.asarray(point_mm) + poses[:, :3, 3]


@settings(max_examples=40, deadline=None)
@given(st.sampled_from(DIFFERENT), st.data(), st.sampled_from(POINTS))
def test_a_point_stays_near_the_chords_and_no_axis_turns_far(
    arm: Arm, data: st.DataObject, point_mm: tuple[float, float, float]
) -> None:
    start, end = data.draw(joints_of(arm)), data.draw(joints_of(arm))
    points = path_mm(arm, start, end, np.array([point_mm]))[:, 0]
    steps = len(points) - 1
    assert np.abs(end - start).max() / steps <= MAX_STEP_RAD + 1e-12
    for step in np.linspace(0, steps - 1, min(steps, 20)).astype(int):
        within = np.linspace(0.0, 1.0, 7)
        seen = positions_mm(arm, start, end, (step + within) / steps, point_mm)
        np.testing.assert_allclose(seen[[0, -1]], points[step : step + 2], atol=1e-6)
        chords = points[step] + within[:, None] * (points[step + 1] - points[step])
        assert np.linalg.norm(seen - chords, axis=1).max() < MAX_CHORD_ERROR_MM


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(st.sampled_from(DIFFERENT), st.data(), st.floats(0.2, 1.5))
def test_what_stays_in_the_box_is_nowhere_outside_by_more_than_a_chord_error(
    arm: Arm, data: st.DataObject, size: float
) -> None:
    start, end = data.draw(joints_of(arm)), data.draw(joints_of(arm))
    half = size * arm.reach_mm
    box = Box((-half, -half, 0.0), (half, half, 1.5 * half))
    furthest = box.outside_mm(positions_mm(arm, start, end, np.linspace(0, 1, 400))).max()
    found = leaves_box(arm, start, end, box)
    assert bool(stay_in_box(arm, start, end[None], box)[0]) is (found is None)
    if found is None:
        assert furthest < MAX_CHORD_ERROR_MM
    else:
        assert found.outside_mm > furthest - 2 * MAX_CHORD_ERROR_MM
        (there,) = positions_mm(arm, start, end, np.array([found.along]))
        np.testing.assert_allclose(found.flange_mm, there, atol=1e-6)


def test_a_swing_is_found_at_its_furthest_and_a_slack_allows_it() -> None:
    start, end = np.radians([[-60.0, 20, 10, 0, 60, 0], [60, 20, 10, 0, 60, 0]])
    ends_mm, middle_mm = LARGE.forward(start)[:3, 3], LARGE.forward((start + end) / 2)[:3, 3]
    box = Box((-2000, -2000, 0), (float(ends_mm[0]) + 1, 2000, 2000))
    found = leaves_box(LARGE, start, end, box)
    assert found is not None
    assert found.along == pytest.approx(0.5, abs=0.03)
    assert found.outside_mm == pytest.approx(middle_mm[0] - box.high_mm[0], abs=MAX_CHORD_ERROR_MM)
    assert leaves_box(LARGE, start, end, box, slack_mm=found.outside_mm) is None


def test_what_is_carried_leaves_the_box_before_the_flange_does() -> None:
    """A roll of axis 6: the flange's origin stays where it is, the camera beside it swings out and back."""
    start, end = np.radians([[0.0, 20, 10, 0, 60, -90], [0, 20, 10, 0, 60, 90]])
    origin_mm = LARGE.forward(start)[:3, 3]
    box = Box(tuple(origin_mm - 250.0), tuple(origin_mm + 250.0))  # type: ignore[arg-type]
    assert leaves_box(LARGE, start, end, box) is None
    assert leaves_box(LARGE, start, end, box, points_mm=np.array([[0.0, 0.0, 0.0], [200.0, 0.0, 0.0]])) is None
    found = leaves_box(LARGE, start, end, box, points_mm=np.array([[0.0, 0.0, 0.0], [300.0, 0.0, 0.0]]))
    assert found is not None
    assert found.carried
    assert np.linalg.norm(found.flange_mm - origin_mm) == pytest.approx(300.0)


def test_a_path_that_goes_nowhere_is_where_the_arm_stands() -> None:
    joints = np.radians([10.0, 20, 10, 0, 60, 0])
    found = leaves_box(LARGE, joints, joints, Box((0, 0, 0), (100, 100, 100)))
    assert found is not None
    assert found.along == 0
    np.testing.assert_allclose(found.flange_mm, urdf_chain(LARGE, joints)[:3, 3], atol=1e-9)


def test_several_ends_are_judged_each_by_its_own_path() -> None:
    now = np.radians([0.0, 20, 10, 0, 60, 0])
    ends = now + np.radians([[20.0, 0, 0, 0, 0, 0], [170, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 300]])
    box = Box((500, -800, 0), (2000, 800, 2000))
    assert stay_in_box(find_arm("IRB 1600-6/1.45"), now, ends, box).tolist() == [True, False, True]

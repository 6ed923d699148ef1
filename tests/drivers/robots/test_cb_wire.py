"""Millimetres, degrees and quaternions at the wire become transforms, and back."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.kinematics.arm import Configuration
from calibration.transforms import rotation_from_quaternion, transform
from drivers.errors import GarbledAnswer, MoveRefused
from drivers.interfaces import MoveGoal, Standstill
from drivers.robots.abb.cb_wire import joints_rad, move_of, pose_reading, standstill
from drivers.robots.abb.robtarget import UNUSED_AXIS
from protocols.cb.codes import Flag, MoveKind
from protocols.cb.layouts import pack, unpack
from protocols.cb.messages import Joints, Pose, Report
from tests.drivers.robots.fake_controller import BASE_T_FLANGE

NO_AXES = (9e9,) * 6
POSTURE = Configuration(0, -1, 2, 0)


def pose(position=(1.0, 2.0, 3.0), quaternion=(1.0, 0.0, 0.0, 0.0), axes=NO_AXES, flags=Flag.IN_POSITION):
    return Pose(position, quaternion, tuple(POSTURE), axes, 0, flags)


def test_the_scalar_comes_first():
    quarter_about_x = pose(quaternion=(math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0))
    base_T_flange = pose_reading("r", quarter_about_x, 0.0).base_T_flange
    np.testing.assert_allclose(base_T_flange @ [0, 1, 0, 1], [1, 2, 4, 1], atol=1e-12)


def test_axes_that_are_there_are_kept_and_9e9_is_unused():
    axes = pose_reading("r", pose(axes=(8999999488.0, 8.9e9, 12.5, -90.0, 0.0, 8.8e9)), 0.0).external_axes
    assert axes == (UNUSED_AXIS, UNUSED_AXIS, 12.5, -90.0, 0.0, 8.8e9)


@pytest.mark.parametrize(
    ("flags", "still"),
    [(Flag.IN_POSITION, True), (Flag.MOVING, False), (Flag.IN_POSITION | Flag.MOVING, False), (Flag(0), False)],
)
def test_still_means_in_position_and_not_moving(flags, still):
    assert pose_reading("r", pose(flags=flags), 0.0).still is still


@pytest.mark.parametrize(
    ("flags", "progress_per_mille", "standing", "disarmed"),
    [
        (Flag.TASK_RUNNING | Flag.IN_POSITION, 1000, True, True),
        (Flag.TASK_RUNNING | Flag.IN_POSITION | Flag.ARMED, 1000, True, False),
        (Flag.TASK_RUNNING | Flag.MOVING, 1000, False, True),
        (Flag.TASK_RUNNING | Flag.IN_POSITION, 0, False, True),  # accepted, not begun
        (Flag.TASK_RUNNING, 1000, False, True),  # stopped, not settled
        (Flag(0), 1000, True, True),  # the program does not run, and reports no position
        (Flag.MOVING, 1000, False, True),
    ],
)
def test_an_arm_stands_when_no_move_is_under_way_or_pending(flags, progress_per_mille, standing, disarmed):
    report = Report(flags, 1, 0, progress_per_mille, 0)
    assert standstill(report) == Standstill(standing, disarmed)


@pytest.mark.parametrize("norm", [0.9979, 1.0021, 0.0, 2.0])
def test_a_quaternion_of_another_norm_is_refused(norm):
    with pytest.raises(GarbledAnswer, match="quaternion norm"):
        pose_reading("r", pose(quaternion=(norm, 0.0, 0.0, 0.0)), 0.0)


def test_a_quaternion_of_three_decimals_is_a_true_rotation():
    base_R_flange = pose_reading("r", pose(quaternion=(0.707, 0.0, 0.708, 0.001)), 0.0).base_T_flange[:3, :3]
    np.testing.assert_allclose(base_R_flange @ base_R_flange.T, np.eye(3), atol=1e-14)


@pytest.mark.parametrize(
    "garbled",
    [
        pose(position=(math.nan, 0.0, 0.0)),
        pose(quaternion=(1.0, math.inf, 0.0, 0.0)),
        pose(axes=(math.inf, *NO_AXES[:5])),
    ],
    ids=["position", "quaternion", "axes"],
)
def test_a_number_that_is_none_is_refused(garbled):
    with pytest.raises(GarbledAnswer, match="a number that is none"):
        pose_reading("r", garbled, 0.0)
    with pytest.raises(GarbledAnswer):
        joints_rad("r", Joints((math.nan, 0, 0, 0, 0, 0), NO_AXES))


@pytest.mark.parametrize(
    ("goal", "reason"),
    [
        (MoveGoal(BASE_T_FLANGE * np.nan, POSTURE), "finite"),
        (MoveGoal(np.eye(3), POSTURE), "4×4"),
        (MoveGoal(BASE_T_FLANGE * np.array([1.01, 1, 1, 1]), POSTURE), "not a rotation"),
        (MoveGoal(np.diag([1.0, 1, -1, 1]), POSTURE), "not a rotation"),
        (MoveGoal(np.diag([1.0, 1, 1, 2]), POSTURE), "not a rotation"),
        (MoveGoal(BASE_T_FLANGE, Configuration(0, 0, 0, 99999)), "configuration"),
        (MoveGoal(BASE_T_FLANGE, POSTURE, speed_mm_s=0.0), "speed of 0.0"),
        (MoveGoal(BASE_T_FLANGE, POSTURE, speed_mm_s=math.nan), "speed of nan"),
        (MoveGoal(BASE_T_FLANGE, POSTURE, speed_mm_s=1e39), "too large"),
        (MoveGoal(BASE_T_FLANGE, Configuration(0, 0.5, 0, 0)), "integer"),
        (MoveGoal(BASE_T_FLANGE, POSTURE, external_axes=(9e9,)), "six numbers"),
        (MoveGoal(BASE_T_FLANGE, POSTURE, path="circular"), "joint or linear"),
        (MoveGoal(transform(np.eye(3), (1e9, 0, 0)), POSTURE), "positions are millimetres"),
    ],
    ids=[
        "nan",
        "3x3",
        "bent",
        "mirrored",
        "scaled",
        "posture",
        "speed 0",
        "speed nan",
        "speed huge",
        "half quarter",
        "axes",
        "path",
        "far",
    ],
)
def test_a_goal_that_no_controller_can_take(goal, reason):
    with pytest.raises(MoveRefused, match=reason) as refused:
        move_of("r", goal)
    assert refused.value.status == "BAD_FIELD"


unit = st.tuples(*(st.floats(-1, 1) for _ in range(4))).filter(lambda q: sum(x * x for x in q) > 0.01)
inside = st.tuples(*(st.floats(-2000, 2000) for _ in range(3)))


@given(unit, inside)
def test_a_goal_comes_back_as_the_pose_it_was(quaternion, position):
    base_T_flange = transform(rotation_from_quaternion(np.array(quaternion) / np.linalg.norm(quaternion)), position)
    move = move_of("r", MoveGoal(base_T_flange, POSTURE))
    assert move.kind is MoveKind.JOINT
    there = Pose(move.position_mm, move.quaternion_wxyz, move.configuration, move.external_axes, 0, Flag(0))
    back = pose_reading("r", unpack(Pose, pack(there)), 0.0)
    np.testing.assert_allclose(back.base_T_flange[:3, :3], base_T_flange[:3, :3], atol=3e-7)
    np.testing.assert_allclose(back.base_T_flange[:3, 3], position, atol=1.3e-4)
    assert back.posture == POSTURE

"""An arm with seven axes: eax_a is axis 7 in a jointtarget, and the arm angle in a robtarget."""

import numpy as np
import pytest

from calibration.kinematics.arm import Configuration
from drivers.errors import GarbledAnswer, MoveRefused
from drivers.interfaces import JointGoal, MoveGoal
from drivers.robots.abb.cb_wire import joint_move_of, joints_rad, move_of, pose_reading
from drivers.robots.abb.robtarget import UNUSED_AXIS
from drivers.robots.abb.rws import parsing
from protocols.cb.codes import Flag
from protocols.cb.messages import Joints, Pose

POSTURE = Configuration(0, -1, 2, 110)
UNUSED = (UNUSED_AXIS,) * 5
ROBTARGET_OF_SEVEN = {"x": "515", "y": "0", "z": "712", "q1": "1", "q2": "0", "q3": "0", "q4": "0",
                      "cf1": "0", "cf4": "-1", "cf6": "2", "cfx": "110", "eax_a": "101.96",
                      **{f"eax_{axis}": "9E+09" for axis in "bcdef"}}  # fmt: skip
AXES_DEG = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


def test_the_arm_angle_is_no_external_axis_and_goes_back_in_its_place() -> None:
    pose = Pose((1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0), tuple(POSTURE), (101.96, *UNUSED), 0, Flag.IN_POSITION)
    reading = pose_reading("r", pose, 0.0, axes=7)
    assert (reading.arm_angle_deg, reading.external_axes) == (101.96, (UNUSED_AXIS, *UNUSED))
    goal = MoveGoal(reading.base_T_flange, reading.posture, reading.external_axes, arm_angle_deg=reading.arm_angle_deg)
    assert move_of("r", goal).external_axes == pose.external_axes
    over_rws = parsing.pose("r", ROBTARGET_OF_SEVEN, 0.0, axes=7)
    assert (over_rws.arm_angle_deg, over_rws.external_axes) == (101.96, (UNUSED_AXIS, *UNUSED))


def test_of_an_arm_with_six_axes_the_same_number_is_an_external_axis() -> None:
    assert parsing.pose("r", ROBTARGET_OF_SEVEN, 0.0).arm_angle_deg is None
    assert parsing.pose("r", ROBTARGET_OF_SEVEN, 0.0).external_axes[0] == 101.96


def test_axis_7_is_read_behind_axis_6_and_moved_there() -> None:
    read = joints_rad("r", Joints(AXES_DEG, (77.0, *UNUSED)), axes=7)
    np.testing.assert_allclose(np.degrees(read), [*AXES_DEG, 77.0])
    values = {**{f"rax_{axis}": str(axis) for axis in range(1, 7)}, "eax_a": "77"}
    np.testing.assert_allclose(np.degrees(parsing.joints_rad("r", values, axes=7)), [*AXES_DEG, 77.0])
    move = joint_move_of("r", JointGoal(read), axes=7)
    assert move.axes_deg == pytest.approx(AXES_DEG)
    assert move.external_axes == pytest.approx((77.0, *UNUSED))


def test_an_arm_without_axis_7_is_named() -> None:
    with pytest.raises(GarbledAnswer, match="no axis 7"):
        joints_rad("r", Joints(AXES_DEG, (UNUSED_AXIS, *UNUSED)), axes=7)
    with pytest.raises(MoveRefused, match="7 angles are wanted"):
        joint_move_of("r", JointGoal(np.zeros(6)), axes=7)

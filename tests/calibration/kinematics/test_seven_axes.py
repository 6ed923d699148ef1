"""The single-arm YuMi: RobotStudio's poses and arm angles, and joints found from them.

The ten rows were recorded with RobotStudio by the authors of rpiRobotics/yumi-ik (efa14ea,
unit_tests/compare_to_robotstudio.m), rounded to 0.01 mm and 0.01 deg.
"""

import numpy as np
import pytest

from calibration.errors import GeometryError
from calibration.kinematics.abb_arms import find_any_arm, find_arm
from calibration.kinematics.arm import OtherConfiguration, OutOfReach, OutsideJointLimits
from calibration.kinematics.axis_rotations import rotation_x, rotation_y, rotation_z, wrap
from calibration.kinematics.seven_axes import IRB_14050, OUTWARDS
from calibration.transforms import Array, difference, transform

ROBOTSTUDIO = """
axes outwards, 1 2 7 3 4 5 6   | position                | rotation x y z         | arm angle
   0    0    0   0    0   0    0 |  341.50    0.00 598.00 |    0.00  90.00    0.00 |    0.00
  20   20   20  20   20  20   20 |  292.46  234.73 348.75 |  148.67  16.13  175.45 |    6.86
  30   30   30  30   30  30   30 |  165.49  290.86 255.37 |  157.34 -19.80 -175.99 |   14.50
 -40  -40  -40 -40  -40 -40  -40 | -219.17   12.62 796.12 |   13.67  -3.39 -152.29 |  106.67
 -80  -80  -80 -80  -80 -80  -80 | -126.60  499.23 441.88 |    5.30  17.08   34.27 |   99.01
 104  -31    1 -18  -55 117   69 |   32.02   91.43 763.94 |  157.59  43.43  170.70 |   19.58
 162    1  -23 -88  241  98  -44 |   45.84   32.22 846.74 |  -98.58  43.30  -76.21 |   80.07
 -20 -139 -144  77 -263 128 -104 |  -47.12 -136.89 270.77 | -106.88 -60.36  122.56 |  139.68
  67 -142  121  78  -38 113 -194 | -100.23    3.25 338.01 |   43.05 -59.81   44.29 | -146.69
 -58 -138  -35  70 -283 133  207 | -123.66  141.01 425.04 | -118.25 -37.89  -10.09 |  165.86
"""
ROWS = [[np.array(part.split(), float) for part in row.split("|")] for row in ROBOTSTUDIO.splitlines()[2:]]


def in_order_of_numbers(outwards_deg: Array) -> Array:
    """Joints (7,) rad of axes 1 to 7, from those in the order of the chain."""
    joints = np.empty(7)
    joints[OUTWARDS] = np.radians(outwards_deg)
    return joints


@pytest.mark.parametrize(("outwards", "position_mm", "turns_deg", "arm_angle_deg"), ROWS)
def test_flange_and_arm_angle_are_those_of_robotstudio(
    outwards: Array, position_mm: Array, turns_deg: Array, arm_angle_deg: Array
) -> None:
    joints, (x, y, z) = in_order_of_numbers(outwards), np.radians(turns_deg)
    expected = transform(rotation_z(z) @ rotation_y(y) @ rotation_x(x), position_mm)
    off_mm, off_rad = difference(expected, IRB_14050.forward(joints))
    assert off_mm < 0.01
    assert np.degrees(off_rad) < 0.01
    assert np.degrees(wrap(IRB_14050.arm_angle_rad(joints) - np.radians(arm_angle_deg[0]))) == pytest.approx(
        0, abs=0.01
    )


def some_joints(count: int) -> Array:
    low, high = np.array(IRB_14050.lower_rad), np.array(IRB_14050.upper_rad)
    return low + (high - low) * np.random.default_rng(14050).uniform(0.05, 0.95, (count, 7))


def test_joints_are_found_from_pose_arm_angle_and_configuration() -> None:
    for joints in some_joints(2):
        pose, angle = IRB_14050.forward(joints), float(IRB_14050.arm_angle_rad(joints))
        found = IRB_14050.matching(pose, angle, IRB_14050.configuration(joints), np.zeros(7))
        IRB_14050.require_within_limits(found)
        assert max(difference(pose, IRB_14050.forward(found))) < 1e-5
        assert wrap(IRB_14050.arm_angle_rad(found) - angle) == pytest.approx(0, abs=1e-6)
        assert IRB_14050.configuration(found) == IRB_14050.configuration(joints)


def test_from_near_by_the_same_joints_are_found() -> None:
    for joints in some_joints(20):
        angle = float(IRB_14050.arm_angle_rad(joints))
        found = IRB_14050.matching(IRB_14050.forward(joints), angle, IRB_14050.configuration(joints), joints + 0.01)
        assert np.abs(found - joints).max() < 1e-5


def test_the_nearest_joints_of_a_pose_let_the_elbow_turn() -> None:
    joints = some_joints(1)[0]
    pose = IRB_14050.forward(joints + 0.05)
    found = IRB_14050.nearest(pose, joints)
    assert max(difference(pose, IRB_14050.forward(found))) < 1e-5
    assert np.linalg.norm(found - joints) <= np.linalg.norm(np.full(7, 0.05)) + 1e-3


def test_what_cannot_be_reached_is_named() -> None:
    far = transform(np.eye(3), (900.0, 0.0, 300.0))
    with pytest.raises(OutOfReach):
        IRB_14050.nearest(far, np.zeros(7))
    with pytest.raises(OutsideJointLimits, match="axis 2"):
        IRB_14050.require_within_limits(np.radians([0, 60, 0, 0, 0, 0, 0]))
    joints = some_joints(1)[0]
    with pytest.raises(OtherConfiguration, match="use one of"):
        IRB_14050.matching(IRB_14050.forward(joints), float(IRB_14050.arm_angle_rad(joints)), (9, 0, 0, 0), joints)


def test_it_is_found_by_its_name_but_not_where_six_axes_are_needed() -> None:
    assert find_any_arm("irb 14050-0.5/0.50") is IRB_14050
    with pytest.raises(GeometryError, match="seven axes"):
        find_arm("IRB 14050-0.5/0.5")

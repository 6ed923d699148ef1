"""Joints of poses: in the posture that confdata names, or none without."""

import numpy as np
import pytest

from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import OtherConfiguration
from calibration.kinematics.joints_of_poses import joints_of_poses
from calibration.transforms import Array

ARM = find_arm("IRB 2600-20/1.65")


@pytest.mark.parametrize("seed", range(5))
def test_the_posture_is_that_of_the_confdata(seed: int) -> None:
    """Postures at random, as an arm takes them that is taught one by one: the least travel finds few of them."""
    rng, joints = np.random.default_rng(seed), list[Array]()
    while len(joints) < 12:
        one = rng.uniform(0.9 * np.array(ARM.lower_rad), 0.9 * np.array(ARM.upper_rad))
        if abs(np.sin(one[4])) > 0.05:
            joints.append(one)
    poses = list(ARM.forward(np.array(joints)))
    confdata = [ARM.configuration(one) for one in joints]
    found = joints_of_poses(ARM, poses, [None] * 12, confdata)
    np.testing.assert_allclose(np.array(found), joints, atol=1e-6)


def test_a_pose_with_neither_joints_nor_confdata_has_none() -> None:
    joints = np.radians([[10.0, 20, 10, 5, 40, 0], [0.0, 30, 5, 0, 50, 10], [5.0, 20, 0, 0, 45, 0]])
    known, confdata = [joints[0], None, None], [None, None, ARM.configuration(joints[2])]
    first, without, last = joints_of_poses(ARM, list(ARM.forward(joints)), known, confdata)
    assert without is None
    np.testing.assert_allclose(np.array([first, last]), joints[[0, 2]], atol=1e-6)


def test_a_posture_that_does_not_reach_the_pose_is_refused() -> None:
    pose = ARM.forward(np.radians([10.0, 20, 10, 5, 40, 0]))
    with pytest.raises(OtherConfiguration, match="use one of"):
        joints_of_poses(ARM, [pose], [None], [(0, 0, 0, 5)])

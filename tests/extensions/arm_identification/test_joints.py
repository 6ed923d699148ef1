"""Joints of poses: in the posture that confdata names, or none without; and each view's own."""

import numpy as np
import pytest

from calibration.kinematics.abb_arms import ARMS, find_arm
from calibration.kinematics.arm import OtherConfiguration
from calibration.kinematics.joint_check import JointsDisagree
from calibration.transforms import Array, transform
from extensions.arm_identification.mathematics.joints import joints_of_poses, require_joints_of_each_view

ARM = find_arm("IRB 2600-20/1.65")
JOINTS = np.random.default_rng(4).uniform(-1.2, 1.2, (10, 6))
POSES = ARM.forward(JOINTS)


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


def swap(*pairs: tuple[int, int]) -> Array:
    rows = np.arange(len(JOINTS))
    for one, other in pairs:
        rows[[one, other]] = rows[[other, one]]
    return JOINTS[rows]


@pytest.mark.parametrize(
    ("joints", "poses", "code", "words"),
    [
        (swap((2, 5)), POSES, "joints-of-another-view", "pictures 13, 16: the joints are those of pictures 16, 13"),
        (swap((2, 5), (0, 1), (7, 9)), POSES, "joints-of-another-view", "pictures 11, 12, 13, 16, 18, 20"),
        (JOINTS + np.outer(np.arange(10) == 4, np.radians([0, 0.02, 0, 0, 0, 0])), POSES, "joints-contradict-poses",
         "picture 15: the joints do not give the pose"),
        (JOINTS + np.radians([0, 0.1, 0, 0, 0, 0]), POSES, "joints-with-shifted-zeros",
         r"axis 2 are shifted by 0\.100°"),
        (np.radians(np.round(np.degrees(JOINTS), 1)), POSES, "joints-rounded", r"rounded to 0\.1°"),
        (JOINTS, POSES @ transform(np.eye(3), np.array([0.6, 0.6, 0.6])), "poses-in-another-frame", "of a tool"),
        (JOINTS + np.radians(0.05) * np.random.default_rng(1).normal(size=(10, 6)), POSES, "joints-contradict-poses",
         "without corrections by the controller"),
        (np.degrees(JOINTS), POSES, "joints-contradict-poses", "no usual mistake"),
    ],
)  # fmt: skip
def test_each_view_of_a_session_holds_its_own_joints(joints: Array, poses: Array, code: str, words: str) -> None:
    with pytest.raises(JointsDisagree, match=words) as raised:
        require_joints_of_each_view(ARM, joints, poses, ARMS, range(10, 20))
    assert raised.value.mistake.code == code


def test_what_controllers_round_passes() -> None:
    rounded = POSES.copy()
    rounded[:, :3, 3] = rounded[:, :3, 3].round(2)
    require_joints_of_each_view(ARM, np.radians(np.degrees(JOINTS).round(3)), rounded, ARMS, range(10))

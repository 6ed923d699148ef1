"""Joints that are not the arm's: each mistake is named, and none is taken for an error of the arm."""

import numpy as np
import pytest

from calibration.kinematics.abb_arms import ARMS, find_arm
from calibration.kinematics.joint_check import JointsDisagree, require_consistent_joints
from calibration.transforms import Array, transform

ARM = find_arm("IRB 2600-20/1.65")
JOINTS = np.random.default_rng(4).uniform(-1.2, 1.2, (10, 6))
POSES = ARM.forward(JOINTS)
TOOL = transform(np.eye(3), np.array([0.0, 20.0, 150.0]))


def shift(*axes: int) -> Array:
    return JOINTS + np.radians([90.0 if axis in axes else 0.0 for axis in range(1, 7)])


@pytest.mark.parametrize(
    ("joints", "poses", "code", "words"),
    [
        (np.radians(JOINTS), POSES, "joints-in-radians", "radians"),
        (JOINTS * [1, -1, 1, 1, 1, 1], POSES, "joints-with-other-signs", "axis 2"),
        (JOINTS * [1, 1, -1, 1, -1, 1], POSES, "joints-with-other-signs", "axes 3, 5"),
        (shift(2), POSES, "joints-with-shifted-zeros", "axis 2 are shifted by 90°"),
        (shift(2, 3), POSES, "joints-with-shifted-zeros", "axes 2, 3"),
        (JOINTS + np.outer(JOINTS[:, 1], np.eye(6)[2]), POSES, "joints-with-other-signs", "horizontal"),
        (JOINTS[:, ::-1], POSES, "joints-in-other-order", "another order"),
        (JOINTS[:, [0, 2, 1, 3, 4, 5]], POSES, "joints-in-other-order", "another order"),
        (JOINTS, find_arm("IRB 4600-45/2.05").forward(JOINTS), "joints-of-another-arm", "IRB 4600"),
        (JOINTS, POSES @ TOOL, "poses-in-another-frame", "of a tool"),
        (JOINTS, TOOL @ POSES, "poses-in-another-frame", "work object"),
        (JOINTS[::-1] + 0.1, POSES, "joints-contradict-poses", "same moment"),
    ],
)
def test_a_mistake_is_named(joints: Array, poses: Array, code: str, words: str) -> None:
    with pytest.raises(JointsDisagree, match=words) as raised:
        require_consistent_joints(ARM, joints, poses, ARMS)
    assert raised.value.mistake.code == code


def test_a_single_view_shows_no_other_frame() -> None:
    with pytest.raises(JointsDisagree) as raised:
        require_consistent_joints(ARM, JOINTS[:1] + np.radians([3, 7, 11, 13, 17, 19]), POSES[:1])
    assert raised.value.mistake.code == "joints-contradict-poses"


def test_joints_of_the_arm_pass_even_with_corrections_of_a_millimetre() -> None:
    require_consistent_joints(ARM, JOINTS, POSES, ARMS)
    require_consistent_joints(ARM, JOINTS, POSES @ transform(np.eye(3), np.array([0.6, 0.6, 0.6])), ARMS)

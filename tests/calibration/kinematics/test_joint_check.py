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


def kuka(joints: Array) -> Array:
    """Axes 1, 4 and 6 the other way, the upright lower arm at -90 degrees, the straight forearm at 90."""
    return joints * [-1, 1, 1, -1, 1, -1] + np.radians([0, -90, 90, 0, 0, 0])


def fanuc(joints: Array) -> Array:
    """Axis 3 from the horizontal, upwards; axes 4 and 6 the other way."""
    found = joints * [1, 1, -1, -1, 1, -1]
    found[:, 2] -= joints[:, 1]
    return found


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
        (kuka(JOINTS), POSES, "joints-of-another-maker", "zeros of axes 2, 3"),
        (fanuc(JOINTS), POSES, "joints-of-another-maker", "axis 3 from the horizontal"),
        (JOINTS + np.radians([0, 0, 0, 180, 0, 0]), POSES, "joints-with-shifted-zeros", "axis 4 are shifted by 180°"),
        (np.roll(JOINTS, 1, axis=0), POSES, "joints-of-another-view", "the one before it"),
        (np.roll(JOINTS, -1, axis=0), POSES, "joints-of-another-view", "the one behind it"),
        (JOINTS[:, [3, 4, 5, 0, 1, 2]], POSES, "joints-in-other-order", "4, 5, 6, 1, 2, 3"),
        (JOINTS, POSES @ TOOL, "poses-in-another-frame", "of a tool"),
        (JOINTS, TOOL @ POSES, "poses-in-another-frame", "work object"),
        (JOINTS[::-1] + 0.1, POSES, "joints-contradict-poses", "same moment"),
    ],
)
def test_a_mistake_is_named(joints: Array, poses: Array, code: str, words: str) -> None:
    with pytest.raises(JointsDisagree, match=words) as raised:
        require_consistent_joints(ARM, joints, poses, ARMS)
    assert raised.value.mistake.code == code


def test_joints_one_view_late_are_named_in_long_sessions() -> None:
    many = np.random.default_rng(5).uniform(-1.2, 1.2, (40, 6))
    with pytest.raises(JointsDisagree, match="the one before it"):
        require_consistent_joints(ARM, np.roll(many, 1, axis=0), ARM.forward(many), ARMS)


def test_a_single_view_shows_no_other_frame() -> None:
    with pytest.raises(JointsDisagree) as raised:
        require_consistent_joints(ARM, JOINTS[:1] + np.radians([3, 7, 11, 13, 17, 19]), POSES[:1])
    assert raised.value.mistake.code == "joints-contradict-poses"


def test_joints_of_the_arm_pass_even_with_corrections_of_a_millimetre() -> None:
    require_consistent_joints(ARM, JOINTS, POSES, ARMS)
    require_consistent_joints(ARM, JOINTS, POSES @ transform(np.eye(3), np.array([0.6, 0.6, 0.6])), ARMS)

"""What the planner calls reachable is what the arm's own inverse kinematics finds."""

import numpy as np

from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import UnreachablePoseError
from calibration.planning.reachability import MIN_SINGULARITY_CLEARANCE, reachable_by

ARM = find_arm("IRB 1600-6/1.45")


def random_joints(count):
    rng = np.random.default_rng(4)
    return rng.uniform(ARM.lower_rad, ARM.upper_rad, (count, 6))


def solutions(pose):
    try:
        return ARM.inverse(pose)
    except UnreachablePoseError:
        return np.empty((0, 6))


def test_it_agrees_with_the_arms_inverse():
    poses = ARM.forward(random_joints(120))
    poses[::3, :3, 3] *= 1.4  # some of them out of reach
    answers = reachable_by(ARM)(poses)
    expected = [np.any(ARM.singularity_clearance(solutions(pose)) >= MIN_SINGULARITY_CLEARANCE) for pose in poses]
    assert answers.tolist() == [bool(answer) for answer in expected]
    assert 10 < answers.sum() < 110


def test_the_posture_is_kept():
    joints = random_joints(120)
    now = np.radians([10.0, 20, 10, 0, 60, 0])
    answers = reachable_by(ARM, now)(ARM.forward(joints))
    cfx = ARM.configuration(now).cfx
    for pose, answer in zip(ARM.forward(joints), answers, strict=True):
        kept = [q for q in solutions(pose) if ARM.configuration(q).cfx == cfx]
        assert bool(answer) == any(ARM.singularity_clearance(q) >= MIN_SINGULARITY_CLEARANCE for q in kept)

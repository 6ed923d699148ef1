"""What the planner calls reachable is what the arm's own inverse kinematics finds."""

import numpy as np

from calibration.arm import PoseRefused
from calibration.arms import IRB_1600_6_145
from calibration.planning.reach import CLEARANCE, reachable_by


def random_joints(count):
    rng = np.random.default_rng(4)
    return rng.uniform(IRB_1600_6_145.lower_rad, IRB_1600_6_145.upper_rad, (count, 6))


def solutions(pose):
    try:
        return IRB_1600_6_145.inverse(pose)
    except PoseRefused:
        return np.empty((0, 6))


def test_it_agrees_with_the_arms_inverse():
    poses = IRB_1600_6_145.forward(random_joints(120))
    poses[::3, :3, 3] *= 1.4  # some of them out of reach
    answers = reachable_by(IRB_1600_6_145)(poses)
    expected = [np.any(IRB_1600_6_145.singularity_clearance(solutions(pose)) >= CLEARANCE) for pose in poses]
    assert answers.tolist() == [bool(answer) for answer in expected]
    assert 10 < answers.sum() < 110


def test_the_posture_is_kept():
    joints = random_joints(120)
    now = np.radians([10.0, 20, 10, 0, 60, 0])
    answers = reachable_by(IRB_1600_6_145, now)(IRB_1600_6_145.forward(joints))
    cfx = IRB_1600_6_145.configuration(now).cfx
    for pose, answer in zip(IRB_1600_6_145.forward(joints), answers, strict=True):
        kept = [q for q in solutions(pose) if IRB_1600_6_145.configuration(q).cfx == cfx]
        assert bool(answer) == any(IRB_1600_6_145.singularity_clearance(q) >= CLEARANCE for q in kept)

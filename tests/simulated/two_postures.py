"""Views with an arm as built whose wrist stands turned over from the middle one on."""

import numpy as np

from calibration.diagnosis.evidence import Evidence
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import Postures
from calibration.transforms import inverse, rotation_from_vector, transform, transform_from_vector
from mock_robot.arm.built_arm import build_arm

VIEWS, CENTRE_MM = 16, np.array([75.0, 52.5, 0.0])
SEEN = np.repeat([2e-5, 0.01], 3)
"""One standard deviation of the target's pose by the images, rad and mm."""


def two_postures(seed: int) -> Evidence:
    """16 views with a standard arm as built; the controller reports the drawing's poses."""
    rng, arm = np.random.default_rng(seed), find_arm("IRB 2600-20/1.65")
    joints = np.array([0.1, 0.2, 0.1, 0.0, 0.9, 0.0]) + rng.uniform(-0.35, 0.35, (VIEWS, 6)) * [1, 1, 1, 1, 1, 3]
    joints[VIEWS // 2 :] = joints[VIEWS // 2 :] * [1, 1, 1, 1, -1, 1] + [0, 0, 0, np.pi, 0, -np.pi]
    X = transform(rotation_from_vector([0.03, -0.02, 1.2]), np.array([60.0, 10.0, 90.0]))
    Y = transform(rotation_from_vector([np.pi, 0.0, 0.0]), np.array([1000.0, 0.0, 0.0]))
    stands = build_arm(arm, "standard", seed).base_T_flange(Postures(joints))
    seen = transform_from_vector(SEEN * rng.standard_normal((VIEWS, 6))) @ inverse(stands @ X) @ Y
    covariance = np.tile(np.diag(SEEN**2), (VIEWS, 1, 1))
    one = np.arange(VIEWS)
    return Evidence("eye-in-hand", one, arm.forward(joints), seen, covariance, np.full(VIEWS, 170.0), joints)

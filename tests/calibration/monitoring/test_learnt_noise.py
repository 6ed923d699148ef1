"""The robot's noise as verifications show it."""

import numpy as np
import pytest

from calibration.kinematics.robot_accuracy import USUAL_BELIEF, NoiseBelief, RobotNoise
from calibration.likelihood.predicted_uncertainty import ExpectedNoise
from calibration.monitoring.cell_change import SeenTarget
from calibration.monitoring.learnt_noise import learn_noise
from calibration.planning.viewpoints import flange_poses
from calibration.transforms import rotation_from_vector, transform, transform_from_vector
from tests.calibration.planning.scenes import seed_scene

SCENE = seed_scene(ExpectedNoise(0.02, 0.0, 0.0))
SURE_OF_X = np.diag(np.repeat([1e-5, 0.01], 3) ** 2)
MOVED = transform(rotation_from_vector([0.0, 0.0, 0.02]), [30.0, -10.0, 5.0])
"""The target before a verification against its place in the calibration."""


def verification(rng: np.random.Generator, noise: RobotNoise, stations: int) -> SeenTarget:
    """Stations from which the target is seen; the arm stands elsewhere than it reports."""
    low, high = (-0.5, -0.5, -1.5, 450.0, -0.1, -0.1), (0.5, 0.5, 1.5, 750.0, 0.1, 0.1)
    stands = flange_poses(SCENE, rng.uniform(low, high, (stations, 6)))
    levels = np.repeat(noise.levels(), 3)
    reported = stands @ transform_from_vector(levels * rng.standard_normal((stations, 6)))
    seen = MOVED @ SCENE.anchor_T_target
    camera_T_target = np.linalg.inv(stands @ SCENE.mount_T_camera) @ seen
    return SeenTarget(np.zeros((stations, 6)), reported, reported @ SCENE.mount_T_camera @ camera_T_target)


@pytest.mark.parametrize("noise", [RobotNoise(0.03, 5e-5), RobotNoise(0.4, 1e-3)], ids=["a good arm", "a worn arm"])
def test_verifications_find_the_noise_of_an_arm_that_is_not_as_usual(noise: RobotNoise) -> None:
    rng, belief = np.random.default_rng(1), USUAL_BELIEF
    for _ in range(8):
        belief = learn_noise(belief, SCENE, SURE_OF_X, verification(rng, noise, 5))
    assert belief.origin == "learnt"
    assert np.all(np.abs(np.log(belief.median.levels() / noise.levels())) < np.log(1.6))
    assert max(belief.factors) < 1.6


def test_two_stations_show_nothing() -> None:
    seen = verification(np.random.default_rng(2), RobotNoise(0.4, 1e-3), 2)
    assert learn_noise(USUAL_BELIEF, SCENE, SURE_OF_X, seen) == NoiseBelief()

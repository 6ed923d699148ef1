"""Views planned for the arm's errors: better than as many at random, and as good as they promise."""

import numpy as np

from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import ArmErrorModel, Postures
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, Scene
from extensions.arm_identification.mathematics.views import MIN_PLACE_VIEWS, ArmExperiment, PointsOfInterest
from tests.simulated.arms import MOUNT_T_CAMERA, box_postures, reachable_views, target_places
from tests.simulated.sessions import BOARD, CAMERA

ARM = find_arm("IRB 2600-20/1.65")


def test_planned_views_show_more_of_the_arm_than_the_first_that_come() -> None:
    rng = np.random.default_rng(3)
    model, targets = ArmErrorModel(ARM), target_places(rng, ARM, 2)
    interest = PointsOfInterest(Postures(box_postures(rng, ARM, 15)), np.tile([0.0, 0.0, 550.0], (15, 1)))
    noise = ExpectedNoise(0.05, float(np.radians(0.002)), 0.02)
    scenes = [Scene("eye-in-hand", BOARD, CAMERA, MOUNT_T_CAMERA, target, noise) for target in targets]
    candidates = [Postures(reachable_views(rng, ARM, target, 15)) for target in targets]
    experiment = ArmExperiment(model, scenes, candidates, interest, model.sigmas)
    views, point_mm = experiment.choose(12)
    places = [place for place, _ in views]
    assert len(set(views)) == 12
    assert min(places.count(0), places.count(1)) >= MIN_PLACE_VIEWS
    assert np.all(np.diff(point_mm) <= 1e-9)
    chosen = [15 * place + row for place, row in views]
    np.testing.assert_allclose(experiment.point_mm(chosen), point_mm[-1], rtol=1e-4)
    assert point_mm[-1] < 0.9 * experiment.point_mm([*range(6), *range(15, 21)])

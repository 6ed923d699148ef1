"""The planner minimises U at the worst of the points that matter."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.likelihood.mapped_points import point_sigmas_mm
from calibration.likelihood.predicted_uncertainty import working_points_mm
from calibration.planning.plan import plan_poses
from calibration.planning.point_criterion import point_matrices, worst_variances
from calibration.problem import Setup
from calibration.solution import NamedPoint
from calibration.transforms import map_points
from tests.calibration.planning.scenes import WIDE, seed_poses, seed_scene


def test_the_criterion_is_the_variance_of_the_worst_point() -> None:
    scene = seed_scene()
    covariance = np.diag([1e-8, 4e-8, 1e-8, 0.01, 0.02, 0.03])
    matrices = point_matrices(scene, 600.0, seed_poses())
    sigmas = point_sigmas_mm(covariance, working_points_mm(scene.camera, 600.0))
    np.testing.assert_allclose(worst_variances(matrices, covariance[None]), [sigmas.max() ** 2])
    assert worst_variances(matrices, np.full((1, 6, 6), np.inf)) == [np.inf]


def test_a_point_of_the_camera_has_its_own_matrix() -> None:
    point = NamedPoint("far", "camera", (0.0, 0.0, 4000.0))
    scene = replace(seed_scene(), points=(point,))
    covariance = np.diag([1e-8, 4e-8, 1e-8, 0.01, 0.02, 0.03])
    expected = point_sigmas_mm(covariance, np.array([point.position_mm])) ** 2
    np.testing.assert_allclose(worst_variances(point_matrices(scene, 600.0, seed_poses()), covariance[None]), expected)


@pytest.mark.slow
@pytest.mark.parametrize("setup", ["eye-in-hand", "eye-to-hand"])
def test_a_plan_for_a_point_is_better_there(setup: Setup) -> None:
    """A point far away needs X's rotation, the working volume its translation as well."""
    scene = replace(seed_scene(), setup=setup)
    far_mm = np.array([[0.0, 0.0, 6000.0]])
    points = {
        "camera": NamedPoint("far", "camera", tuple(far_mm[0])),
        "base": NamedPoint("far", "base", tuple(map_points(scene.mount_T_camera, far_mm)[0])),
    }
    for frame in ("camera",) if setup == "eye-in-hand" else ("camera", "base"):
        aimed = plan_poses(replace(scene, points=(points[frame],)), WIDE, 4).predicted
        anyhow = plan_poses(scene, WIDE, 4).predicted
        there, elsewhere = (point_sigmas_mm(found.covariance, far_mm)[0] for found in (aimed, anyhow))
        assert aimed.worst_point.sigma_mm == pytest.approx(there)
        assert there < 0.97 * elsewhere

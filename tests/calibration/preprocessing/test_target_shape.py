"""What images show of a target's points and lines: which unknowns they add, and the step of many points."""

import numpy as np
import pytest

from calibration.likelihood.nuisances import SHAPES
from calibration.preprocessing.prepare import prepare
from calibration.preprocessing.target_shape import MANY_POINTS, _System
from tests.simulated.described_wrongly import FAULTS, LOW, wrong_session


@pytest.mark.parametrize(
    ("fault", "views", "points", "bends", "tangential"),
    [
        ("none", 3, False, False, False),
        ("none", 8, False, False, False),
        ("stretch with bow", 4, False, False, False),
        ("stretch with bow", 8, True, True, False),
        ("keystone 0.5 %", 3, False, True, False),
        ("keystone 0.5 %", 8, True, True, False),
        ("tangential, rectified", 4, False, False, True),
        ("tangential, rectified", 8, False, False, True),
    ],
)
def test_images_add_unknowns_of_print_and_lens(
    fault: str, views: int, points: bool, bends: bool, tangential: bool
) -> None:
    session = wrong_session(np.random.default_rng(7), views, FAULTS[fault], LOW, "eye-in-hand", "planned")
    prepared = prepare(session.problem)
    assert prepared.shaped is points
    assert (prepared.nuisances.shapes.shape[-1] > SHAPES) is bends
    assert (len(prepared.nuisances.distortion) > 1) is tangential


def a_system(k: int, views: int, intrinsics: int) -> _System:
    """One with k points whose matrix is positive definite."""
    rng = np.random.default_rng(k)
    half = 0.02 * rng.normal(size=(6 * views, 3 * k))
    roots = np.eye(3) + 0.2 * rng.normal(size=(k, 3, 3))
    return _System(
        by_point=roots @ roots.swapaxes(1, 2) + 5 * np.eye(3),
        half=half,
        by_camera=0.05 * rng.normal(size=(3 * k, intrinsics)),
        gradient=rng.normal(size=3 * k),
        variance=0.01,
        redundancy=100.0,
        pose_gradient=np.zeros((views, 6)),
        pose_offsets=np.zeros((views, 6, 3 * k)),
        pose_camera=np.zeros((views, 6, intrinsics)),
        camera_gradient=np.zeros(intrinsics),
        camera_covariance=np.eye(intrinsics),
    )


def test_with_many_points_step_and_variances_are_those_of_the_dense_matrix() -> None:
    weight = np.array([0.3, 0.3, 0.05])
    for intrinsics in (0, 4):
        system = a_system(MANY_POINTS + 20, 5, intrinsics)
        offsets = np.random.default_rng(1).normal(size=(MANY_POINTS + 20, 3))
        matrix = system.information() + np.diag(np.tile(weight, len(offsets)))
        assert np.linalg.eigvalsh(matrix)[0] > 0
        covariance = np.linalg.inv(matrix)
        step, variances = system.step(offsets, weight)
        np.testing.assert_allclose(
            step,
            -covariance @ (system.gradient + np.tile(weight, len(offsets)) * offsets.ravel()),
            rtol=1e-9,
            atol=1e-12,
        )
        np.testing.assert_allclose(variances.ravel(), system.variance * np.diagonal(covariance), rtol=1e-9)

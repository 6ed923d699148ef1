"""Errors of the corners that all views share show in their mean residuals, and widen the uncertainty."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.camera import CameraModel
from calibration.problem import Detection, Problem
from calibration.solve import estimate_session
from calibration.solver.shared_errors import shared_corner_sigma_px, variance_by_shared_corners
from tests.simulated.sessions import CellNoise
from tests.simulated.spoiled_sessions import cell

NOISE = CellNoise(0.1, float(np.radians(0.01)), 0.05)


def biased(problem: Problem, amount_px: float) -> Problem:
    """Every second corner of every view is found as much further to the right and down, the others to the left."""
    views = []
    for view in problem.views:
        assert view.detection is not None
        ids, pixels = view.detection.ids, view.detection.corners_px
        sign = np.where(ids % 2, 1.0, -1.0)[:, None]
        views.append(replace(view, detection=Detection(ids, pixels + amount_px * sign)))
    return replace(problem, views=tuple(views))


@pytest.mark.parametrize(("amount_px", "low_px", "high_px"), [(0.0, 0.0, 0.0), (0.08, 0.04, 0.095)])
def test_a_bias_of_the_corners_is_distinguished_from_their_noise(
    amount_px: float, low_px: float, high_px: float
) -> None:
    estimated = estimate_session(biased(cell(43, 10, NOISE).problem, amount_px))
    prepared, selection = estimated.prepared, estimated.selection
    sigma_px = shared_corner_sigma_px(prepared.take(selection.used), selection.best)
    assert low_px <= sigma_px <= high_px


def test_a_shared_shift_turns_the_line_of_sight_and_a_shared_scale_moves_the_target_along_it() -> None:
    camera = CameraModel(np.array([[2000.0, 0, 500], [0, 2000.0, 400], [0, 0, 1]]), np.zeros(5), (1000, 800))
    sigma = np.sqrt(np.diagonal(variance_by_shared_corners(0.1, camera, 600.0)))
    assert sigma == pytest.approx([5e-5, 5e-5, 2e-4, 0.0, 0.0, 0.12])

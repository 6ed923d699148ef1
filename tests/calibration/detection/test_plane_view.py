"""A plane through a lens, from its points alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.detection.plane_view import fit_plane_view
from calibration.errors import DetectionError
from calibration.targets import Chessboard
from calibration.transforms import map_points, rotation_from_vector, transform
from tests.calibration.detection.sights import CAMERA

POINTS = Chessboard(9, 6, 20.0).points_mm


@settings(deadline=None)
@given(
    st.tuples(*[st.floats(-0.7, 0.7)] * 2, st.floats(-3.1, 3.1)),
    st.tuples(st.floats(-150, 50), st.floats(-120, 40), st.floats(400, 1500)),
)
def test_it_predicts_the_points_it_was_not_shown(rotation, translation):
    pixels = CAMERA.project(map_points(transform(rotation_from_vector(rotation), translation), POINTS))
    if not np.all((pixels > 0) & (pixels < CAMERA.image_size)):
        return
    shown = np.arange(len(POINTS)) % 5 != 0
    view, residual = fit_plane_view(POINTS[shown, :2], pixels[shown], CAMERA.image_size)
    assert np.abs(residual).max() < 0.5
    assert np.abs(view.map(POINTS[:, :2]) - pixels).max() < 0.6


def test_points_of_no_plane_are_refused():
    with pytest.raises(DetectionError):
        fit_plane_view(np.zeros((6, 2)), np.full((6, 2), np.nan), CAMERA.image_size)

"""The map of a scan's deviations, from surfaces whose deviations are known."""

import base64

import cv2
import numpy as np
import pytest

from daemon.reports.pictures import deviation_map
from registration.fusion.view_surface import SURFACE


def surface(deviations: list[float]) -> bytes:
    """A row of points along x, thin along z."""
    found = np.zeros(len(deviations), SURFACE)
    found["x"], found["y"] = np.arange(len(deviations)) * 10.0, np.arange(len(deviations)) % 2 * 50.0
    found["deviation"] = deviations
    return found.tobytes()


@pytest.mark.slow
def test_points_are_counted_by_their_deviation_and_coloured_to_the_end_of_the_scale() -> None:
    found = deviation_map([surface([-0.4, 0.0]), surface([0.0, 0.4, np.nan])], SURFACE)
    assert found is not None
    assert found.end_mm == pytest.approx(0.5)
    assert found.rms_mm == pytest.approx(0.4 / np.sqrt(2))
    assert found.alone == pytest.approx(0.2)
    by_middle = dict(zip(np.round(found.middles_mm, 3).tolist(), found.shares, strict=True))
    assert (by_middle[0.0], sum(found.shares)) == (0.5, pytest.approx(1.0))
    assert (by_middle[-0.444], by_middle[0.444]) == (0.25, 0.25)
    content = base64.b64decode(found.picture.data_uri.partition(",")[2])
    drawn = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    assert drawn is not None
    assert drawn.shape[:2] == (found.picture.height, found.picture.width)
    seen = {tuple(colour) for colour in drawn.reshape(-1, 3).tolist()}
    assert any(blue > red + 50 for blue, _, red in seen)
    assert any(red > blue + 50 for blue, _, red in seen)
    assert (150, 150, 150) in seen


@pytest.mark.parametrize("surfaces", [[], [surface([np.nan, np.nan])]])
def test_without_an_overlap_there_is_no_map(surfaces: list[bytes]) -> None:
    assert deviation_map(surfaces, SURFACE) is None

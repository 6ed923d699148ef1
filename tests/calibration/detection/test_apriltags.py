"""AprilTag grids, whole or in part."""

import numpy as np
import pytest

from calibration.detection.detect import detect
from calibration.errors import DetectionError
from calibration.targets import AprilTagGrid
from tests.calibration.detection.sights import errors_px, pictures, rms
from tests.simulated.views import BLURRED, ORDINARY

GRID = AprilTagGrid(4, 3, 30.0, 9.0)


@pytest.mark.parametrize(("optics", "bar_px"), [(ORDINARY, 0.03), (BLURRED, 0.05)])
def test_every_corner_is_found_where_it_is(optics, bar_px):
    errors = []
    for picture in pictures(GRID, 4, optics):
        found = detect(picture.image, GRID)
        assert len(found.ids) == 48
        errors.append(errors_px(found, picture))
    assert rms(errors) < bar_px
    assert np.abs(np.concatenate(errors).mean(axis=0)).max() < bar_px / 4, "no bias"


@pytest.mark.parametrize("family", ["tag16h5", "tag25h9", "tag36h10"])
def test_other_families(family):
    grid = AprilTagGrid(3, 2, 30.0, 12.0, family)
    for picture in pictures(grid, 2):
        assert rms([errors_px(detect(picture.image, grid), picture)]) < 0.03


def test_a_few_tags_in_view_are_enough():
    picture = pictures(GRID, 1)[0]
    middle = int(picture.pixels[:, 0].mean())
    found = detect(np.ascontiguousarray(picture.image[:, :middle]), GRID)
    assert 8 <= len(found.ids) < 48
    assert len(found.ids) % 4 == 0
    assert rms([errors_px(found, picture)]) < 0.04


def test_tags_that_lie_elsewhere_than_on_the_grid_are_refused():
    picture = pictures(AprilTagGrid(4, 3, 30.0, 9.0), 1)[0]
    with pytest.raises(DetectionError) as refusal:
        detect(picture.image, AprilTagGrid(3, 4, 30.0, 9.0))
    assert refusal.value.code == "not-planar"


def test_an_unknown_family_is_named():
    with pytest.raises(DetectionError, match="tag99h9") as refusal:
        detect(pictures(GRID, 1)[0].image, AprilTagGrid(4, 3, 30.0, 9.0, "tag99h9"))
    assert refusal.value.code == "unknown-dictionary"

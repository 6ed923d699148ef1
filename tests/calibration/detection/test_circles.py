"""Circle grids of every kind, and the bias that a circle's image has."""

import numpy as np
import pytest

from calibration.detection.circles import circle_centre_bias
from calibration.detection.detect import detect
from calibration.errors import DetectionError
from calibration.targets import CircleGrid
from calibration.transforms import map_points, rotation_from_vector, transform
from mock_robot.scene.printed_target import PrintOptions
from tests.calibration.detection.sights import CAMERA, errors_px, half_turned, pictures, rms
from tests.simulated.views import BLURRED, ORDINARY

ASYMMETRIC = CircleGrid("asymmetric", 4, 11, 40.0)
LARGE_DOT = CircleGrid("symmetric", 10, 10, 25.4, "black", "large-dot")
PLAIN = CircleGrid("symmetric", 9, 7, 20.0)
UNAMBIGUOUS = {
    "asymmetric, odd rows": ASYMMETRIC,
    "large dot": LARGE_DOT,
    "large dot, oblong": CircleGrid("symmetric", 7, 5, 20.0, "black", "large-dot"),
    "large white dot": CircleGrid("symmetric", 7, 5, 20.0, "white", "large-dot"),
}


@pytest.mark.parametrize("optics", [ORDINARY, BLURRED])
@pytest.mark.parametrize("grid", UNAMBIGUOUS.values(), ids=UNAMBIGUOUS)
def test_every_centre_is_found_where_it_is(grid, optics):
    errors = []
    for picture in pictures(grid, 3, optics):
        found = detect(picture.image, grid)
        assert len(found.ids) == len(grid.points_mm)
        errors.append(errors_px(found, picture))
    assert rms(errors) < 0.03
    assert np.abs(np.concatenate(errors)).max() < 0.15


@pytest.mark.parametrize(
    "grid", [PLAIN, CircleGrid("symmetric", 9, 7, 20.0, "white"), CircleGrid("asymmetric", 4, 10, 40.0)]
)
def test_a_grid_without_a_mark_is_read_with_its_rows_to_the_right(grid):
    for picture in pictures(grid, 3):
        found = detect(picture.image, grid)
        readings = (found, half_turned(found, len(grid.points_mm)))
        assert min(np.abs(errors_px(reading, picture)).max() for reading in readings) < 0.1
        first, last = (found.corners_px[found.ids == i][0] for i in (0, grid.columns - 1))
        assert last[0] > first[0]


def test_large_dots_seen_steeply_show_no_bias():
    grid = CircleGrid("symmetric", 5, 4, 40.0, "black", "large-dot")
    errors = []
    for picture in pictures(
        grid, 3, tilt_deg=60.0, fill=0.9, sheet=PrintOptions(dot_ratio=0.7, large_dot_ratio=1.0), seed=3
    ):
        found = detect(picture.image, grid)
        radius = 0.7 * 40.0 / 2

        def project(points, picture=picture):
            board = np.column_stack([points, np.zeros(len(points))])
            return CAMERA.project(map_points(picture.camera_T_target, board))

        bias = circle_centre_bias(project, grid.points_mm[found.ids, :2], np.full(len(found.ids), radius))
        assert np.hypot(*bias.T).max() > 0.2, "the case is worth correcting"
        errors.append(errors_px(found, picture))
    assert rms(errors) < 0.03


def test_the_bias_is_that_of_a_circle_cut_into_many_small_pieces():
    camera_T_target = transform(rotation_from_vector([0.8, 0.3, 0.1]), [-30.0, 20.0, 400.0])

    def project(points):
        return CAMERA.project(map_points(camera_T_target, np.column_stack([points, np.zeros(len(points))])))

    centre, radius = np.array([[35.0, -20.0]]), 25.0
    r, angle = np.meshgrid((np.arange(200) + 0.5) / 200 * radius, np.arange(360) * np.pi / 180)
    inside = centre + np.column_stack([(r * np.cos(angle)).ravel(), (r * np.sin(angle)).ravel()])
    u, v = 1e-3 * np.eye(2)
    du = (project(inside + u) - project(inside - u)) / 2e-3
    dv = (project(inside + v) - project(inside - v)) / 2e-3
    weight = np.abs(du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0]) * r.ravel()
    centroid = (project(inside) * weight[:, None]).sum(axis=0) / weight.sum()
    expected = centroid - project(centre)[0]
    bias = circle_centre_bias(project, centre, np.array([radius]))[0]
    assert np.hypot(*expected) > 1.0
    assert np.allclose(bias, expected, rtol=0.01)


def test_a_grid_whose_large_dot_is_cut_off_by_the_image_still_has_its_origin():
    picture = pictures(LARGE_DOT, 1, tilt_deg=5.0)[0]
    grid = picture.pixels.reshape(10, 10, 2)
    corner = grid[0, 0]
    outward = corner - grid[3, 3]
    axis = int(np.argmax(np.abs(outward)))
    image = picture.image
    cut = int(corner[axis] + 3 * np.sign(outward[axis]))
    kept = slice(0, cut) if outward[axis] > 0 else slice(cut, None)
    shift = np.zeros(2)
    shift[axis] = 0 if outward[axis] > 0 else cut
    image = image[:, kept] if axis == 0 else image[kept]
    found = detect(np.ascontiguousarray(image), LARGE_DOT)
    assert 0 not in found.ids
    assert len(found.ids) >= 85
    assert rms([errors_px(found, picture) + shift]) < 0.03


@pytest.mark.parametrize(
    ("printed", "configured", "code"),
    [
        (PLAIN, CircleGrid("symmetric", 8, 7, 20.0), "other-board"),
        (PLAIN, CircleGrid("symmetric", 10, 7, 20.0), "not-found"),
        (PLAIN, CircleGrid("symmetric", 9, 7, 20.0, "white"), "not-found"),
        (PLAIN, CircleGrid("symmetric", 9, 7, 20.0, "black", "large-dot"), "origin-not-found"),
        (ASYMMETRIC, CircleGrid("asymmetric", 4, 9, 40.0), "other-board"),
    ],
)
def test_another_grid_than_configured_is_refused(printed, configured, code):
    for picture in pictures(printed, 2):
        with pytest.raises(DetectionError) as refusal:
            detect(picture.image, configured)
        assert refusal.value.code == code


def test_a_grid_with_a_line_hidden_is_refused_rather_than_counted_from_the_wrong_line():
    picture = pictures(PLAIN, 1, tilt_deg=10.0)[0]
    image = picture.image.copy()
    for u, v in picture.pixels.reshape(7, 9, 2)[:, 0].astype(int):
        image[v - 25 : v + 26, u - 25 : u + 26] = 190
    with pytest.raises(DetectionError):
        detect(image, PLAIN)

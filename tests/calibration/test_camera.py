"""Every lens model as OpenCV has it, its derivatives and its inverse."""

import cv2
import numpy as np
import pytest

from calibration.camera import CameraModel, LensModel, lens_of
from calibration.observations.reprojection import with_intrinsics

MATRIX = np.array([[1400.0, 0.0, 955.5], [0.0, 1390.0, 610.0], [0.0, 0.0, 1.0]])
SIZE = (1920, 1200)
LENSES: dict[str, tuple[LensModel, list[float]]] = {
    "4": ("pinhole", [-0.21, 0.09, 1e-3, -7e-4]),
    "5": ("pinhole", [-0.21, 0.09, 1e-3, -7e-4, -0.02]),
    "8": ("pinhole", [0.4, 0.06, 8e-4, -3e-4, 0.004, 0.7, 0.2, 0.02]),
    "12": ("pinhole", [0.4, 0.06, 8e-4, -3e-4, 0.004, 0.7, 0.2, 0.02, 1e-3, -5e-4, -8e-4, 3e-4]),
    "14": ("pinhole", [0.4, 0.06, 8e-4, -3e-4, 0.004, 0.7, 0.2, 0.02, 1e-3, -5e-4, -8e-4, 3e-4, 0.03, -0.02]),
    "fisheye": ("fisheye", [0.05, -0.02, 0.006, -0.001]),
}

lenses = pytest.mark.parametrize(("model", "coefficients"), LENSES.values(), ids=LENSES)


def points(count: int = 200) -> np.ndarray:  # type: ignore[type-arg]
    """In front of the camera, some on its axis."""
    rng = np.random.default_rng(2)
    somewhere = np.column_stack([rng.uniform(-500, 500, (count, 2)), rng.uniform(900, 1500, count)])
    return np.vstack([somewhere, [[0.0, 0.0, 1000.0], [1e-3, 0.0, 1000.0]]])


def camera_of(model: LensModel, coefficients: list[float]) -> CameraModel:
    return CameraModel(MATRIX, np.array(coefficients), SIZE, model)


@lenses
def test_pixels_are_those_of_opencv(model: LensModel, coefficients: list[float]) -> None:
    there = points()
    still, given = np.zeros(3), np.array(coefficients)
    if model == "fisheye":
        expected, _ = cv2.fisheye.projectPoints(there[:, None], still, still, MATRIX, given)
    else:
        expected, _ = cv2.projectPoints(there, still, still, MATRIX, given)

    assert np.abs(camera_of(model, coefficients).project(there) - expected[:, 0]).max() < 1e-8


@lenses
def test_rays_of_pixels_are_the_inverse(model: LensModel, coefficients: list[float]) -> None:
    camera, there = camera_of(model, coefficients), points()

    assert np.abs(camera.normalise(camera.project(there)) - there[:, :2] / there[:, 2:]).max() < 1e-9


@lenses
def test_slopes_are_the_derivatives(model: LensModel, coefficients: list[float]) -> None:
    lens, (x, y), step = lens_of(model, np.array(coefficients)), (points()[:, :2] / points()[:, 2:]).T, 1e-6

    xx, xy, yx, yy = lens.slopes(x, y)
    by_x = np.subtract(lens.distort(x + step, y), lens.distort(x - step, y)) / (2 * step)
    by_y = np.subtract(lens.distort(x, y + step), lens.distort(x, y - step)) / (2 * step)

    assert np.abs(by_x - [xx, yx]).max() < 1e-8
    assert np.abs(by_y - [xy, yy]).max() < 1e-8


@lenses
def test_derivatives_by_the_coefficients(model: LensModel, coefficients: list[float]) -> None:
    (x, y), step = (points()[:, :2] / points()[:, 2:]).T, 1e-6
    for index in range(min(len(coefficients), 8)):
        change = np.zeros(len(coefficients))
        change[index] = step
        one, other = (lens_of(model, np.array(coefficients) + sign * change) for sign in (1, -1))
        expected = np.subtract(one.distort(x, y), other.distort(x, y)) / (2 * step)

        assert np.abs(lens_of(model, np.array(coefficients)).by_coefficient(index, x, y) - expected).max() < 1e-8


def test_a_camera_keeps_its_lens_when_its_intrinsics_change() -> None:
    camera = camera_of(*LENSES["fisheye"])

    moved = with_intrinsics(camera, np.arange(1.0, 10.0))

    assert moved.lens_model == "fisheye"
    assert np.allclose(moved.distortion - camera.distortion, [5, 6, 7, 8])


@pytest.mark.parametrize(("model", "count"), [("pinhole", 3), ("pinhole", 6), ("fisheye", 5)])
def test_other_numbers_of_coefficients_are_refused(model: LensModel, count: int) -> None:
    with pytest.raises(ValueError, match=f"not {count}"):
        lens_of(model, np.zeros(count))

"""What the sensor adds has the size it is said to have."""

from dataclasses import replace

import numpy as np
import pytest

from mock_robot.scene.optics import CLEAN, Optics, clutter, expose, optical_levels

GREY = np.full((400, 500), 0.5, np.float32)


def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def test_a_clean_picture_holds_the_levels_of_black_and_white() -> None:
    scene = np.array([[0.0, 0.5, 1.0]], np.float32)
    assert expose(scene, replace(CLEAN, black=20.0, white=220.0), rng()).tolist() == [[20, 120, 220]]


@pytest.mark.parametrize(("read", "electrons"), [(3.0, 0.0), (0.0, 10.0), (4.0, 5.0)])
def test_noise_has_its_standard_deviation(read: float, electrons: float) -> None:
    optics = replace(CLEAN, black=0.0, white=200.0, read_noise=read, electrons_per_level=electrons)
    picture = expose(GREY, optics, rng()).astype(float)
    shot = 100.0 / electrons if electrons else 0.0
    assert picture.std() == pytest.approx(np.sqrt(read**2 + shot + 1 / 12), rel=0.01)
    assert picture.mean() == pytest.approx(100.0, abs=0.05)


def test_too_long_an_exposure_saturates_and_does_not_wrap() -> None:
    picture = expose(np.ones((20, 20), np.float32), replace(Optics(), exposure=5.0), rng())
    assert picture.min() == 255


def test_vignetting_darkens_the_corners_by_its_share() -> None:
    levels = optical_levels(np.ones((401, 601), np.float32), replace(CLEAN, black=0.0, white=100.0, vignetting=0.3))
    assert levels[200, 300] == pytest.approx(100.0, abs=0.01)
    assert levels[0, 0] == pytest.approx(70.0, abs=0.2)


def test_uneven_light_goes_from_one_side_to_the_other() -> None:
    optics = replace(CLEAN, black=0.0, white=100.0, uneven_light=0.2, light_direction_rad=0.0)
    levels = optical_levels(np.ones((3, 1001), np.float32), optics)
    assert levels[1, -1] / levels[1, 0] == pytest.approx(1.1 / 0.9, rel=1e-3)


def test_blur_spreads_an_edge_by_its_sigma() -> None:
    scene = np.zeros((40, 80), np.float32)
    scene[:, 40:] = 1.0
    levels = optical_levels(scene, replace(CLEAN, black=0.0, white=1.0, blur_px=2.0))
    spread = np.diff(levels[20].astype(float))
    x = np.arange(79) + 0.5
    centre = np.sum(spread * x)
    assert centre == pytest.approx(39.5, abs=1e-3)
    assert np.sqrt(np.sum(spread * (x - centre) ** 2)) == pytest.approx(2.0, rel=0.01)


def test_clutter_is_reflectance_and_flat_without_contrast() -> None:
    busy, flat = clutter((300, 400), 1.0, rng()), clutter((300, 400), 0.0, rng())
    assert 0.0 <= busy.min() < busy.max() <= 1.0
    assert busy.std() > 0.05
    assert np.all(flat == flat[0, 0])

"""Grey levels of 10, 12, 14 and 16 bits as 8 bits."""

import cv2
import numpy as np
import pytest

from drivers.cameras.decoding import decode
from drivers.cameras.pixel_depth import DEPTHS, content_white, to_8_bit


@pytest.mark.parametrize(
    ("brightest", "white"),
    [(0, 255), (255, 255), (256, 1023), (1023, 1023), (1500, 4095), (9000, 16383), (65535, 65535)],
)
def test_the_depth_is_the_least_that_holds_the_content(brightest: int, white: int) -> None:
    assert content_white(np.array([[0, brightest]], np.uint16)) == white


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
def test_all_bits_in_use_are_scaled_to_eight(bits: int) -> None:
    ramp = np.linspace(0, 2**bits - 1, 256).round().astype(np.uint16)[None]

    assert np.array_equal(to_8_bit(ramp)[0], np.arange(256))


def test_what_is_brighter_than_white_is_white() -> None:
    assert to_8_bit(np.array([[0, 50, 100, 60000]], np.uint16), white=100).tolist() == [[0, 128, 255, 255]]


def test_eight_bits_stay_as_they_are() -> None:
    grey = np.array([[0, 7]], np.uint8)
    assert to_8_bit(grey) is grey


@pytest.mark.parametrize("channels", [1, 3])
def test_a_cameras_frame_of_twelve_bits_keeps_its_grey_levels(channels: int) -> None:
    grey = np.tile(np.linspace(0, 4095, 256).round().astype(np.uint16), (40, 1))
    frame = np.repeat(grey[..., None], channels, axis=2)

    image = decode("c", cv2.imencode(".png", frame)[1].tobytes())

    assert len(np.unique(image)) == 256


@pytest.mark.parametrize("white", [(1 << bits) - 1 for bits in DEPTHS[1:]])
def test_each_grey_level_becomes_the_nearest_of_8_bits(white: int) -> None:
    levels = np.arange(2**16, dtype=np.uint16).reshape(256, 256)
    nearest = (levels.astype(np.uint32) * 255 + white // 2) // white
    assert np.array_equal(to_8_bit(levels, white), np.minimum(nearest, 255))
    colours = np.repeat(levels[:, :, None], 3, axis=2)
    assert np.array_equal(to_8_bit(colours, white)[:, :, 1], to_8_bit(levels, white))

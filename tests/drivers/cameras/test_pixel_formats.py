"""Pixel formats of industrial cameras: codes, packings, Bayer orders, and buffers that are too short."""

import numpy as np
import pytest

from drivers.cameras.genicam.pixel_formats import FORMATS, find_format, read_pixels
from drivers.errors import GarbledAnswer, IncompletePicture
from tests.support.vendor_cameras import viky

BY_NAME = {pixels.name: pixels for pixels in FORMATS.values()}
LEVELS = np.random.default_rng(3)


def packed(samples, pixels):
    """Bytes of samples as a camera packs them, written from the standard's pictures, bit by bit."""
    if pixels.packing == "bytes":
        return samples.astype("<u2" if pixels.bits > 8 else np.uint8).reshape(-1).view(np.uint8)
    flat = samples.reshape(-1)
    if pixels.packing == "lsb":
        bits = (flat[:, None] >> np.arange(pixels.bits)) & 1
        return np.packbits(bits.reshape(-1).astype(np.uint8), bitorder="little")
    low, content = pixels.bits - 8, []
    for first, second in zip(flat[::2], [*flat[1::2], 0], strict=False):
        content += [first >> low, (first & (2**low - 1)) | (second & (2**low - 1)) << 4, second >> low]
    return np.array(content, np.uint8)


@pytest.mark.parametrize("width", [8, 7, 6])
@pytest.mark.parametrize("name", [name for name, pixels in BY_NAME.items() if pixels.convert is None])
def test_every_bit_of_every_pixel_is_kept(name, width):
    pixels = BY_NAME[name]
    shape = (5, width) if pixels.channels == 1 else (5, width, pixels.channels)
    samples = LEVELS.integers(0, pixels.white + 1, shape)

    image = read_pixels("c", pixels, packed(samples, pixels), width, 5)

    assert image.dtype == (np.uint8 if pixels.bits == 8 else np.uint16)
    np.testing.assert_array_equal(image, samples)


@pytest.mark.parametrize("name", ["Mono8", "Mono12", "Mono12p", "Mono10p"])
def test_padding_at_the_ends_of_rows_is_left_out(name):
    pixels = BY_NAME[name]
    samples = LEVELS.integers(0, pixels.white + 1, (3, 5))
    rows = [np.append(packed(row, pixels), np.full(3, 255, np.uint8)) for row in samples]
    np.testing.assert_array_equal(read_pixels("c", pixels, np.concatenate(rows), 5, 3, padding=3), samples)


@pytest.mark.parametrize("name", [name for name in BY_NAME if name.startswith("Bayer")])
def test_a_red_part_is_red_in_every_bayer_order(name):
    pixels = BY_NAME[name]
    order = {"GR": "GRBG", "RG": "RGGB", "GB": "GBRG", "BG": "BGGR"}[name[5:7]]
    cell = np.array([pixels.white if letter == "R" else 0 for letter in order]).reshape(2, 2)
    image = read_pixels("c", pixels, packed(np.tile(cell, (8, 8)), pixels), 16, 16)
    assert image.shape == (16, 16, 3)
    assert image[8, 8].tolist() == [0, 0, pixels.white]


@pytest.mark.parametrize("name", ["RGB8", "RGBa8", "RGB10", "RGB16", "BGR8", "BGRa8", "BGR16"])
def test_colours_are_in_opencvs_order(name):
    pixels = BY_NAME[name]
    colour = {"R": 30, "G": 20, "B": 10, "a": 255}
    samples = np.tile([colour[letter] for letter in name if letter in colour], (4, 4, 1))
    assert read_pixels("c", pixels, packed(samples, pixels), 4, 4)[2, 2].tolist() == [10, 20, 30]


@pytest.mark.parametrize("name", ["Mono8", "Mono12", "Mono12Packed", "Mono10p"])
def test_a_buffer_that_is_too_short_is_incomplete(name):
    pixels = BY_NAME[name]
    whole = packed(np.zeros((4, 8), int), pixels)
    with pytest.raises(IncompletePicture, match=f"{whole.size - 1} bytes of a picture came, {whole.size} make"):
        read_pixels("c", pixels, whole[:-1], 8, 4)


def test_what_no_picture_can_be_is_refused():
    with pytest.raises(GarbledAnswer, match="unknown format 0x81010203"):
        find_format("c", 0x81010203 - 2**32)
    with pytest.raises(GarbledAnswer, match="0×5 pixels"):
        read_pixels("c", BY_NAME["Mono8"], np.zeros(9, np.uint8), 0, 5)


def test_the_codes_are_those_of_the_standard():
    viky()
    from harvesters.util import pfnc

    known = {pixels.name: pfnc.dict_by_ints.get(pixels.code) for pixels in FORMATS.values()}
    assert known.pop("Mono14p") in (None, "Mono14p")  # younger than harvesters' list
    assert known == {name: name for name in known}

"""Pictures that are whole, and everything that is none."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.cameras.decoding import decode
from drivers.errors import GarbledAnswer
from tests.drivers.pictures import COLOUR, GREY, JPEG, PNG, encoded


@pytest.mark.parametrize("image", [COLOUR, GREY], ids=["colour", "grey"])
def test_a_png_keeps_every_pixel_and_its_channels(image):
    np.testing.assert_array_equal(decode("c", encoded(".png", image), (40, 30)), image)


def test_a_jpeg_keeps_its_size():
    assert decode("c", JPEG, (40, 30)).shape == (30, 40, 3)
    assert decode("c", encoded(".jpg", GREY)).shape == (30, 40)


def test_sixteen_bits_become_eight():
    image = decode("c", encoded(".png", GREY.astype(np.uint16) * 257))
    assert image.dtype == np.uint8
    np.testing.assert_array_equal(image, GREY)


def test_an_alpha_channel_goes():
    assert decode("c", encoded(".png", np.dstack([COLOUR, GREY]))).shape == (30, 40, 3)


def huge_png():
    """A PNG whose header claims 60000 by 60000 pixels."""
    import struct
    import zlib

    head = b"IHDR" + struct.pack(">IIBBBBB", 60000, 60000, 8, 2, 0, 0, 0)
    end = b"IEND"
    chunk = lambda body: struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))  # noqa: E731
    return b"\x89PNG\r\n\x1a\n" + chunk(head) + chunk(end)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "empty"),
        (b"\x89PN", "ends early"),
        (PNG[:-1], "ends early"),
        (PNG[: len(PNG) // 2], "ends early"),
        (PNG[:100] + bytes([PNG[100] ^ 1]) + PNG[101:], "checksum does not hold"),
        (JPEG[: len(JPEG) // 2], "ends early"),
        (JPEG[:2] + b"\xff\xe0\xff\xff" + JPEG[-30:], "not a whole picture"),
        (b"<html>404</html>", "neither PNG nor JPEG"),
        (b"GIF89a" + b"\0" * 20, "neither PNG nor JPEG"),
        (huge_png(), "60000×60000"),
    ],
    ids=[
        "empty",
        "torn magic",
        "one byte short",
        "half a png",
        "flipped bit",
        "half a jpeg",
        "torn",
        "html",
        "gif",
        "huge",
    ],
)
def test_what_is_no_picture_is_reported(content, reason, capfd):
    with pytest.raises(GarbledAnswer, match=reason):
        decode("c", content)
    assert capfd.readouterr().err == ""


def test_another_size_is_reported():
    with pytest.raises(GarbledAnswer, match="40×30, expected 41×30"):
        decode("c", PNG, (41, 30))


@settings(max_examples=60)
@given(st.integers(0, len(PNG) - 1), st.integers(1, 255))
def test_a_png_with_any_byte_changed_never_passes_as_another_picture(at, change):
    torn = PNG[:at] + bytes([PNG[at] ^ change]) + PNG[at + 1 :]
    try:
        image = decode("c", torn)
    except GarbledAnswer:
        return
    np.testing.assert_array_equal(image, COLOUR)


@settings(max_examples=60)
@given(st.binary(max_size=200), st.sampled_from([b"", PNG[:40], JPEG[:40], JPEG[:400]]))
def test_no_bytes_raise_anything_else(tail, head):
    with pytest.raises(GarbledAnswer):
        decode("c", head + tail)

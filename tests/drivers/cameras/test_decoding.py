"""Pictures that are whole, and everything that is none."""

import struct
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daemon.sessions.session_files import read_grey
from drivers.cameras.decoding import decode, is_truncated, without_orientation
from drivers.errors import GarbledAnswer
from tests.drivers.pictures import COLOUR, GREY, JPEG, PNG, encoded


@pytest.mark.parametrize("image", [COLOUR, GREY], ids=["colour", "grey"])
def test_a_png_keeps_every_pixel_and_its_channels(image):
    np.testing.assert_array_equal(decode("c", encoded(".png", image), (40, 30)), image)


def test_a_jpeg_keeps_its_size():
    assert decode("c", JPEG, (40, 30)).shape == (30, 40, 3)
    assert decode("c", encoded(".jpg", GREY)).shape == (30, 40)


@pytest.mark.parametrize(
    "behind",
    [bytes(4096), b"\0\0\0\x18ftypmp42" + b"\xff\xda" * 200, JPEG],
    ids=["padding", "a telephone's film", "a second picture"],
)
def test_what_follows_a_whole_jpeg_does_not_count(behind):
    np.testing.assert_array_equal(decode("c", JPEG + behind, (40, 30)), decode("c", JPEG))
    assert not is_truncated(JPEG + behind)


def test_an_end_marker_within_a_remark_hides_neither_scans_nor_a_missing_end():
    sizes = JPEG.index(b"\xff\xda")
    with_remark = JPEG[:sizes] + b"\xff\xfe\0\x04\xff\xd9" + JPEG[sizes:]
    assert not is_truncated(with_remark)
    assert is_truncated(with_remark[:-2])
    with pytest.raises(GarbledAnswer, match="more than 100 scans"):
        decode("c", with_remark[:-2] + 101 * JPEG[sizes:-2] + JPEG[-2:])


def test_a_small_whole_picture_inside_half_a_jpeg_does_not_make_it_whole():
    small = b"\xff\xe1" + struct.pack(">H", len(JPEG) + 2) + JPEG
    assert not is_truncated(JPEG[:2] + small + JPEG[2:])
    assert is_truncated(JPEG[:2] + small + JPEG[2:-2])


def test_sixteen_bits_become_eight():
    image = decode("c", encoded(".png", GREY.astype(np.uint16) * 257))
    assert image.dtype == np.uint8
    np.testing.assert_array_equal(image, GREY)


def test_an_alpha_channel_goes():
    assert decode("c", encoded(".png", np.dstack([COLOUR, GREY]))).shape == (30, 40, 3)


def chunk(kind, body):
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def header(width, height, colour_type=2):
    return chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, colour_type, 0, 0, 0))


MAGIC, END = PNG[:8], chunk(b"IEND", b"")
PIXELS = PNG[33:-12]
"""The parts of PNG between its IHDR and IEND."""


def grey_png(width, height):
    rows = zlib.compress(bytes(height * (width + 1)), 1)
    return MAGIC + header(width, height, 0) + chunk(b"IDAT", rows) + END


SOF = next(at for at in range(2, len(JPEG)) if JPEG[at : at + 2] == b"\xff\xc0")
TRUE_SIZE = JPEG[SOF : SOF + 2 + int.from_bytes(JPEG[SOF + 2 : SOF + 4])]


def jpeg_of(width, height):
    return JPEG.replace(TRUE_SIZE, TRUE_SIZE[:5] + struct.pack(">HH", height, width) + TRUE_SIZE[9:])


BOMBS = {
    "huge PNG": (MAGIC + header(60000, 60000) + END, "60000×60000"),
    "PNG of no pixels": (MAGIC + header(0, 5) + END, "0×5"),
    "two sizes, the small one last": (MAGIC + header(28000, 28000) + PIXELS + header(40, 30) + END, "one IHDR"),
    "two sizes, the small one first": (MAGIC + header(40, 30) + header(28000, 28000) + PIXELS + END, "one IHDR"),
    "the size after something else": (MAGIC + chunk(b"tEXt", b"a\0b") + header(40, 30) + PIXELS + END, "one IHDR"),
    "a size of 14 bytes": (MAGIC + chunk(b"IHDR", PNG[16:29] + b"\0") + PIXELS + END, "one IHDR"),
    "no size": (MAGIC + PIXELS + END, "one IHDR"),
    "animated": (PNG[:33] + chunk(b"acTL", bytes(8)) + PIXELS + END, "animated"),
    "huge JPEG": (jpeg_of(65000, 65000), "65000×65000"),
    "JPEG with a restart before its size": (JPEG[:2] + b"\xff\xd0" + JPEG[2:], "segments are torn"),
    "JPEG with a segment of no length": (JPEG[:2] + b"\xff\xe1\0\0" + JPEG[2:], "segments are torn"),
    "JPEG of a thousand scans": (JPEG[:-2] + b"\xff\xda\0\x02" * 1000 + JPEG[-2:], "more than 100 scans"),
}


@pytest.mark.parametrize(("content", "reason"), BOMBS.values(), ids=BOMBS.keys())
def test_a_picture_is_refused_by_its_header_before_it_is_decoded(content, reason, monkeypatch):
    monkeypatch.setattr(cv2, "imdecode", None)
    with pytest.raises(GarbledAnswer, match=reason):
        decode("c", content)
    assert is_truncated(content)


def test_a_grey_picture_may_have_three_times_the_pixels(monkeypatch):
    monkeypatch.setattr("drivers.cameras.decoding.MAX_DECODED_BYTES", 40 * 30)
    assert decode("c", grey_png(40, 30)).shape == (30, 40)
    with pytest.raises(GarbledAnswer, match="40×30 pixels of 3 bytes"):
        decode("c", PNG)


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


def tiff(image, orientation: int, order: str, big: bool = False) -> bytes:
    """An uncompressed grey TIFF or BigTIFF, rows stored from the top, with an orientation that says otherwise."""
    height, width = image.shape
    at = 16 if big else 8
    longs = {256: width, 257: height, 273: at, 278: height, 279: image.size}
    fields = longs | {258: 8, 259: 1, 262: 1, 274: orientation, 277: 1}
    offset, number, pad = ("Q", "Q", 4) if big else ("I", "H", 0)
    entries = (
        struct.pack(f"{order}HH{offset}I{pad}x", tag, 4, 1, value)
        if tag in longs
        else struct.pack(f"{order}HH{offset}HH{pad}x", tag, 3, 1, value, 0)
        for tag, value in sorted(fields.items())
    )
    head = b"II" if order == "<" else b"MM"
    head += (
        struct.pack(f"{order}HHHQ", 43, 8, 0, at + image.size)
        if big
        else struct.pack(f"{order}HI", 42, at + image.size)
    )
    return head + image.tobytes() + struct.pack(order + number, len(fields)) + b"".join(entries) + bytes(at - 4)


@pytest.mark.parametrize("big", [False, True], ids=["TIFF", "BigTIFF"])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_tiff_comes_as_its_rows_are_stored(orientation: int, order: str, big: bool, tmp_path) -> None:
    """As PNG and JPEG do: X of a picture that was turned or mirrored belongs to another camera."""
    file = tmp_path / "view.tif"
    file.write_bytes(tiff(GREY, orientation, order, big))
    np.testing.assert_array_equal(read_grey(file), GREY)


@settings(max_examples=60)
@given(
    st.binary(max_size=60), st.sampled_from([b"", b"II*\0", b"MM\0+", b"II*\0\x08\0\0\0", tiff(GREY, 3, "<")[:1300]])
)
def test_what_is_no_whole_tiff_stays_as_it_is_long(tail, head):
    assert len(without_orientation(head + tail)) == len(head + tail)

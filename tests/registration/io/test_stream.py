"""A cloud moved while it passes by."""

import collections
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from registration.errors import (
    CloudError,
    CloudFormatError,
    CloudTooLong,
    CloudTruncated,
    CloudUnsupported,
    MotionError,
    UnitUnknown,
)
from registration.io.formats import pcd, ply
from registration.io.formats.bodies import TextEncoder
from registration.io.stream import CloudStream
from registration.points.layout import XYZ_FLOAT32, XYZ_FLOAT64, Layout
from tests.registration.clouds import BASE_T_CAMERA, RICH, cloud, moved, xyz
from tests.support.cases import cases

PLY, PCD, OCTETS = "application/x-ply", "application/x-pcd", "application/octet-stream"
PADDED = Layout.of(np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("_3", "u1", (4,))]))
BIG = Layout.of(np.dtype([(name, ">f4") for name in "xyz"] + [("label", ">i4")]))


def body_of(media_type: str, encoding: str, layout: Layout, count: int) -> bytes:
    return encode(media_type, encoding, layout, cloud(layout, count))


def encode(media_type: str, encoding: str, layout: Layout, records: np.ndarray) -> bytes:
    content = TextEncoder(layout).encode(records) if encoding == "ascii" else records.tobytes()
    header = {PLY: ply.format_header, PCD: pcd.format_header, OCTETS: lambda *_: b""}[media_type]
    return header(layout, len(records), encoding) + content


def through(body: bytes, media_type: str, cuts: list[int] | None = None, unit: str = "mm") -> tuple[bytes, CloudStream]:
    stream = CloudStream.of_body(media_type, BASE_T_CAMERA, unit)
    edges = [0, *sorted(cuts or []), len(body)]
    out = b"".join(part for start, end in itertools.pairwise(edges) for part in stream.parts(body[start:end]))
    return out + b"".join(stream.last_parts()), stream


def records_in(body: bytes, media_type: str) -> np.ndarray:
    parse = {PLY: ply.parse_header, PCD: pcd.parse_header}.get(media_type)
    if parse is None:
        return np.frombuffer(body, XYZ_FLOAT32.dtype)
    header = parse(body, "answer")
    assert header is not None
    if header.encoding == "binary":
        return np.frombuffer(body[header.length :], header.layout.dtype)
    return np.loadtxt(body[header.length :].decode().splitlines(), header.layout.dtype, ndmin=1)


KINDS = [
    (PLY, "binary_little_endian", XYZ_FLOAT32),
    (PLY, "binary_little_endian", XYZ_FLOAT64),
    (PLY, "binary_little_endian", RICH),
    (PLY, "binary_big_endian", BIG),
    (PLY, "ascii", XYZ_FLOAT32),
    (PLY, "ascii", RICH),
    (PCD, "binary", XYZ_FLOAT32),
    (PCD, "binary", PADDED),
    (PCD, "ascii", RICH),
    (OCTETS, "binary", XYZ_FLOAT32),
]


@pytest.mark.parametrize(("media_type", "encoding", "layout"), KINDS)
def test_every_point_is_moved_and_every_other_column_survives(media_type: str, encoding: str, layout: Layout) -> None:
    records = cloud(layout, 2000)
    out, stream = through(body_of(media_type, encoding, layout, 2000), media_type)
    answer = records_in(out, media_type)
    np.testing.assert_allclose(xyz(answer), moved(records), rtol=0, atol=2e-4)
    for name in set(layout.dtype.names or ()) - {"x", "y", "z", "nx", "ny", "nz"}:
        assert np.array_equal(answer[name], records[name]), name
    if layout.normals:
        expected = xyz(records, layout.normals) @ BASE_T_CAMERA[:3, :3].T
        np.testing.assert_allclose(xyz(answer, layout.normals), expected, rtol=0, atol=1e-6)
    assert (stream.points, stream.non_finite) == (2000, 0)


@pytest.mark.parametrize(("media_type", "encoding", "layout"), KINDS)
@settings(max_examples=cases(15), deadline=None)
@given(data=st.data())
def test_boundaries_of_pieces_do_not_show(media_type: str, encoding: str, layout: Layout, data: st.DataObject) -> None:
    body = body_of(media_type, encoding, layout, 60)
    cuts = data.draw(st.lists(st.integers(0, len(body)), max_size=30))
    assert through(body, media_type, cuts)[0] == through(body, media_type)[0]


@pytest.mark.parametrize(("media_type", "encoding", "layout"), KINDS)
def test_byte_by_byte(media_type: str, encoding: str, layout: Layout) -> None:
    body = body_of(media_type, encoding, layout, 20)
    assert through(body, media_type, list(range(len(body))))[0] == through(body, media_type)[0]


@pytest.mark.parametrize(("media_type", "encoding", "layout"), KINDS)
@pytest.mark.parametrize("kept", [0, 3])
def test_a_part_stays_as_it_is_until_it_is_let_go(media_type: str, encoding: str, layout: Layout, kept: int) -> None:
    """The chunks come in one buffer, of which the next is read; memory of a part that was let go is used again."""
    body = body_of(media_type, encoding, layout, 3000)
    stream, buffer, out = CloudStream.of_body(media_type, BASE_T_CAMERA, "mm"), bytearray(2001), b""
    held: collections.deque[bytes | memoryview] = collections.deque()
    for start in range(0, len(body), len(buffer)):
        chunk = memoryview(buffer)[: len(body) - start]
        chunk[:] = body[start : start + len(chunk)]
        held.extend(stream.parts(chunk))
        buffer[:] = b"\xff" * len(buffer)
        while len(held) > kept:
            out += held.popleft()
    assert out + b"".join([*held, *stream.last_parts()]) == through(body, media_type)[0]


@pytest.mark.parametrize(("media_type", "encoding", "layout"), KINDS)
def test_a_body_cut_anywhere_is_refused(media_type: str, encoding: str, layout: Layout) -> None:
    body = body_of(media_type, encoding, layout, 3)
    last_number = len(body) - 1 if encoding == "ascii" else len(body)
    for end in range(last_number):
        whole = media_type == OCTETS and end % 12 == 0
        if whole or (encoding == "ascii" and _only_digits_of_the_last_number(body, end)):
            continue
        with pytest.raises((CloudTruncated, CloudFormatError)):
            through(body[:end], media_type)


def _only_digits_of_the_last_number(body: bytes, end: int) -> bool:
    """A cut inside the last number of a text cannot be told from a shorter number."""
    return end > body.rstrip().rfind(b" ") + 1


@pytest.mark.parametrize(("media_type", "encoding", "layout"), KINDS[:-1])
def test_bytes_after_the_end_are_refused(media_type: str, encoding: str, layout: Layout) -> None:
    with pytest.raises(CloudTooLong, match="after point 5"):
        through(body_of(media_type, encoding, layout, 5) + b"1", media_type)


def test_zeros_behind_a_pcd_are_left_out() -> None:
    body = body_of(PCD, "binary", PADDED, 5)
    for cuts in ([], [len(body)], [len(body) + 7]):
        assert through(body + bytes(100), PCD, cuts)[0] == through(body, PCD)[0]


def test_metres_become_millimetres() -> None:
    records = cloud(XYZ_FLOAT32, 10)
    for name in "xyz":
        records[name] /= 1000
    out, _ = through(records.tobytes(), OCTETS, unit="m")
    expected = moved(records, scale=1000.0)
    np.testing.assert_allclose(xyz(np.frombuffer(out, XYZ_FLOAT32.dtype)), expected, rtol=0, atol=3e-4)


@pytest.mark.parametrize("unit", [None, "inch", ""])
def test_an_unstated_unit_is_asked_for(unit: str | None) -> None:
    with pytest.raises(UnitUnknown, match="'m' or 'mm'"):
        CloudStream.of_body(PLY, BASE_T_CAMERA, unit)


@pytest.mark.parametrize(
    ("matrix", "says"),
    [
        (np.diag([1.0, 1, -1, 1]), "mirrors"),
        (np.diag([2.0, 2, 2, 1]), "scales"),
        (np.full((4, 4), np.nan), "not finite"),
        (np.eye(3), "shape"),
        (np.ones((4, 4)), "last row"),
    ],
)
def test_a_transform_that_is_no_motion_is_refused(matrix: np.ndarray, says: str) -> None:
    with pytest.raises(MotionError, match=says):
        CloudStream.of_body(PLY, matrix, "mm")


def test_points_that_are_not_finite_pass_and_are_counted() -> None:
    records = cloud(RICH, 9)
    records["x"][2], records["y"][4], records["z"][7] = np.nan, np.inf, -np.inf
    out, stream = through(ply.format_header(RICH, 9) + records.tobytes(), PLY)
    finite = np.isfinite(xyz(records_in(out, PLY))).all(axis=1)
    assert stream.non_finite == 3
    assert np.flatnonzero(~finite).tolist() == [2, 4, 7]


@pytest.mark.parametrize(("media_type", "encoding", "layout"), KINDS)
def test_a_pixel_without_a_point_does_not_become_one_where_the_scanner_stands(
    media_type: str, encoding: str, layout: Layout
) -> None:
    records = cloud(layout, 9)
    for name in layout.xyz:
        records[name][[2, 5]] = 0  # as many scanners write it
    records["z"][7] = 0  # a point, beside the scanner
    out, stream = through(encode(media_type, encoding, layout, records), media_type)
    answer = xyz(records_in(out, media_type))
    seen = np.delete(np.arange(9), [2, 5])
    assert np.isnan(answer[[2, 5]]).all()
    np.testing.assert_allclose(answer[seen], moved(records)[seen], rtol=0, atol=2e-4)
    assert (stream.points, stream.non_finite) == (9, 2)


@pytest.mark.parametrize(("media_type", "encoding", "layout"), KINDS)
def test_no_points_are_a_cloud_too(media_type: str, encoding: str, layout: Layout) -> None:
    body = body_of(media_type, encoding, layout, 0)
    out, stream = through(body, media_type)
    assert out == body
    assert stream.points == 0


def test_a_header_that_promises_the_world_costs_nothing() -> None:
    body = ply.format_header(XYZ_FLOAT32, 2**62) + bytes(120)
    with pytest.raises(CloudTruncated, match=f"after 10 points of {2**62} promised"):
        through(body, PLY)
    with pytest.raises(CloudFormatError, match="not a whole number"):
        through(body.replace(str(2**62).encode(), str(2**70).encode()), PLY)


def test_faces_and_cameras_come_out_bit_for_bit() -> None:
    records = cloud(XYZ_FLOAT32, 4)
    camera = np.arange(3, dtype="<f8").tobytes()
    faces = b"".join(bytes([n]) + np.arange(n, dtype="<i4").tobytes() for n in (3, 3, 4, 3))
    header = (
        ply.format_header(XYZ_FLOAT32, 4)
        .replace(
            b"element vertex",
            b"element camera 1\nproperty double a\nproperty double b\nproperty double c\nelement vertex",
        )
        .replace(b"end_header", b"element face 4\nproperty list uchar int vertex_indices\nend_header")
    )
    body = header + camera + records.tobytes() + faces
    out, _ = through(body, PLY)
    assert len(out) == len(body)
    assert out.startswith(header + camera)
    assert out.endswith(faces)
    for cuts in ([len(header) + 3], [len(body) - 5, len(body) - 4], list(range(len(body)))):
        assert through(body, PLY, cuts)[0] == out
    stream, buffer = CloudStream.of_body(PLY, BASE_T_CAMERA, "mm"), bytearray(body)
    parts = list(stream.parts(buffer))
    buffer[:] = bytes(len(buffer))
    assert b"".join(parts) == out
    with pytest.raises(CloudTruncated, match="face 3"):
        through(body[:-1], PLY)
    with pytest.raises(CloudTooLong):
        through(body + b"\0", PLY)


def test_faces_in_text() -> None:
    body = (
        b"ply\r\nformat ascii 1.0\r\nelement vertex 1\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\n"
    )
    body += b"element face 2\r\nproperty list uchar int i\r\nend_header\r\n1 2 3\r\n3 0 0 0\r\n3 0 0 0"
    out, stream = through(body, PLY)
    assert out.endswith(b"\r\n3 0 0 0\r\n3 0 0 0".lstrip(b"\r\n"))
    assert stream.points == 1
    with pytest.raises(CloudTruncated, match="beside the points"):
        through(body[: body.rfind(b"\n") + 1], PLY)


BROKEN_HEADERS = [
    (b"plx\n", "begins with the line 'ply'"),
    (b"ply\nformat binary_middle_endian 1.0\n", "header line 2"),
    (b"ply\nformat ascii 1.0\nelement vertex -1\n", "not a whole number"),
    (b"ply\nformat ascii 1.0\nelement vertex 1e3\n", "not a whole number"),
    (b"ply\nformat ascii 1.0\nproperty float x\n", "no PLY header line here"),
    (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\n", "no PLY type"),
    (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float x\n", "stands twice"),
    (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty list float int x\n", "no PLY type"),
    (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar int x\n", "is a list"),
    (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n", "no y, z"),
    (b"ply\nformat ascii 1.0\nend_header\n", "0 elements 'vertex'"),
    (b"ply\nend_header\n", "no 'format' line"),
    (b"ply\nelement vertex 1\nproperty float x\n", "before the 'format' line"),
    (b"ply\ncomment " + b"x" * 70000, "within 65536 bytes"),
    (b"ply\nformat ascii 1.0\nwhat is \xff this\n", "not ASCII"),
]


@pytest.mark.parametrize(("header", "says"), BROKEN_HEADERS)
def test_a_broken_ply_header_is_reported(header: bytes, says: str) -> None:
    with pytest.raises(CloudError, match=says):
        through(header, PLY)


PCD_HEADER = pcd.format_header(XYZ_FLOAT32, 1)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (b"FIELDS x y z", b"FIELDS x y", "different numbers of entries"),
        (b"FIELDS x y z", b"FIELDS x y q", "no field 'z'"),
        (b"FIELDS x y z", b"FIELDS x y y", "stands twice"),
        (b"SIZE 4 4 4", b"SIZE 4 4 3", "which PCD does not have"),
        (b"TYPE F F F", b"TYPE F F I", "no single float"),
        (b"COUNT 1 1 1", b"COUNT 1 1 0", "not a whole number"),
        (b"COUNT 1 1 1", b"COUNT 1 1 999999999", "elements"),
        (b"WIDTH 1", b"WIDTH 2", "WIDTH x HEIGHT is 2"),
        (b"DATA binary", b"DATA zip", "DATA is 'zip'"),
        (b"VERSION", b"VERSUCH", "no PCD keyword"),
        (b"HEIGHT 1\n", b"HEIGHT 1\nHEIGHT 1\n", "stands twice"),
        (b"DATA binary", b"DATA binary_compressed", "compressed"),
    ],
)
def test_a_broken_pcd_header_is_reported(old: bytes, new: bytes, says: str) -> None:
    with pytest.raises(CloudError, match=says):
        through(PCD_HEADER.replace(old, new) + bytes(12), PCD)


def test_normals_of_several_numbers_are_no_normals_and_pass_by() -> None:
    names = ("x", "y", "z", "normal_x", "normal_y", "normal_z")
    layout = Layout.of(np.dtype([(name, "<f4", (2,)) if name == "normal_x" else (name, "<f4") for name in names]))
    assert layout.normals is None
    records = np.frombuffer(np.arange(70, dtype="<f4").tobytes(), layout.dtype)
    answer, _ = through(pcd.format_header(layout, 10) + records.tobytes(), PCD)
    out = np.frombuffer(answer[-records.nbytes :], layout.dtype)
    np.testing.assert_array_equal(out["normal_x"], records["normal_x"])
    np.testing.assert_array_equal(out["normal_z"], records["normal_z"])


def test_something_else_is_reported_at_the_first_byte() -> None:
    for media_type in (PLY, PCD):
        with pytest.raises(CloudFormatError, match="byte 0"):
            list(CloudStream.of_body(media_type, BASE_T_CAMERA, "mm").parts(b"\x89PNG"))


def test_the_viewpoint_is_the_origin_after_the_move() -> None:
    body = PCD_HEADER.replace(b"VIEWPOINT 0 0 0 1 0 0 0", b"VIEWPOINT 9 9 9 0 1 0 0") + bytes(12)
    assert b"VIEWPOINT 0 0 0 1 0 0 0\n" in through(body, PCD)[0]


@pytest.mark.parametrize("line", [b"1 2\n", b"1 2 3 4\n", b"1 2 drei\n", b"1 2 \xff\n", b"1,2,3\n"])
def test_text_where_numbers_belong_is_reported_with_its_point(line: bytes) -> None:
    body = ply.format_header(XYZ_FLOAT32, 3, "ascii") + b"0 0 0\n" + line + b"0 0 0\n"
    with pytest.raises(CloudFormatError, match="request body: point 1: "):
        through(body, PLY)


def test_a_line_without_end_is_refused_in_bounded_memory() -> None:
    with pytest.raises(CloudFormatError, match="longer than"):
        through(ply.format_header(XYZ_FLOAT32, 1, "ascii") + b"1" * 200_000, PLY)


def test_other_media_types_are_refused_with_the_known_ones() -> None:
    with pytest.raises(CloudUnsupported, match="application/x-ply"):
        CloudStream.of_body("image/png", BASE_T_CAMERA, "mm")


def test_far_away_coordinates_keep_their_digits() -> None:
    far = BASE_T_CAMERA.copy()
    far[:3, 3] = [4.5e5, -9.9e5, 1e6]
    records = cloud(XYZ_FLOAT64, 100)
    stream = CloudStream.of_body(PLY, far, "mm")
    out = b"".join([*stream.parts(ply.format_header(XYZ_FLOAT64, 100) + records.tobytes()), *stream.last_parts()])
    np.testing.assert_allclose(xyz(records_in(out, PLY)), moved(records, far), rtol=0, atol=2e-9)


@settings(max_examples=cases(200), deadline=None)
@given(
    st.binary(max_size=400),
    st.sampled_from([b"", b"ply\n", ply.format_header(RICH, 3), PCD_HEADER]),
    st.sampled_from([PLY, PCD]),
)
def test_any_bytes_give_a_cloud_or_a_named_error(tail: bytes, head: bytes, media_type: str) -> None:
    try:
        through(head + tail, media_type)
    except CloudError as error:
        assert str(error).startswith("request body: ")


@settings(max_examples=cases(200), deadline=None)
@given(st.sampled_from(KINDS), st.data())
def test_a_damaged_cloud_gives_a_cloud_or_a_named_error(kind: tuple[str, str, Layout], data: st.DataObject) -> None:
    body = bytearray(body_of(*kind, 3))
    for _ in range(data.draw(st.integers(1, 3))):
        body[data.draw(st.integers(0, len(body) - 1))] = data.draw(st.integers(0, 255))
    try:
        through(bytes(body), kind[0])
    except CloudError as error:
        assert error.file == "request body"
        assert error.place

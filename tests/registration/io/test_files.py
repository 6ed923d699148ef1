"""Cloud files: every format in, every format out, whole or not at all."""

import contextlib
import errno
import itertools
import os
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from registration.errors import CloudError, CloudIOError, CloudTooLong, CloudTruncated, CloudUnsupported
from registration.io import convert, durable_file, parallel_copy
from registration.io.convert import move_file
from registration.io.formats import npy, pcd, ply
from registration.io.formats.compressed import LzfDamaged, decompress
from registration.points.layout import XYZ_FLOAT32, Layout, Records
from registration.points.rigid_motion import RigidMotion
from tests.registration.clouds import BASE_T_CAMERA, RICH, cloud, moved, xyz
from tests.registration.io.cloud_files import read, write
from tests.registration.packed import compressed, lzf
from tests.support.cases import cases

MOTION = RigidMotion.of(BASE_T_CAMERA, "mm")
PCL = Layout.of(
    np.dtype(
        [
            *((name, "<f4") for name in ("x", "y", "z", "rgb", "normal_x", "normal_y", "normal_z")),
            ("_7", "u1", (4,)),
            ("histogram", "<f4", (2,)),
            ("stamp", "<u8"),
        ]
    )
)


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".npy", ".csv", ".xyz"])
def test_what_is_written_is_read_again(tmp_path: Path, suffix: str) -> None:
    records = cloud(RICH, 5000)
    path = tmp_path / f"cloud{suffix}"
    write(path, RICH, records)
    again = read(path, common=True)
    assert set(again.dtype.names or ()) == set(records.dtype.names or ())
    for name in records.dtype.names or ():
        assert np.array_equal(again[name].astype(records[name].dtype), records[name]), name
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize(("source", "target"), list(itertools.product([".ply", ".pcd", ".npy", ".csv"], repeat=2)))
def test_any_format_becomes_any_other_and_lies_in_the_base(tmp_path: Path, source: str, target: str) -> None:
    records = cloud(RICH, 3000)
    write(tmp_path / f"in{source}", RICH, records)
    counted = move_file(tmp_path / f"in{source}", tmp_path / f"out{target}", MOTION)
    answer = read(tmp_path / f"out{target}", common=True)
    assert (counted.points, counted.non_finite) == (3000, 0)
    np.testing.assert_allclose(xyz(answer), moved(records), rtol=0, atol=2e-4)
    normals = xyz(records, ("nx", "ny", "nz")) @ BASE_T_CAMERA[:3, :3].T
    np.testing.assert_allclose(xyz(answer, ("nx", "ny", "nz")), normals, rtol=0, atol=1e-6)
    for name in ("red", "green", "blue", "intensity", "time"):
        assert np.array_equal(answer[name], records[name]), name


def test_pcl_columns_get_their_common_names(tmp_path: Path) -> None:
    records = cloud(PCL, 50)
    colours = np.arange(150, dtype=np.uint8).reshape(50, 3)
    packed = (colours.astype(np.uint32) << np.array([16, 8, 0], np.uint32)).sum(axis=1).astype(np.uint32)
    records["rgb"] = packed.view(np.float32)
    (tmp_path / "in.pcd").write_bytes(pcd.format_header(PCL, 50) + records.tobytes())
    move_file(tmp_path / "in.pcd", tmp_path / "out.ply", MOTION)
    answer = read(tmp_path / "out.ply")
    names = "x y z red green blue nx ny nz histogram_0 histogram_1 stamp"
    assert answer.dtype.names == tuple(names.split())
    assert np.array_equal(np.stack([answer[name] for name in ("red", "green", "blue")], axis=1), colours)
    assert np.array_equal(answer["histogram_1"], records["histogram"][:, 1])


def test_same_format_keeps_header_and_padding(tmp_path: Path) -> None:
    records = cloud(PCL, 50)
    body = pcd.format_header(PCL, 50) + records.tobytes()
    (tmp_path / "in.pcd").write_bytes(body)
    move_file(tmp_path / "in.pcd", tmp_path / "out.pcd", MOTION)
    answer = (tmp_path / "out.pcd").read_bytes()
    assert len(answer) == len(body)
    assert np.array_equal(read(tmp_path / "out.pcd")["_7"], records["_7"])


def reader(data: bytes) -> Callable[[int], bytes]:
    rest = [data]

    def take(size: int) -> bytes:
        piece, rest[0] = rest[0][:size], rest[0][size:]
        return piece

    return take


@settings(max_examples=cases(60), deadline=None)
@given(st.lists(st.sampled_from([b"a", b"abc" * 200, bytes(300), b"xyz", bytes(range(256))]), max_size=60))
def test_lzf_gives_back_what_was_packed(pieces: list[bytes]) -> None:
    data = b"".join(pieces)
    packed = lzf(data)
    assert b"".join(decompress(reader(packed), len(packed))) == data


@settings(max_examples=cases(100), deadline=None)
@given(st.binary(max_size=300))
def test_any_bytes_as_lzf_end_or_are_reported(data: bytes) -> None:
    with contextlib.suppress(LzfDamaged):
        assert len(b"".join(decompress(reader(data), len(data)))) <= 300 * 264


@pytest.mark.slow
def test_compressed_pcd_is_read_in_blocks(tmp_path: Path) -> None:
    records = cloud(PCL, 40_000)
    records["x"] = np.repeat(np.arange(400, dtype=np.float32), 100)
    (tmp_path / "in.pcd").write_bytes(compressed(PCL, records))
    assert np.array_equal(read(tmp_path / "in.pcd").view(np.uint8), records.view(np.uint8))
    move_file(tmp_path / "in.pcd", tmp_path / "out.pcd", MOTION)
    np.testing.assert_allclose(xyz(read(tmp_path / "out.pcd")), moved(records), rtol=0, atol=2e-4)


def test_compressed_pcd_cut_anywhere_is_reported(tmp_path: Path) -> None:
    body = compressed(XYZ_FLOAT32, cloud(XYZ_FLOAT32, 3))
    for end in range(len(body)):
        (tmp_path / "in.pcd").write_bytes(body[:end])
        with pytest.raises(CloudError, match=r"^in\.pcd: "):
            read(tmp_path / "in.pcd")


def test_zeros_that_pcl_fills_its_last_page_with_are_no_points(tmp_path: Path) -> None:
    records = cloud(PCL, 50)
    for body in (pcd.format_header(PCL, 50) + records.tobytes(), compressed(PCL, records)):
        (tmp_path / "in.pcd").write_bytes(body + bytes(3000))
        assert len(read(tmp_path / "in.pcd")) == 50
        assert move_file(tmp_path / "in.pcd", tmp_path / "out.pcd", MOTION).points == 50
        (tmp_path / "in.pcd").write_bytes(body + bytes(2999) + b"1")
        with pytest.raises(CloudTooLong, match="after point 50"):
            read(tmp_path / "in.pcd")


def test_a_pcd_that_would_lose_digits_is_refused(tmp_path: Path) -> None:
    (tmp_path / "in.csv").write_text("1 2 3\n4 5 nan\n")
    move_file(tmp_path / "in.csv", tmp_path / "near.pcd", MOTION)
    (tmp_path / "in.csv").write_text("1 2 3\n4 5 600000000.001\n")
    with pytest.raises(CloudUnsupported, match=r"^far\.pcd: points: coordinates beyond 20000 mm lose digits"):
        move_file(tmp_path / "in.csv", tmp_path / "far.pcd", MOTION)
    assert not (tmp_path / "far.pcd").exists()


def triangles() -> Records:
    records = np.zeros(500, np.dtype([("normal", "<f4", 3), ("corners", "<f4", 9), ("attribute", "<u2")]))
    records["corners"] = np.random.default_rng(0).normal(size=(500, 9))
    return records


def test_the_corners_of_an_stl_are_points(tmp_path: Path) -> None:
    facets = triangles()
    (tmp_path / "b.stl").write_bytes(b"solid but binary".ljust(80) + np.uint32(500).tobytes() + facets.tobytes())
    lines = ["solid part"]
    for corners in facets["corners"].reshape(-1, 3, 3):
        lines += ["facet normal 0 0 0", "outer loop", *("vertex {:.9g} {:.9g} {:.9g}".format(*c) for c in corners)]
        lines += ["endloop", "endfacet"]
    (tmp_path / "t.stl").write_text("\n".join([*lines, "endsolid part"]))
    for name in ("b.stl", "t.stl"):
        assert np.array_equal(xyz(read(tmp_path / name)), facets["corners"].reshape(-1, 3).astype(float)), name
    (tmp_path / "b.stl").write_bytes((tmp_path / "b.stl").read_bytes()[:-1])
    (tmp_path / "t.stl").write_bytes((tmp_path / "t.stl").read_bytes()[:-20])
    for name in ("b.stl", "t.stl"):
        with pytest.raises(CloudTruncated):
            read(tmp_path / name)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("1 2 3\n4 5 6\n", ("x", "y", "z")),
        ("1,2,3,7\n4,5,6,8", ("x", "y", "z", "c3")),
        ("//X Y Z Intensity\n1 2 3 7\n4 5 6 8\n", ("x", "y", "z", "intensity")),
        ('"x";"y";"z";r\r\n1;2;3;7\r\n4;5;6;8\r\n', ("x", "y", "z", "red")),
        ("# t,x,y,z\n9,1,2,3\n9,4,5,6\n\n", ("t", "x", "y", "z")),
        ("\ufeffx\ty\tz\n1\t2\t3\n4\t5\t6\n", ("x", "y", "z")),
    ],
)
def test_rows_of_numbers_name_their_columns_or_do_not(tmp_path: Path, text: str, names: tuple[str, ...]) -> None:
    (tmp_path / "in.csv").write_bytes(text.encode())
    records = read(tmp_path / "in.csv")
    assert records.dtype.names == names
    assert xyz(records).tolist() == [[1, 2, 3], [4, 5, 6]]


@pytest.mark.parametrize("text", ["1 2\n", "a b c\n", "\x00\xff\n", "x,y,z,x\n", "", "1 2 3"[:0]])
def test_rows_that_are_no_points_are_reported(tmp_path: Path, text: str) -> None:
    (tmp_path / "in.csv").write_bytes(text.encode("latin1"))
    with pytest.raises(CloudError, match=r"^in\.csv: "):
        read(tmp_path / "in.csv")


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((4, 2)),
        np.zeros(4),
        np.zeros((4, 3), int),
        np.zeros((4, 3), np.complex64),
        np.asfortranarray(np.zeros((4, 3))),
        np.zeros(4, [("x", "f4"), ("y", "f4")]),
        np.zeros(4, [("x", "f4"), ("y", "f4"), ("z", "U3")]),
    ],
)
def test_arrays_that_are_no_clouds_are_reported(tmp_path: Path, array: np.ndarray) -> None:
    np.save(tmp_path / "in.npy", array)
    with pytest.raises(CloudUnsupported):
        read(tmp_path / "in.npy")


def test_numpy_reads_what_is_written(tmp_path: Path) -> None:
    records = cloud(XYZ_FLOAT32, 100)
    write(tmp_path / "plain.npy", XYZ_FLOAT32, records)
    write(tmp_path / "rich.npy", RICH, cloud(RICH, 100))
    assert np.array_equal(np.load(tmp_path / "plain.npy"), xyz(records).astype(np.float32))
    assert np.array_equal(np.load(tmp_path / "rich.npy"), cloud(RICH, 100))


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".npy", ".stl"])
def test_a_file_cut_anywhere_is_reported_by_name_and_place(tmp_path: Path, suffix: str) -> None:
    whole = tmp_path / f"whole{suffix}"
    if suffix == ".stl":
        whole.write_bytes(bytes(80) + np.uint32(2).tobytes() + triangles()[:2].tobytes())
    else:
        write(whole, RICH, cloud(RICH, 2))
    content, path = whole.read_bytes(), tmp_path / f"cut{suffix}"
    for end in range(len(content)):
        path.write_bytes(content[:end])
        with pytest.raises(CloudError) as caught:
            read(path)
        assert caught.value.file == path.name
        with pytest.raises(CloudError):
            move_file(path, tmp_path / "out.ply", MOTION)
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted([whole.name, path.name])


def test_missing_and_unknown_files_are_reported(tmp_path: Path) -> None:
    with pytest.raises(CloudIOError, match=r"no\.ply: file: it cannot be opened"):
        read(tmp_path / "no.ply")
    with pytest.raises(CloudUnsupported, match=r"'\.docx'"):
        (tmp_path / "cloud.docx").touch()
        read(tmp_path / "cloud.docx")
    with pytest.raises(CloudUnsupported, match="not written"):
        move_file(tmp_path / "cloud.docx", tmp_path / "out.docx", MOTION)


@contextmanager
def room_for(size: int) -> Iterator[None]:
    """Files of this process may not grow beyond `size` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("reserves", [True, False])
@pytest.mark.parametrize("target", ["out.ply", "out.pcd", "out.xyz"])
def test_a_disk_that_fills_up_leaves_the_old_file_and_no_other(
    tmp_path: Path, target: str, reserves: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "in.ply", RICH, cloud(RICH, 3000))
    (tmp_path / target).write_text("what was there")
    if not reserves:
        monkeypatch.setattr(durable_file.GuardedFile, "reserve", lambda self, length: None)
    with (
        room_for(50_000),
        pytest.raises(CloudIOError, match=rf"{target}: byte \d+: it cannot be written .File too large"),
    ):
        move_file(tmp_path / "in.ply", tmp_path / target, MOTION)
    assert (tmp_path / target).read_text() == "what was there"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.ply", target]


def test_a_file_system_that_cannot_reserve_is_written_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def cannot(*_: object) -> None:
        raise OSError(errno.EOPNOTSUPP, "Operation not supported")

    records = cloud(RICH, 3000)
    write(tmp_path / "in.ply", RICH, records)
    monkeypatch.setattr(os, "posix_fallocate", cannot)
    move_file(tmp_path / "in.ply", tmp_path / "out.ply", MOTION)
    np.testing.assert_allclose(xyz(read(tmp_path / "out.ply")), moved(records), rtol=0, atol=2e-3)


@pytest.mark.parametrize("layout", [XYZ_FLOAT32, RICH])
def test_two_threads_write_the_bytes_of_one(tmp_path: Path, layout: Layout, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "in.ply", layout, cloud(layout, 300_000))
    counted = move_file(tmp_path / "in.ply", tmp_path / "two.ply", MOTION)
    monkeypatch.setattr(convert, "THREADS", 1)
    monkeypatch.setattr(parallel_copy, "SPAN_BYTES", 50_000)
    assert move_file(tmp_path / "in.ply", tmp_path / "one.ply", MOTION, durable=False) == counted
    assert counted.points == 300_000
    assert (tmp_path / "two.ply").read_bytes() == (tmp_path / "one.ply").read_bytes()


def test_a_file_that_shrinks_while_it_is_read_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "in.ply", RICH, cloud(RICH, 50_000))
    reserve = durable_file.GuardedFile.reserve

    def shrink(self: durable_file.GuardedFile, length: int) -> None:
        os.truncate(tmp_path / "in.ply", 1_000_000)
        reserve(self, length)

    monkeypatch.setattr(durable_file.GuardedFile, "reserve", shrink)
    with pytest.raises(CloudTruncated, match=r"in\.ply: point \d+: the file ends after \d+ of 50000 points"):
        move_file(tmp_path / "in.ply", tmp_path / "out.ply", MOTION)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.ply"]


def test_headers_are_as_long_for_every_count() -> None:
    for format_header in (ply.format_header, pcd.format_header, npy.format_header):
        assert len({len(format_header(RICH, count)) for count in (0, 9, 12_345, 10**15)}) == 1


@pytest.mark.data
def test_real_clouds_are_read_and_moved(real_data: Path, tmp_path: Path) -> None:
    source = real_data / "reghec_sphere" / "view_000.pcd"
    counted = move_file(source, tmp_path / "view.ply", RigidMotion.of(BASE_T_CAMERA, "m"))
    records = read(source)
    assert counted.points == len(records) == 13716
    np.testing.assert_allclose(xyz(read(tmp_path / "view.ply")), moved(records, scale=1000.0), rtol=0, atol=1e-3)


ROOT = Path(__file__).resolve().parents[3]


def test_moving_a_file_needs_neither_scipy_nor_pydantic() -> None:
    """They would double the memory of a process that only passes clouds on."""
    imports = "import sys, registration.io.convert, registration.io.stream"
    code = f"{imports}; print('scipy' in sys.modules, 'pydantic' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert said.stdout.split() == ["False", "False"]

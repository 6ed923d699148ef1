"""Damaged files of every format: a cloud, or an error that names file and place, and never a file left behind.

`HANDEYED_CASES=100000 pytest tests/registration/io/test_damage.py -k "ply and big"` tries one parser at length.
"""

import contextlib
import re
from collections.abc import Callable
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from registration.errors import CloudError
from registration.io.formats import npy, pcd, ply
from registration.io.formats.bodies import TextEncoder
from registration.io.reading import open_cloud
from registration.points.layout import XYZ_FLOAT32, Layout
from tests.registration.clouds import RICH, cloud
from tests.registration.io.e57_files import e57
from tests.registration.packed import compressed
from tests.support.cases import cases

POINTS = 3
BIG = Layout.of(np.dtype([(name, ">f4") for name in "xyz"] + [("label", ">i4")]))
FACES = (
    b"element face 2\nproperty list uchar int vertex_indices\nend_header",
    b"".join(bytes([3]) + np.arange(3, dtype="<i4").tobytes() for _ in range(2)),
)

TOKENS = [
    *(b"-1", b"0", b"1e9", b"9223372036854775807", b"99999999999999999999", b"nan", b"inf", b"1_0", b"\xff", b"\0" * 8),
    *(b"\n", b" ", b"x", b"F", b"I 8", b"ascii", b"binary", b"float", b"list uchar int", b"end_header\n", b"DATA "),
    *(b"element vertex 7\n", b"property double y\n", b"vertex 1 2\n", b"(3,)", b"'<f4'", b"{", b"#", b",", b";"),
]
"""What a damaged header is likeliest to trip over."""


def a_ply(encoding: str, layout: Layout, faces: bool = False) -> bytes:
    records = cloud(layout, POINTS)
    head = ply.format_header(layout, POINTS, encoding)
    body = TextEncoder(layout).encode(records) if encoding == "ascii" else records.tobytes()
    return head.replace(b"end_header", FACES[0]) + body + FACES[1] if faces else head + body


def a_pcd(encoding: str) -> bytes:
    records = cloud(RICH, POINTS)
    body = TextEncoder(RICH).encode(records) if encoding == "ascii" else records.tobytes()
    return pcd.format_header(RICH, POINTS, encoding) + body


def a_text_stl() -> bytes:
    corners = "".join(f"vertex {x} 2.5e1 -3\n" for x in range(3))
    return f"solid part\nfacet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\nendsolid part\n".encode()


def a_las(suffix: str, folder: Path, point_format: int = 3) -> bytes:
    laspy = pytest.importorskip("laspy", reason="laspy is not installed: LAS is not tried")
    content = laspy.create(point_format=point_format)
    content.x, content.y, content.z = np.random.default_rng(0).normal(0, 9, (3, POINTS))
    content.write(str(folder / f"sound{suffix}"))
    return (folder / f"sound{suffix}").read_bytes()


SOUND: dict[str, tuple[str, Callable[[Path], bytes]]] = {
    "ply ascii": (".ply", lambda _: a_ply("ascii", RICH)),
    "ply little": (".ply", lambda _: a_ply("binary_little_endian", RICH, faces=True)),
    "ply big": (".ply", lambda _: a_ply("binary_big_endian", BIG)),
    "pcd ascii": (".pcd", lambda _: a_pcd("ascii")),
    "pcd binary": (".pcd", lambda _: a_pcd("binary")),
    "pcd compressed": (".pcd", lambda _: compressed(RICH, cloud(RICH, POINTS))),
    "xyz": (".xyz", lambda _: TextEncoder(RICH).encode(cloud(RICH, POINTS))),
    "csv": (".csv", lambda _: b"x,y,z,r\n" + b"1,2.5,-3e2,4\n" * POINTS),
    "npy": (".npy", lambda _: npy.format_header(XYZ_FLOAT32, POINTS) + cloud(XYZ_FLOAT32, POINTS).tobytes()),
    "npy records": (".npy", lambda _: npy.format_header(RICH, POINTS) + cloud(RICH, POINTS).tobytes()),
    "stl ascii": (".stl", lambda _: a_text_stl()),
    "stl binary": (".stl", lambda _: bytes(80) + np.uint32(2).tobytes() + bytes(range(100))),
    "las": (".las", lambda folder: a_las(".las", folder)),
    "laz": (".laz", lambda folder: a_las(".laz", folder)),
    "laz layers": (".laz", lambda folder: a_las(".laz", folder, 7)),
    "e57": (".e57", lambda folder: e57(folder, POINTS)),
}
"""A parser, and a sound file of its format."""

BATCH = 25
"""Files that one example of Hypothesis tries: its own work takes longer than a parser's."""

EDITS = 4


def damaged(content: bytes, random: Random) -> bytes:
    """A few bytes changed, removed or put in, in the header as often as anywhere; one file in four ends early."""
    out = bytearray(content)
    for _ in range(random.randint(1, EDITS)):
        start = random.randint(0, min(len(out), 400) if random.random() < 0.5 else len(out))
        new = random.choice(TOKENS) if random.random() < 0.5 else random.randbytes(random.randint(0, 6))
        out[start : start + random.randint(0, 5)] = new
    return bytes(out[: random.randint(0, len(out))]) if random.random() < 0.25 else bytes(out)


@pytest.mark.timeout(0)
@pytest.mark.parametrize("name", SOUND)
def test_a_damaged_file_is_read_or_reported_by_name_and_place(tmp_path: Path, name: str) -> None:
    suffix, make = SOUND[name]
    sound = make(tmp_path)
    path = tmp_path / f"damaged{suffix}"
    said = re.compile(rf"damaged\{suffix}: .+: .+: .+", re.DOTALL)
    read = told = 0

    @settings(max_examples=max(1, cases(50) // BATCH), deadline=None, database=None, phases=[Phase.generate])
    @given(st.integers(0, 2**63))
    def attempt(seed: int) -> None:
        nonlocal read, told
        random = Random(seed)
        for _ in range(BATCH):
            path.write_bytes(damaged(sound, random))
            try:
                with open_cloud(path) as source:
                    points = sum(len(block) for block in source.blocks())
                read += 1
            except CloudError as error:
                assert said.match(str(error)), error
                told += 1
            else:
                assert points <= len(sound), "more points than bytes"

    with contextlib.redirect_stderr(None):
        attempt()
    print(f"{name}: {read} read, {told} told")
    assert told
    assert sorted(file.name for file in tmp_path.iterdir() if not file.name.startswith("sound")) == [path.name]

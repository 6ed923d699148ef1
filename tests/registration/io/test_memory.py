"""Memory stays flat whatever the cloud's size: the peak of a process that moves a large file beside a small one."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from registration.io.formats import npy, pcd, ply
from registration.io.formats.bodies import TextEncoder
from registration.points.layout import XYZ_FLOAT32
from tests.registration.clouds import cloud
from tests.registration.packed import literals

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[3]
SMALL, LARGE, LONG_TEXT = 1_000, 2_000_000, 400_000
GROWTH_MB = 8.0
"""Blocks and buffers that a small cloud does not fill; a large cloud's own bytes are 14 to 33 MB, its objects 100."""

PROBE = """
import sys
from pathlib import Path
import numpy as np
from registration.io.convert import move_file
from registration.points.rigid_motion import RigidMotion
for name in sys.argv[1:]:
    source = Path(name)
    move_file(source, source.with_name("out" + (".ply" if source.suffix == ".stl" else source.suffix)),
              RigidMotion.of(np.eye(4), "mm"), durable=False)
    print(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0])
"""


def text(count: int) -> bytes:
    return TextEncoder(XYZ_FLOAT32).encode(cloud(XYZ_FLOAT32, count))


def records(count: int) -> bytes:
    return cloud(XYZ_FLOAT32, count).tobytes()


def a_compressed_pcd(count: int) -> bytes:
    columns = b"".join(np.ascontiguousarray(cloud(XYZ_FLOAT32, count)[axis]).tobytes() for axis in "xyz")
    packed = literals(columns)
    sizes = np.array([len(packed), len(columns)], "<u4").tobytes()
    return pcd.format_header(XYZ_FLOAT32, count, "binary_compressed") + sizes + packed


FORMATS: dict[str, tuple[str, Callable[[int], bytes]]] = {
    "PLY": (".ply", lambda n: ply.format_header(XYZ_FLOAT32, n) + records(n)),
    "PLY, text": (".ply", lambda n: ply.format_header(XYZ_FLOAT32, n, "ascii") + text(n)),
    "PCD": (".pcd", lambda n: pcd.format_header(XYZ_FLOAT32, n) + records(n)),
    "PCD, text": (".pcd", lambda n: pcd.format_header(XYZ_FLOAT32, n, "ascii") + text(n)),
    "PCD, compressed": (".pcd", a_compressed_pcd),
    "XYZ": (".xyz", text),
    "NPY": (".npy", lambda n: npy.format_header(XYZ_FLOAT32, n) + records(n)),
    "STL": (".stl", lambda n: bytes(80) + np.uint32(n // 3).tobytes() + bytes(50 * (n // 3))),
}


@pytest.mark.parametrize("name", FORMATS)
def test_a_large_cloud_takes_no_more_memory_than_a_small_one(tmp_path: Path, name: str) -> None:
    suffix, content = FORMATS[name]
    files = [tmp_path / f"{size}{suffix}" for size in ("small", "large")]
    large = LONG_TEXT if "text" in name or suffix == ".xyz" else LARGE
    for file, size in zip(files, (SMALL, large), strict=True):
        file.write_bytes(content(size))
    said = subprocess.run(
        [sys.executable, "-c", PROBE, *map(str, files)], capture_output=True, text=True, check=True, cwd=ROOT
    )
    small_mb, large_mb = (int(line) / 1024 for line in said.stdout.split())
    assert large_mb - small_mb < GROWTH_MB

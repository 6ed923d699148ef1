"""Several clouds as one: each moved into the base frame, the columns they share written as one file in mm."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calibration.transforms import Array
from registration.fusion.merging import EVERY_POINT, Merge, Merger
from registration.io.columns import Conversion, shared_layout
from registration.io.convert import moved_blocks
from registration.io.durable_file import new_file
from registration.io.formats.las_out import las_out
from registration.io.reading import open_cloud
from registration.io.writing import CloudWriter, form_of
from registration.points.layout import XYZ_FLOAT32, Layout, Records
from registration.points.rigid_motion import Motion


@dataclass(frozen=True, eq=False)
class PlacedCloud:
    """A cloud file, its unit, and where its frame stood."""

    file: Path
    unit: str
    base_T_cloud: Array


Write = Callable[[Records], None]


def write_merged(
    clouds: Sequence[PlacedCloud], target: Path, calibration_id: str = "", merge: Merge = EVERY_POINT
) -> int:
    """Every finite point, or their averages, into `target`, by its suffix; answers how many.

    Raises RegistrationError.
    """
    layout, _ = shared_layout(_layout(cloud.file) for cloud in clouds)
    opened = _new_las if target.suffix == ".laz" else _new_cloud
    points = 0
    merger = Merger(merge, XYZ_FLOAT32 if target.suffix == ".bin" else layout)
    with opened(target, merger.layout, calibration_id) as (written, write):
        held = Conversion.between(merger.layout, written)
        placed = ((finite_blocks(cloud, merger.shared), cloud.base_T_cloud[:3, 3]) for cloud in clouds)
        for block in merger.merged(placed):
            write(block if written == merger.layout else held.convert(block))
            points += len(block)
    return points


def finite_blocks(cloud: PlacedCloud, layout: Layout) -> Iterator[Records]:
    """The finite points of a cloud in base, in mm."""
    motion = Motion.of(cloud.base_T_cloud, cloud.unit)
    with open_cloud(cloud.file) as source:
        for block in moved_blocks(source, motion, layout):
            finite = np.all([np.isfinite(block[name]) for name in layout.xyz], axis=0)
            yield block if finite.all() else block[finite]


def with_frame(header: bytes, calibration_id: str) -> bytes:
    """A PLY header with a comment that names the frame, whatever its older comments say."""
    line = b"comment handeyed: frame base, lengths mm"
    if calibration_id:
        line += b", calibration " + calibration_id.encode("ascii", "replace").translate(None, b"\r\n")
    head, _, end = header.rpartition(b"end_header")
    return head + line + (b"\r\n" if head.endswith(b"\r\n") else b"\n") + b"end_header" + end


@contextmanager
def _new_cloud(target: Path, layout: Layout, calibration_id: str) -> Iterator[tuple[Layout, Write]]:
    form = form_of(target, layout)
    if target.suffix == ".ply":
        plain = form.header
        form = replace(form, header=lambda count: with_frame(plain(count), calibration_id))
    with new_file(target) as file:
        writer = CloudWriter(file, form)
        yield form.layout, writer.write
        writer.finish()


@contextmanager
def _new_las(target: Path, layout: Layout, calibration_id: str) -> Iterator[tuple[Layout, Write]]:
    software = f"handeyed {calibration_id}"
    with new_file(target) as file, las_out(file, layout, compress=True, software=software) as out:
        yield layout, out.write


def _layout(file: Path) -> Layout:
    with open_cloud(file) as source:
        return source.layout

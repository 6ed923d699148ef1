"""Several clouds as one: each moved into the base frame, the columns they share written as one file in mm."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from calibration.transforms import Array
from registration.columns import Conversion, shared_layout
from registration.disk import new_file
from registration.errors import ScanError
from registration.files import moved_blocks
from registration.formats.extras import library
from registration.layout import XYZ_FLOAT32, Layout, Records
from registration.merging import EVERY_POINT, Merge, Merger
from registration.motion import Motion
from registration.reading import open_cloud
from registration.writing import CloudWriter, form_of

LAS_STEP_MM = 0.005
"""LAS holds integers: this step reaches 10 m and is far below any scanner's noise."""


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
    """LAZ through laspy: colours and intensity by LAS's own names, every other column as an extra dimension."""
    laspy = library("laspy", "las", target.name)
    library("lazrs", "las", target.name)
    header = laspy.LasHeader(version="1.4", point_format=7)
    header.scales, header.offsets = np.full(3, LAS_STEP_MM), np.zeros(3)
    header.system_identifier = "frame base, lengths mm"
    header.generating_software = f"handeyed {calibration_id}"[:32]
    own = {*layout.xyz, *COLOURS, "intensity"}
    names = layout.dtype.names or ()
    header.add_extra_dims([laspy.ExtraBytesParams(name, layout.dtype[name]) for name in names if name not in own])
    reach = LAS_STEP_MM * (2**31 - 1)

    def points_of(block: Records) -> Any:
        if len(block) and max(float(np.abs(block[name]).max()) for name in layout.xyz) > reach:
            raise ScanError(
                f"a point lies further than {reach:.0f} mm from the base", "ask for PLY, which has no limit"
            )
        record = laspy.ScaleAwarePointRecord.zeros(len(block), header=header)
        for name in names:
            record[name] = block[name] * np.uint16(257) if name in COLOURS and eight_bits[name] else block[name]
        return record

    eight_bits = {name: layout.dtype[name].itemsize == 1 for name in names}
    with (
        new_file(target) as file,
        laspy.open(file.raw, mode="w", header=header, do_compress=True, closefd=False) as writer,
    ):
        yield layout, lambda block: writer.write_points(points_of(block))


COLOURS = ("red", "green", "blue")


def _layout(file: Path) -> Layout:
    with open_cloud(file) as source:
        return source.layout

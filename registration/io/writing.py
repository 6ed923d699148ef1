"""Writes clouds in blocks; the number of points may be unknown until the end."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from registration.errors import CloudUnsupported
from registration.io.columns import with_colours
from registration.io.durable_file import GuardedFile, new_file
from registration.io.formats import npy, pcd, ply, rows
from registration.io.formats.bodies import TextEncoder
from registration.io.formats.e57_out import e57_layout, e57_out
from registration.io.formats.las_out import las_out
from registration.io.formats.pcl import PclRecords
from registration.points.layout import XYZ_FLOAT32, Layout, Records


def _raw(block: Records) -> bytes | memoryview:
    return np.ascontiguousarray(block).view(np.uint8).data


@dataclass(frozen=True)
class Form:
    """How a format is written: its header for a number of points (of constant length), and its blocks."""

    layout: Layout
    header: Callable[[int], bytes]
    encode: Callable[[Records], bytes | memoryview]


def _pcd(layout: Layout, file: str) -> Form:
    records = PclRecords(layout, file)
    return Form(layout, lambda count: pcd.format_header(records.layout, count), records.encode)


def _text(layout: Layout, separator: str) -> Form:
    return Form(layout, lambda count: rows.format_header(layout, separator), TextEncoder(layout, separator).encode)


def ply_form(layout: Layout, _file: str) -> Form:
    return Form(layout, lambda count: ply.format_header(layout, count), _raw)


FORMS: dict[str, Callable[[Layout, str], Form]] = {
    ".ply": lambda layout, file: ply_form(with_colours(layout, np.uint8), file),
    ".pcd": lambda layout, file: _pcd(with_colours(layout, np.uint8), file),
    ".npy": lambda layout, _: Form(layout, lambda count: npy.format_header(layout, count), _raw),
    ".xyz": lambda layout, _: _text(layout, " "),
    ".csv": lambda layout, _: _text(layout, ","),
    ".bin": lambda layout, _: Form(XYZ_FLOAT32, lambda count: b"", _raw),
}
"""Formats by suffix; `.bin` is raw float32 x, y, z without other columns."""


LIBRARIES: dict[str, Callable[[GuardedFile, Layout, str], AbstractContextManager[Callable[[Records], None]]]] = {
    ".las": lambda file, layout, software: las_out(file, layout, compress=False, software=software),
    ".laz": lambda file, layout, software: las_out(file, layout, compress=True, software=software),
    ".e57": lambda file, layout, _: e57_out(file, layout),
}
"""Formats that the extras' libraries write, with the software that is named as their writer."""


def form_of(path: Path, layout: Layout) -> Form:
    """Format of `path` for a cloud of common columns. Raises CloudUnsupported."""
    suffix = path.suffix.lower()
    if suffix in LIBRARIES:
        coloured = with_colours(layout, np.uint8) if suffix == ".e57" else with_colours(layout, np.uint16, np.uint8)
        return Form(e57_layout(coloured) if suffix == ".e57" else coloured, lambda count: b"", _raw)
    if suffix not in FORMS:
        fix = f"use one of {', '.join([*FORMS, *LIBRARIES])}"
        raise CloudUnsupported(path.name, "suffix", f"clouds of type {suffix!r} are not written", fix)
    return FORMS[suffix](layout, path.name)


class Writer:
    """Writes blocks of `form.layout` by `put`, and counts their points."""

    def __init__(self, form: Form, put: Callable[[Records], object]) -> None:
        self.form, self._put, self.points = form, put, 0

    def write(self, block: Records) -> None:
        self.points += len(block)
        self._put(block)


@contextmanager
def new_cloud(
    path: Path, layout: Layout, *, durable: bool = True, calibration_id: str | None = None
) -> Iterator[Writer]:
    """A cloud file that is whole under its name, or not there. Raises CloudUnsupported, CloudIOError.

    `calibration_id` of a cloud in the base frame: a PLY names both in a comment, a LAS file the calibration as writer.
    """
    form, library = form_of(path, layout), LIBRARIES.get(path.suffix.lower())
    if calibration_id is not None and path.suffix.lower() == ".ply":
        header, frame = form.header, calibration_id
        form = replace(form, header=lambda count: ply.with_frame(header(count), frame))
    with new_file(path, durable=durable) as file:
        if library is not None:
            with library(file, form.layout, f"handeyed {calibration_id or ''}".strip()) as put:
                yield Writer(form, put)
            return
        file.write(form.header(0))
        writer = Writer(form, lambda block: file.write(form.encode(block)))
        yield writer
        file.seek(0)
        file.write(form.header(writer.points))

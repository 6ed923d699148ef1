"""Writes new LAS and LAZ files in blocks through laspy: any columns, coordinates in mm as integers."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from registration.errors import CloudUnsupported
from registration.io.durable_file import GuardedFile
from registration.io.formats.extras import library
from registration.points.layout import COLOURS, Layout, Records

STEP_MM = 0.005
"""LAS stores integers: this step reaches ±10 m and is far below any scanner's noise."""

AS_READ = "_as_read"
"""Ends the name of a column that LAS has under this name with another range or type."""


class LasOut:
    """Writes the columns that LAS has under its names, every other one as an extra dimension.

    `names`: of each column of `layout` in the file.
    """

    def __init__(self, writer: Any, header: Any, layout: Layout, names: dict[str, str], laspy: Any, file: str) -> None:
        self._writer, self._header, self._laspy, self._file = writer, header, laspy, file
        self._layout, self._names = layout, names

    def write(self, block: Records) -> None:
        """Write a block. Raises CloudUnsupported for a point out of range or not finite."""
        reach = STEP_MM * (2**31 - 1)
        if len(block) and not all(np.abs(block[name]).max() <= reach for name in self._layout.xyz):
            what = f"a point lies further than {reach:.0f} mm from the base, or is not finite"
            raise CloudUnsupported(self._file, "points", what, "ask for PLY, which has no limit")
        record = self._laspy.ScaleAwarePointRecord.zeros(len(block), header=self._header)
        for name, theirs in self._names.items():
            eight_bits = name in COLOURS and self._layout.dtype[name] == np.uint8
            try:
                record[theirs] = block[name] * np.uint16(257) if eight_bits else block[name]
            except OverflowError:
                what = f"{int(block[name].max())} does not fit LAS's {name}"
                raise CloudUnsupported(self._file, name, what, "rename the column, or ask for PLY") from None
        self._writer.write_points(record)


@contextmanager
def las_out(file: GuardedFile, layout: Layout, *, compress: bool, software: str = "handeyed") -> Iterator[LasOut]:
    """Open a writer. Raises CloudUnsupported when laspy is not installed."""
    laspy = library("laspy", "las", file.name)
    if compress:
        library("lazrs", "las", file.name)
    header = laspy.LasHeader(version="1.4", point_format=7)
    header.scales, header.offsets = np.full(3, STEP_MM), np.zeros(3)
    header.system_identifier, header.generating_software = "frame base, lengths mm", software[:32]
    own = dict.fromkeys((*layout.xyz, "X", "Y", "Z"), np.dtype(float))
    own |= {each.name: each.dtype or np.dtype(np.uint8) for each in header.point_format.standard_dimensions}
    kinds = {name: layout.dtype[name] for name in layout.dtype.names or ()}
    held = {name for name, kind in kinds.items() if name in own and np.can_cast(kind, own[name])}
    names = {name: f"{name}{AS_READ}" if name in own and name not in held else name for name in kinds}
    extra = [laspy.ExtraBytesParams(names[name], kind) for name, kind in kinds.items() if name not in held]
    header.add_extra_dims(extra)
    with laspy.open(file.raw, mode="w", header=header, do_compress=compress, closefd=False) as writer:
        yield LasOut(writer, header, layout, names, laspy, file.name)

"""Writes new LAS and LAZ files in blocks through laspy: any columns, coordinates in mm as integers."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from registration.errors import CloudUnsupported
from registration.io.durable_file import GuardedFile
from registration.io.formats.extras import library
from registration.points.layout import COLOURS, Layout, Records

STEP_MM = 0.005
"""LAS stores integers: this step reaches ±10 m and is far below any scanner's noise."""

AS_READ = "_as_read"
"""Ends the name of a column that LAS has under this name with another range or type."""


@contextmanager
def las_out(
    file: GuardedFile, layout: Layout, *, compress: bool, software: str = "handeyed"
) -> Iterator[Callable[[Records], None]]:
    """What writes a block: columns that LAS has under its names, every other one as an extra dimension.

    It raises CloudUnsupported for a point out of range or not finite, and so does this when laspy is not installed.
    """
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
    reach = STEP_MM * (2**31 - 1)
    with laspy.open(file.raw, mode="w", header=header, do_compress=compress, closefd=False) as writer:

        def write(block: Records) -> None:
            if len(block) and not all(np.abs(block[name]).max() <= reach for name in layout.xyz):
                what = f"a point lies further than {reach:.0f} mm from the base, or is not finite"
                raise CloudUnsupported(file.name, "points", what, "ask for PLY, which has no limit")
            record = laspy.ScaleAwarePointRecord.zeros(len(block), header=header)
            for name, theirs in names.items():
                eight_bits = name in COLOURS and kinds[name] == np.uint8
                try:
                    record[theirs] = block[name] * np.uint16(257) if eight_bits else block[name]
                except OverflowError:
                    what = f"{int(block[name].max())} does not fit LAS's {name}"
                    raise CloudUnsupported(file.name, name, what, "rename the column, or ask for PLY") from None
            writer.write_points(record)

        yield write

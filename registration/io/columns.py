"""Common column names, so that clouds of different formats can be merged.

The common names are PLY's: x y z, nx ny nz, red green blue, intensity, and any further column. PCL's packed `rgb` is
split, padding is dropped, and 64-bit integers become doubles, since PLY has none. Colours of 16 bits count to 65,535,
all others to 255: a change of type scales them.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from registration.io.formats import pcl
from registration.io.formats.pcd import PADDING
from registration.points.layout import COLOURS, Layout, Records

Getter = Callable[[Records], NDArray[Any]]

RENAMED = {theirs: common for common, theirs in pcl.NAMES.items()}


def _element(name: str, index: int, block: Records) -> NDArray[Any]:
    column: NDArray[Any] = block[name].reshape(len(block), -1)[:, index]
    return column


def scale_colour(getter: Getter, target: np.dtype[Any], block: Records) -> NDArray[Any]:
    """A colour in the range of `target`; one outside the range becomes the nearest within."""
    colour = getter(block)
    if np.dtype(np.uint16) not in (colour.dtype, target) and target.kind != "u":
        return colour
    factor = (257.0 if target == np.uint16 else 1.0) / (257.0 if colour.dtype == np.uint16 else 1.0)
    values = np.nan_to_num(colour * factor)
    limit = np.iinfo(target).max if target.kind in "ui" else np.inf
    return np.rint(values).clip(0, limit) if target.kind in "ui" else values


def with_colours(layout: Layout, *kinds: type[np.unsignedinteger[Any]]) -> Layout:
    """The layout with red, green and blue of one of `kinds`, the first unless they are already of one of them."""
    names = layout.dtype.names or ()
    if not set(COLOURS) <= set(names) or all(layout.dtype[name] in kinds for name in COLOURS):
        return layout
    types = [(name, np.dtype(kinds[0]) if name in COLOURS else layout.dtype[name]) for name in names]
    return Layout.of(np.dtype(types))


def common_columns(layout: Layout) -> dict[str, tuple[np.dtype[Any], Getter]]:
    """Each column by its common name: native type, and a function that takes it from a block."""
    columns: dict[str, tuple[np.dtype[Any], Getter]] = {}
    for name in layout.dtype.names or ():
        base, shape = layout.dtype[name].subdtype or (layout.dtype[name], ())
        kind = np.dtype(float) if base.kind in "iu" and base.itemsize == 8 else base.newbyteorder("=")
        kind = np.dtype(np.uint8) if kind.kind == "b" else kind
        if PADDING.fullmatch(name):
            continue
        if name in ("rgb", "rgba") and base.itemsize == 4 and base.isnative and not shape:
            columns |= {colour: (np.dtype(np.uint8), partial(pcl.unpack_colour, name, colour)) for colour in pcl.SHIFTS}
        elif shape:
            count = int(np.prod(shape, dtype=int))
            columns |= {f"{name}_{index}": (kind, partial(_element, name, index)) for index in range(count)}
        else:
            columns[RENAMED.get(name, name)] = (kind, itemgetter(name))
    return columns


def common_layout(layouts: Iterable[Layout]) -> tuple[Layout, tuple[str, ...]]:
    """Columns common to all layouts, each of its widest type, and the names of those that only some have."""
    tables = [common_columns(layout) for layout in layouts]
    shared = [name for name in tables[0] if all(name in table for table in tables)]
    dtype = np.dtype([(name, np.result_type(*(table[name][0] for table in tables))) for name in shared])
    lost = sorted({name for table in tables for name in table} - set(shared))
    return Layout.of(dtype), tuple(lost)


@dataclass(frozen=True)
class Conversion:
    """Converts blocks of one layout to another by common names."""

    layout: Layout
    getters: tuple[tuple[str, Getter], ...]

    @classmethod
    def between(cls, source: Layout, target: Layout) -> "Conversion":
        """`target` must hold common names that `source` has."""
        columns = common_columns(source)
        getters = {name: columns[name][1] for name in target.dtype.names or ()}
        for name in set(COLOURS) & set(getters):
            if columns[name][0] != target.dtype[name]:
                getters[name] = partial(scale_colour, getters[name], target.dtype[name])
        return cls(target, tuple(getters.items()))

    def convert(self, block: Records) -> Records:
        out = np.empty(len(block), self.layout.dtype)
        for name, getter in self.getters:
            out[name] = getter(block)
        return out

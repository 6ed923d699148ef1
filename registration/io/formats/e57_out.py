"""Writes new E57 files (ASTM E2807) in blocks through pye57's libE57: one scan, lengths in metres as required."""

import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from registration.errors import CloudUnsupported
from registration.io.durable_file import GuardedFile
from registration.io.formats.extras import COLUMNS, library
from registration.points.layout import COLOURS, Layout, Records

BLOCK_POINTS = 1 << 16
METRES = 1e-3
FIELDS = {common: theirs for theirs, common in COLUMNS.items()}


def e57_layout(layout: Layout) -> Layout:
    """Columns the standard has names for: coordinates, 8-bit colours, intensity."""
    kinds = {name: layout.dtype[name] for name in layout.dtype.names or ()}
    coloured = all(kinds.get(each) == np.uint8 for each in COLOURS)
    names = [*layout.xyz, *(COLOURS if coloured else ()), *(["intensity"] if "intensity" in kinds else [])]
    return Layout.of(np.dtype([(name, kinds[name]) for name in names]))


class E57Out:
    """Writes blocks of the supported columns."""

    def __init__(self, file: Any, pye57: Any, layout: Layout, name: str) -> None:
        self._lib, self._image, self._name = pye57.libe57, file.image_file, name
        self._columns = list(e57_layout(layout).dtype.names or ())
        self._xyz = layout.xyz
        self._bounded = [*layout.xyz, *({"intensity"} & set(self._columns))]
        self._least, self._most = (np.full(len(self._bounded), each) for each in (np.inf, -np.inf))
        self._scan = self._lib.StructureNode(self._image)
        self._set(self._scan, "guid", f"{{{uuid.UUID(int=0)}}}")
        self._set(self._scan, "name", "frame base")
        self._arrays, buffers = file.make_buffers([FIELDS[each] for each in self._columns], BLOCK_POINTS)
        points = self._lib.CompressedVectorNode(self._image, self._prototype(), self._lib.VectorNode(self._image, True))
        self._scan.set("points", points)
        file.data3d.append(self._scan)
        self._writer = points.writer(buffers)

    def write(self, block: Records) -> None:
        """Write a block. Raises CloudUnsupported for points that are not finite."""
        for start in range(0, len(block), BLOCK_POINTS):
            piece = block[start : start + BLOCK_POINTS]
            for axis, name in enumerate(self._bounded):
                self._least[axis] = min(self._least[axis], piece[name].min())
                self._most[axis] = max(self._most[axis], piece[name].max())
            if not np.isfinite([self._least[:3], self._most[:3]]).all():
                raise CloudUnsupported(self._name, "points", "E57 holds only finite points", "write a PLY")
            for name in self._columns:
                self._arrays[FIELDS[name]][: len(piece)] = piece[name] * (METRES if name in self._xyz else 1)
            self._writer.write(len(piece))

    def finish(self) -> None:
        self._writer.close()
        least, most = (np.where(np.isfinite(each), each, 0.0).tolist() for each in (self._least, self._most))
        bounds = {name: (least[axis] * METRES, most[axis] * METRES) for axis, name in enumerate("xyz")}
        self._limit("cartesianBounds", bounds)
        if "intensity" in self._bounded:
            self._limit("intensityLimits", {"intensity": (least[3], most[3])})
        if "red" in self._columns:
            self._limit("colorLimits", {FIELDS[name]: (0.0, 255.0) for name in COLOURS})

    def _limit(self, node: str, within: Mapping[str, tuple[float, float]]) -> None:
        """The least and the largest value of columns, by which readers scale them."""
        limits = self._lib.StructureNode(self._image)
        for name, (least, most) in within.items():
            self._set(limits, f"{name}Minimum", least)
            self._set(limits, f"{name}Maximum", most)
        self._scan.set(node, limits)

    def _prototype(self) -> Any:
        prototype = self._lib.StructureNode(self._image)
        for name in self._columns:
            whole = name in COLOURS
            node = self._lib.IntegerNode(self._image, 0, 0, 255) if whole else self._lib.FloatNode(self._image, 0.0)
            prototype.set(FIELDS[name], node)
        return prototype

    def _set(self, parent: Any, name: str, value: str | float) -> None:
        kind = self._lib.StringNode if isinstance(value, str) else self._lib.FloatNode
        parent.set(name, kind(self._image, value))


@contextmanager
def e57_out(file: GuardedFile, layout: Layout) -> Iterator[Callable[[Records], None]]:
    """What writes a block, through libE57 to the file's path. Raises CloudUnsupported when pye57 is not installed."""
    pye57 = library("pye57", "e57", file.name)
    image = pye57.E57(str(file.raw.name), mode="w")
    try:
        out = E57Out(image, pye57, layout, file.name)
        yield out.write
        out.finish()
    finally:
        image.close()

"""A voxel grid of any size: what does not fit into memory waits on the disk, in files by ranges of cubes.

Up to `most_cells` cubes are averaged in memory. When there are more, the sums so far and all later points are written
to one file for each range of cubes, and every range is averaged on its own at the end, divided again where it is
still too large. The points of a cube are added in the order of their arrival either way, so the result has the same
bits. Each point is written and read once for each division: the time is proportional to the points.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Self

import numpy as np
from numpy.typing import NDArray

from registration.errors import CloudIOError
from registration.points.hash_index import Keys
from registration.points.layout import Array, Layout, Records
from registration.points.voxel_grid import VoxelGrid

MOST_CELLS = 1 << 22
"""Cubes in memory, about 150 bytes each: 0.6 GB."""

RANGE_BITS = 6
"""The cubes that are known at a division are parted into 2^6 ranges, or a few less."""

MOST_RANGES = 4096
"""Ranges on both sides of the known ones; farther cubes belong to the outermost."""

BLOCK_POINTS = 1 << 18


class LargeVoxelGrid:
    """Averages as VoxelGrid does; `folder` holds the files while they are needed. To be used in a `with` statement."""

    def __init__(self, edge_mm: float, layout: Layout, folder: Path, most_cells: int = MOST_CELLS) -> None:
        self.layout = layout
        self.edge_mm, self._folder, self._most_cells = edge_mm, folder, most_cells
        self._grid = VoxelGrid(edge_mm, layout)
        self._ranges: _Ranges | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._ranges is not None:
            self._ranges.remove()

    def add(self, block: Records) -> None:
        """Add a block. Raises ScanError when points are too far away for the edge length, CloudIOError."""
        for start in range(0, len(block), BLOCK_POINTS):
            points, keys = self._grid.locate(block[start : start + BLOCK_POINTS])
            if self._ranges is not None:
                self._ranges.append(points, keys)
                continue
            self._grid.add_located(points, keys)
            if len(self._grid) > self._most_cells:
                self._divide()

    def _divide(self) -> None:
        keys, sums = self._grid.sums()
        self._grid = VoxelGrid(self.edge_mm, self.layout)
        self._ranges = _Ranges(self._folder, self.layout, keys)
        self._ranges.start(keys, sums)

    def blocks(self) -> Iterator[Records]:
        """The averages in the order of their cubes. Raises CloudIOError."""
        if self._ranges is None:
            yield from self._grid.blocks()
            return
        for number in self._ranges.numbers():
            with LargeVoxelGrid(self.edge_mm, self.layout, self._ranges.folder, self._most_cells) as grid:
                for keys, sums in self._ranges.take_sums(number):
                    grid._grid.restore(keys, sums)
                for block in self._ranges.take_points(number):
                    grid.add(block)
                yield from grid.blocks()


class _Ranges:
    """Sums and points in files by ranges of equally many keys, numbered in the keys' order."""

    def __init__(self, folder: Path, layout: Layout, known: Keys) -> None:
        """`known`: keys in their order, by which the ranges are chosen."""
        self._layout = layout
        self._shift = max(int(known[-1] - known[0]).bit_length() - RANGE_BITS, 0)
        self._first = (int(known[0]) >> self._shift) - MOST_RANGES // 2
        with _named_errors(folder, "created"):
            self._temporary = TemporaryDirectory(prefix=".merging-", dir=folder, ignore_cleanup_errors=True)
        self.folder = Path(self._temporary.name)
        self._found: set[int] = set()

    def remove(self) -> None:
        self._temporary.cleanup()

    def numbers(self) -> list[int]:
        """The ranges in which there are cubes, in their order."""
        return sorted(self._found)

    def start(self, keys: Keys, sums: Array) -> None:
        """Write the sums of cubes in the order of their keys."""
        for number, piece in self._pieces(keys):
            with _named_errors(self.folder, "written"):
                np.savez(self.folder / f"{number}.npz", keys=keys[piece], sums=sums[:, piece])

    def append(self, points: Records, keys: Keys) -> None:
        """Write points behind those that arrived before."""
        order = np.argsort(keys >> self._shift, kind="stable")
        points, keys = points[order], keys[order]
        for number, piece in self._pieces(keys):
            with _named_errors(self.folder, "written"), (self.folder / f"{number}.points").open("ab") as file:
                file.write(np.ascontiguousarray(points[piece]).view(np.uint8).data)

    def _pieces(self, keys: Keys) -> Iterator[tuple[int, slice]]:
        """The ranges of keys that are sorted by range, and where each one's are."""
        numbers: NDArray[np.int64] = np.clip((keys >> self._shift) - self._first, 0, MOST_RANGES)
        starts = np.flatnonzero(np.diff(numbers, prepend=-1))
        for start, end in zip(starts, [*starts[1:], len(numbers)], strict=True):
            self._found.add(int(numbers[start]))
            yield int(numbers[start]), slice(start, end)

    def take_sums(self, number: int) -> Iterator[tuple[Keys, Array]]:
        """What was written by `start`, once."""
        file = self.folder / f"{number}.npz"
        if not file.exists():
            return
        with _named_errors(self.folder, "read"):
            with np.load(file) as arrays:
                keys, sums = arrays["keys"], arrays["sums"]
            file.unlink()
        yield keys, sums

    def take_points(self, number: int) -> Iterator[Records]:
        """What was written by `append`, in blocks, once."""
        file = self.folder / f"{number}.points"
        if not file.exists():
            return
        with _named_errors(self.folder, "read"), file.open("rb") as source:
            while content := source.read(BLOCK_POINTS * self._layout.dtype.itemsize):
                yield np.frombuffer(content, self._layout.dtype)
        file.unlink()


@contextmanager
def _named_errors(folder: Path, verb: str) -> Iterator[None]:
    """An OSError becomes a CloudIOError that names the folder."""
    try:
        yield
    except OSError as error:
        what = f"temporary files of the merge cannot be {verb} ({error.strerror})"
        raise CloudIOError(folder.name, "folder", what, "check rights and free space, or use larger voxels") from None

"""A voxel grid: the points of a cube are replaced by their average, which merges overlapping views.

Memory grows with the occupied cubes, not with the points; `registration/fusion/large_grid.py` bounds it.
"""

from collections.abc import Iterator

import numpy as np

from registration.errors import ScanError
from registration.points.hash_index import CellIndex, Keys
from registration.points.layout import Array, Layout, Records

CELLS = 1 << 20
"""Cubes along each axis on either side of the origin."""

AXIS_BITS = 21
"""Of a key, for each axis: cubes on both sides of the origin."""

BLOCK_POINTS = 1 << 15


class VoxelGrid:
    """Averages every column; normals keep unit length. Non-finite points are dropped.

    Each cube's points are added in order of arrival, so the result does not depend on the blocks. `most`: as soon as
    there are more cubes, their edge is doubled, so that memory stays bounded for a part of any size.
    """

    def __init__(self, edge_mm: float, layout: Layout, most: int | None = None) -> None:
        if not 0 < edge_mm < np.inf:
            raise ScanError(
                f"a voxel of {edge_mm} mm is too small", "give an edge above 0 mm, such as the points' spacing"
            )
        self.edge_mm = edge_mm
        self._most = most
        self.layout = layout
        self._names = layout.dtype.names or ()
        self._cells = CellIndex()
        self._sums = np.zeros((len(self._names) + 1, 0))

    def __len__(self) -> int:
        return len(self._cells)

    def add(self, block: Records) -> None:
        """Add a block. Raises ScanError when points are too far away for the edge length."""
        for start in range(0, len(block), BLOCK_POINTS):
            self.add_located(*self.locate(block[start : start + BLOCK_POINTS]))

    def locate(self, block: Records) -> tuple[Records, Keys]:
        """The finite points of a block and the key of each one's cube. Raises ScanError for points too far away."""
        finite = self.layout.finite(block)
        block = block if finite.all() else block[finite]
        return block, self._keys({name: block[name].astype(float) for name in self.layout.xyz})

    @np.errstate(all="ignore")  # sums of extreme values are infinite
    def add_located(self, block: Records, keys: Keys) -> None:
        """Add finite points whose cubes are known."""
        cells = self._cells.numbers(keys)
        self._make_room()
        columns = [*(block[name].astype(float) for name in self._names), np.ones(len(cells))]
        for sums, column in zip(self._sums, columns, strict=True):
            np.add.at(sums, cells, column)
        while self._most is not None and len(self) > self._most:
            self._double_edge()

    def _double_edge(self) -> None:
        """Join the eight cubes of each cube of twice the edge."""
        keys, coarse = self._cells.keys, np.zeros(len(self), np.int64)
        for shift in (2 * AXIS_BITS, AXIS_BITS, 0):
            index = ((keys >> shift) & (2 * CELLS - 1)) - CELLS
            coarse = (coarse << AXIS_BITS) | ((index >> 1) + CELLS)
        fine = self._sums[:, : len(keys)]
        self.edge_mm *= 2
        self._cells = CellIndex()
        joined = self._cells.numbers(coarse)
        self._sums = np.zeros((len(fine), len(self._cells)))
        for sums, column in zip(self._sums, fine, strict=True):
            np.add.at(sums, joined, column)

    def sums(self) -> tuple[Keys, Array]:
        """The keys (n,) of the occupied cubes in their order, and what their points add up to (columns and 1, n)."""
        order = np.argsort(self._cells.keys)
        return self._cells.keys[order], self._sums[:, order]

    def restore(self, keys: Keys, sums: Array) -> None:
        """Continue, in a grid without points, with what `sums` of another one said of some cubes."""
        cells = self._cells.numbers(keys)
        self._make_room()
        self._sums[:, cells] = sums

    @np.errstate(all="ignore")  # an infinite number of cubes is too many
    def _keys(self, columns: dict[str, Array]) -> Keys:
        """One key per cube: the numbers of the cubes along x, y and z, AXIS_BITS each."""
        indices = [np.floor(columns[name] / self.edge_mm) for name in self.layout.xyz]
        if any(len(index) and max(index.max(), -index.min()) >= CELLS for index in indices):
            raise ScanError(
                f"points lie more than {CELLS} voxels of {self.edge_mm} mm from the origin", "use larger voxels"
            )
        along_x, along_y, along_z = indices
        of_plane = along_y * (2 * CELLS) + along_z  # whole numbers below 2^53
        keys: Keys = along_x.astype(np.int64) << (2 * AXIS_BITS)
        return keys + (of_plane.astype(np.int64) + CELLS * ((1 << 2 * AXIS_BITS) + (1 << AXIS_BITS) + 1))

    def _make_room(self) -> None:
        have, need = self._sums.shape[1], len(self._cells)
        if need > have:
            grown = np.zeros((len(self._sums), max(need, 2 * have)))
            grown[:, :have] = self._sums
            self._sums = grown

    def blocks(self) -> Iterator[Records]:
        """The averages in the order of their cubes."""
        order = np.argsort(self._cells.keys)
        for start in range(0, len(order), BLOCK_POINTS):
            yield self._averages(self._sums[:, order[start : start + BLOCK_POINTS]])

    @np.errstate(all="ignore")
    def _averages(self, sums: Array) -> Records:
        means = sums[:-1] / sums[-1]
        block = np.empty(means.shape[1], self.layout.dtype)
        if self.layout.normals:
            at = [self._names.index(name) for name in self.layout.normals]
            length = np.linalg.norm(means[at], axis=0)
            means[at] /= np.where(length > 0, length, 1.0)
        for name, column in zip(self._names, means, strict=True):
            block[name] = np.rint(column) if self.layout.dtype[name].kind in "iu" else column
        return block

"""A voxel grid: the points of a cube are replaced by their average, which merges overlapping views.

Memory grows with the occupied cubes, not with the points.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from registration.errors import ScanError
from registration.points.hash_index import CellIndex
from registration.points.layout import Array, Layout, Records

CELLS = 1 << 20
"""Cubes along each axis on either side of the origin."""

BLOCK_POINTS = 1 << 15


class VoxelGrid:
    """Averages every column; normals keep unit length. Non-finite points are dropped.

    Each cube's points are added in order of arrival, so the result does not depend on the blocks.
    """

    def __init__(self, edge_mm: float, layout: Layout) -> None:
        if not 0 < edge_mm < np.inf:
            raise ScanError(
                f"a voxel of {edge_mm} mm is too small", "give an edge above 0 mm, such as the points' spacing"
            )
        self._edge_mm = edge_mm
        self.layout = layout
        self._names = layout.dtype.names or ()
        self._cells = CellIndex()
        self._sums = np.zeros((len(self._names) + 1, 0))

    def __len__(self) -> int:
        """Number of occupied cubes."""
        return len(self._cells)

    def add(self, block: Records) -> None:
        """Add a block. Raises ScanError when points are too far away for the edge length."""
        for start in range(0, len(block), BLOCK_POINTS):
            self._add(block[start : start + BLOCK_POINTS])

    @np.errstate(all="ignore")  # sums of extreme values are infinite
    def _add(self, block: Records) -> None:
        columns = {name: block[name].astype(float) for name in self._names}
        finite = self.layout.finite(block)
        if not finite.all():
            columns = {name: column[finite] for name, column in columns.items()}
        cells = self._cells.numbers(self._keys(columns))
        self._make_room()
        for sums, column in zip(self._sums, [*columns.values(), np.ones(len(cells))], strict=True):
            np.add.at(sums, cells, column)

    def _keys(self, columns: dict[str, Array]) -> NDArray[np.int64]:
        """One key per cube."""
        keys: NDArray[np.int64] = np.zeros(len(columns[self.layout.xyz[0]]), np.int64)
        for name in self.layout.xyz:
            index = np.floor(columns[name] / self._edge_mm)
            if len(index) and np.abs(index).max() >= CELLS:
                raise ScanError(
                    f"points lie more than {CELLS} voxels of {self._edge_mm} mm from the origin", "use larger voxels"
                )
            keys = (keys << 21) | (index.astype(np.int64) + CELLS)
        return keys

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

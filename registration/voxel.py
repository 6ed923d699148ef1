"""A voxel grid: all points of a cube become their average, so that what several views saw is there once.

Memory grows with the occupied cubes, not with the points.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from registration.errors import ScanError
from registration.layout import Array, Layout, Records

CELLS = 1 << 20
"""Cubes along each axis either side of the origin."""

BLOCK_POINTS = 1 << 15


class VoxelGrid:
    """Averages every column; normals keep unit length. Points that are not finite are left out."""

    def __init__(self, edge_mm: float, layout: Layout) -> None:
        if not 0 < edge_mm < np.inf:
            raise ScanError(f"a voxel of {edge_mm} mm is none", "give an edge above 0 mm, such as the points' spacing")
        self._edge_mm = edge_mm
        self._layout = layout
        self._names = layout.dtype.names or ()
        self._keys: list[NDArray[np.int64]] = []
        self._sums: list[Array] = []
        self._settled = 0

    def add(self, block: Records) -> None:
        columns = np.stack([block[name].astype(float) for name in self._names] + [np.ones(len(block))], axis=1)
        xyz = np.stack([block[name].astype(float) for name in self._layout.xyz], axis=1)
        finite = np.isfinite(xyz).all(axis=1)
        cells = np.floor(xyz[finite] / self._edge_mm)
        if len(cells) and np.abs(cells).max() >= CELLS:
            raise ScanError(
                f"points lie more than {CELLS} voxels of {self._edge_mm} mm from the origin", "use larger voxels"
            )
        index = cells.astype(np.int64) + CELLS
        self._keys.append((index[:, 0] << 42) | (index[:, 1] << 21) | index[:, 2])
        self._sums.append(columns[finite])
        if sum(map(len, self._keys)) > 2 * self._settled + 8 * BLOCK_POINTS:
            self._settle()

    def blocks(self) -> Iterator[Records]:
        """The averages, in the order of their cubes."""
        self._settle()
        sums = self._sums[0] if self._sums else np.empty((0, len(self._names) + 1))
        for start in range(0, len(sums), BLOCK_POINTS):
            piece = sums[start : start + BLOCK_POINTS]
            yield self._averages(piece[:, :-1] / piece[:, -1:])

    def _averages(self, means: Array) -> Records:
        block = np.empty(len(means), self._layout.dtype)
        if self._layout.normals:
            at = [self._names.index(name) for name in self._layout.normals]
            length = np.linalg.norm(means[:, at], axis=1, keepdims=True)
            means[:, at] /= np.where(length > 0, length, 1.0)
        for name, column in zip(self._names, means.T, strict=True):
            block[name] = np.rint(column) if self._layout.dtype[name].kind in "iu" else column
        return block

    def _settle(self) -> None:
        """One row for each cube."""
        if not self._keys:
            return
        keys, sums = np.concatenate(self._keys), np.concatenate(self._sums)
        order = np.argsort(keys)
        ordered = keys[order]
        first = np.ones(len(keys), bool)
        first[1:] = ordered[1:] != ordered[:-1]
        cell = np.empty(len(keys), np.intp)
        cell[order] = np.cumsum(first) - 1
        self._keys = [ordered[first]]
        # bincount adds in the order the points came, so the bits do not depend on the sort
        self._sums = [np.stack([np.bincount(cell, column) for column in sums.T], axis=1) if len(keys) else sums]
        self._settled = len(self._keys[0])

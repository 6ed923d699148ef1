"""Merges views into one cloud: every point, or one per voxel with outliers removed and normals added.

Overlapping views are blended to the average of their points per voxel. Outliers and normals are computed from these
averages, since a search tree over all points would not fit into memory.
"""

from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import scipy
from numpy.typing import NDArray

from registration.errors import ScanError
from registration.fusion.large_grid import MOST_CELLS, LargeVoxelGrid
from registration.points.layout import Array, Layout, Records
from registration.points.surface import NEIGHBOURS, planes_of
from registration.points.voxel_grid import VoxelGrid

Outliers = Literal["keep", "statistical", "radius"]

MAX_DEVIATIONS = 2.0
"""Statistical (Rusu, Semantic 3D Object Maps, 2009, 4.1): limit of the mean neighbour distance, in deviations."""

RADIUS_EDGES, MIN_NEIGHBOURS = 3.0, 4
"""Radius: minimum number of other points within this many voxel edges; a surface has about 28 there."""

QUERY_POINTS = 1 << 16
BLOCK_POINTS = 1 << 15

CAMERA = ("camera x", "camera y", "camera z")
"""Averaged with a voxel's points: the camera's position, which normals are directed towards."""

NORMALS = ("nx", "ny", "nz")


Corner = tuple[float, float, float]
Box = tuple[Corner, Corner]
"""Least and largest x, y, z in base."""


MIN_MOST = 8
"""However large voxels are, eight of them meet at the origin."""


@dataclass(frozen=True)
class Merge:
    """Settings of a merge. `voxel_mm` None keeps every point; `box_mm`: only points within it; `most`: the voxels' edge
    is doubled until there are no more points than that. Raises ScanError."""

    voxel_mm: float | None = None
    normals: bool = False
    outliers: Outliers = "keep"
    box_mm: Box | None = None
    most: int | None = None

    def __post_init__(self) -> None:
        if self.outliers not in get_args(Outliers):
            raise ScanError(f"outliers cannot be {self.outliers!r}", f"say one of {', '.join(get_args(Outliers))}")
        if self.voxel_mm is None and (self.normals or self.outliers != "keep"):
            what = "normals and outliers are judged on averaged points, but no voxel is stated"
            raise ScanError(what, "state its edge, about the points' spacing, such as 0.5 mm")
        if self.most is not None and self.most < MIN_MOST:
            raise ScanError(
                f"at most {self.most} points are wanted", f"want {MIN_MOST} or more: as many voxels meet at the origin"
            )
        if self.voxel_mm is None and self.most is not None:
            what = f"at most {self.most} points are wanted, but no voxel is stated"
            raise ScanError(what, "state the smallest edge, which is doubled until there are no more points")

    def layout(self, shared: Layout) -> Layout:
        """Layout of the merged cloud: measured normals are kept, otherwise fitted ones are added."""
        if not self.normals or shared.normals is not None:
            return shared
        return _with_columns(shared, NORMALS, "<f4")


EVERY_POINT = Merge()


@dataclass(eq=False)
class Merger:
    """Merges the views' blocks of `shared` columns; `left_out` counts the outliers, `edge_mm` is of the voxels.

    Averages of more than `most_cells` voxels are made on the disk, in `folder`, unless the merge limits their number.
    """

    merge: Merge
    shared: Layout
    folder: Path
    most_cells: int = MOST_CELLS
    left_out: int = field(default=0, init=False)
    averaged: int = field(default=0, init=False)
    edge_mm: float = field(default=0.0, init=False)

    @property
    def layout(self) -> Layout:
        return self.merge.layout(self.shared)

    def merge_views(self, views: Iterable[tuple[Iterable[Records], Array]]) -> Iterator[Records]:
        """The merged cloud. `views`: moved blocks, and the camera's position (3,) in mm. Raises ScanError."""
        if self.merge.voxel_mm is None:
            for blocks, _ in views:
                yield from blocks
            return
        fitted = self.layout != self.shared
        layout = _with_columns(self.shared, CAMERA, "f8") if fitted else self.shared
        with self._grid(self.merge.voxel_mm, layout) as grid:
            for blocks, camera_mm in views:
                for block in blocks:
                    grid.add(_with_camera_position(camera_mm, block, layout) if fitted else block)
            if not fitted and self.merge.outliers == "keep":
                yield from grid.blocks()
                return
            averages = np.concatenate([*grid.blocks(), np.empty(0, layout.dtype)])
            self.edge_mm = grid.edge_mm
        yield from self._finish(averages)

    def _grid(self, voxel_mm: float, layout: Layout) -> AbstractContextManager[VoxelGrid | LargeVoxelGrid]:
        if self.merge.most is not None:
            return nullcontext(VoxelGrid(voxel_mm, layout, self.merge.most))
        return LargeVoxelGrid(voxel_mm, layout, self.folder, self.most_cells)

    def _finish(self, cloud: Records) -> Iterator[Records]:
        points = np.stack([cloud[name].astype(float) for name in self.shared.xyz], axis=1)
        kept = self._has_neighbours(points)
        self.averaged, self.left_out = len(points), int(len(points) - np.count_nonzero(kept))
        cloud, points = cloud[kept], points[kept]
        tree = scipy.spatial.cKDTree(points)
        for start in range(0, len(points), BLOCK_POINTS):
            piece = slice(start, start + BLOCK_POINTS)
            block = np.empty(len(cloud[piece]), self.layout.dtype)
            for name in self.shared.dtype.names or ():
                block[name] = cloud[name][piece]
            if self.layout != self.shared:
                camera = np.stack([cloud[name][piece] for name in CAMERA], axis=1)
                for name, column in zip(NORMALS, _normals(tree, points[piece], camera).T, strict=True):
                    block[name] = column
            yield block

    def _has_neighbours(self, points: Array) -> NDArray[np.bool_]:
        """Which points have enough others around them."""
        least = 1 if self.merge.outliers == "radius" else 2
        if self.merge.outliers == "keep" or len(points) < least:
            return np.ones(len(points), bool)
        tree = scipy.spatial.cKDTree(points)
        if self.merge.outliers == "radius":
            within = RADIUS_EDGES * self.edge_mm
            distances = _distances(tree, points, MIN_NEIGHBOURS, within)
            return np.isfinite(distances[:, -1])
        distances = _distances(tree, points, min(NEIGHBOURS, len(points) - 1)).mean(axis=1)
        return np.asarray(distances <= distances.mean() + MAX_DEVIATIONS * distances.std(), bool)


def _with_columns(layout: Layout, names: Iterable[str], kind: str) -> Layout:
    columns: list[tuple[str, Any]] = [(name, layout.dtype[name]) for name in layout.dtype.names or ()]
    return Layout.of(np.dtype([*columns, *((name, kind) for name in names)]))


def _with_camera_position(camera_mm: Array, block: Records, layout: Layout) -> Records:
    seen = np.empty(len(block), layout.dtype)
    for name in block.dtype.names or ():
        seen[name] = block[name]
    for name, value in zip(CAMERA, camera_mm, strict=True):
        seen[name] = value
    return seen


def _distances(tree: "scipy.spatial.cKDTree", points: Array, count: int, within: float = np.inf) -> Array:
    """Distances (n, count) to the nearest others, infinite where there are none."""
    found = [
        tree.query(points[start : start + QUERY_POINTS], count + 1, distance_upper_bound=within)[0][:, 1:]
        for start in range(0, len(points), QUERY_POINTS)
    ]
    return np.concatenate(found)


def _normals(tree: "scipy.spatial.cKDTree", points: Array, camera: Array) -> Array:
    """Normals (n, 3) of planes through each point's neighbours, towards the camera; alone, towards the camera."""
    sight = camera - points
    lengths = np.linalg.norm(sight, axis=1, keepdims=True)
    sight /= np.where(lengths > 0, lengths, 1.0)
    count = min(NEIGHBOURS, tree.n)
    if count < 3:
        return sight
    _, neighbours = tree.query(points, count)
    normals, _ = planes_of(tree.data[neighbours])
    turned: Array = np.where(np.sum(normals * sight, axis=1, keepdims=True) < 0, -normals, normals)
    return turned

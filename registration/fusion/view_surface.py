"""One view of a scan as a surface: averaged points, their normals, and how far they lie from the other views."""

from collections.abc import Callable, Sequence

import numpy as np
import scipy

from registration.fusion.concatenation import FiniteBlocks, OnProgress, PlacedCloud, bytes_of
from registration.fusion.merging import NORMALS, Box, Merge, Merger
from registration.points.layout import XYZ_FLOAT32, Array, Records
from registration.points.surface import NEIGHBOURS, planes_of
from registration.points.voxel_grid import VoxelGrid

SURFACE = np.dtype([(name, "<f4") for name in ("x", "y", "z", "deviation", *NORMALS)])
"""A point in base, mm; `deviation` in mm, positive towards the view's camera, NaN where no other view is near."""

NEAR_EDGES = 3.0
"""Another view is near when one of its averaged points lies within this many voxel edges."""

BLOCK_POINTS = 1 << 15

READING = 0.8
"""Share of the work that is done when every view is read."""


def view_surface(
    clouds: Sequence[PlacedCloud],
    view: int,
    voxel_mm: float,
    box_mm: Box | None = None,
    stopped: Callable[[], bool] = lambda: False,
    on_progress: OnProgress = lambda share: None,
) -> Records:
    """The points of `clouds[view]` as SURFACE records (n,). Memory grows with the occupied voxels, not with the points.

    `on_progress` is called with the share that is done. Raises RegistrationError's leaves, MergeStopped.
    """
    own_bytes, share_of_byte = bytes_of([clouds[view]]), READING / max(bytes_of(clouds), 1)
    cloud, merge = clouds[view], Merge(voxel_mm, normals=True, box_mm=box_mm)
    merger = Merger(merge, XYZ_FLOAT32, cloud.file.parent)
    blocks = FiniteBlocks(XYZ_FLOAT32, stopped, box_mm, lambda read: on_progress(read * share_of_byte)).read(cloud)
    averages = merger.merge_views([(blocks, cloud.base_T_cloud[:3, 3])])
    own = np.concatenate([*averages, np.empty(0, merger.layout.dtype)])
    found = np.empty(len(own), SURFACE)
    for name in own.dtype.names or ():
        found[name] = own[name]
    points, normals = (np.stack([found[name] for name in names], axis=1) for names in (XYZ_FLOAT32.xyz, NORMALS))
    others = [cloud for index, cloud in enumerate(clouds) if index != view]
    points_of_others = _points_of(
        others, voxel_mm, box_mm, stopped, lambda read: on_progress((own_bytes + read) * share_of_byte)
    )
    found["deviation"] = _deviations(points, normals, points_of_others, voxel_mm, on_progress)
    return found


def _points_of(
    clouds: Sequence[PlacedCloud],
    voxel_mm: float,
    box_mm: Box | None,
    stopped: Callable[[], bool],
    on_read: OnProgress,
) -> Array:
    """The averaged points (n, 3) of all these clouds, also of those a little outside the box."""
    grid = VoxelGrid(voxel_mm, XYZ_FLOAT32)
    grown, margin_mm = None, NEAR_EDGES * voxel_mm
    if box_mm is not None:
        (x, y, z), (to_x, to_y, to_z) = np.array(box_mm[0]) - margin_mm, np.array(box_mm[1]) + margin_mm
        grown = ((x, y, z), (to_x, to_y, to_z))
    blocks = FiniteBlocks(XYZ_FLOAT32, stopped, grown, on_read)
    for cloud in clouds:
        for block in blocks.read(cloud):
            grid.add(block)
    found = np.concatenate([*grid.blocks(), np.empty(0, XYZ_FLOAT32.dtype)])
    return np.stack([found[name].astype(float) for name in XYZ_FLOAT32.xyz], axis=1)


def _deviations(points: Array, normals: Array, others: Array, voxel_mm: float, on_progress: OnProgress) -> Array:
    """Signed distances (n,) from the planes through the nearest points of the others, along the own normal."""
    found = np.full(len(points), np.nan)
    count = min(NEIGHBOURS, len(others))
    if count < 3:
        return found
    tree = scipy.spatial.cKDTree(others)
    for start in range(0, len(points), BLOCK_POINTS):
        piece = slice(start, start + BLOCK_POINTS)
        distances, neighbours = tree.query(points[piece], count)
        patches = others[neighbours]
        planes, _ = planes_of(patches)
        planes = np.where(np.sum(planes * normals[piece], axis=1, keepdims=True) < 0, -planes, planes)
        offsets = np.sum((points[piece] - patches.mean(axis=1)) * planes, axis=1)
        found[piece] = np.where(distances[:, 0] <= NEAR_EDGES * voxel_mm, offsets, np.nan)
        on_progress(READING + (1 - READING) * min(start + BLOCK_POINTS, len(points)) / len(points))
    return found

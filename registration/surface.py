"""A view as a surface: a bounded number of points with normals, and a search tree."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from calibration.transforms import Array
from registration.layout import Layout, Records

POINT_LIMIT = 30_000
"""Points of one view that are kept; more say nothing new about six numbers."""

NEIGHBOURS = 14
"""Points a normal is fitted to."""


@dataclass(frozen=True, eq=False)
class Surface:
    """`points` (n, 3) in mm and unit `normals` (n, 3), both in the camera's frame; `spacing_mm` between neighbours."""

    points: Array
    normals: Array
    spacing_mm: float
    tree: cKDTree

    @classmethod
    def of(cls, points: Array) -> "Surface":
        """Normals by the plane through each point's neighbours, turned towards the camera."""
        tree = cKDTree(points)
        count = min(NEIGHBOURS, len(points))
        distances, neighbours = tree.query(points, k=max(count, 2))
        patches = points[np.minimum(neighbours, max(len(points) - 1, 0))]
        patches = patches - patches.mean(axis=1, keepdims=True)
        _, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", patches, patches))
        normals: Array = vectors[:, :, 0]
        normals = np.where(np.sum(normals * points, axis=1, keepdims=True) > 0, -normals, normals)
        finite = distances[:, 1][np.isfinite(distances[:, 1])]
        return cls(points, normals, float(np.median(finite)) if len(finite) else 1.0, tree)


class PointSample:
    """An even sample of the finite points that pass by, at most `limit`, in the order they come."""

    def __init__(self, scale_to_mm: float, limit: int = POINT_LIMIT) -> None:
        self._scale = scale_to_mm
        self._limit = limit
        self._stride = 1
        self._seen = 0
        self._kept: list[Array] = []

    def add(self, block: Records, layout: Layout) -> None:
        """Take every `stride`-th point; the stride doubles whenever twice the limit is held."""
        start = -self._seen % self._stride
        self._seen += len(block)
        chosen = block[start :: self._stride]
        points = np.stack([chosen[name].astype(float) for name in layout.xyz], axis=1) * self._scale
        self._kept.append(points)
        if sum(map(len, self._kept)) > 2 * self._limit:
            self._kept = [np.concatenate(self._kept)[::2]]
            self._stride *= 2

    def points(self) -> Array:
        """(n, 3) in mm."""
        points = np.concatenate(self._kept) if self._kept else np.empty((0, 3))
        points = points[np.isfinite(points).all(axis=1)]
        step = -(-len(points) // self._limit) or 1
        return points[::step]


def sample_points(blocks: Iterable[Records], layout: Layout, scale_to_mm: float, limit: int = POINT_LIMIT) -> Array:
    """(n, 3) in mm of at most `limit` points, spread over the whole cloud."""
    sample = PointSample(scale_to_mm, limit)
    for block in blocks:
        sample.add(block, layout)
    return sample.points()

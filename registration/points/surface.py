"""A view as a surface: a bounded number of points with normals, and a search tree."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from calibration.transforms import Array
from registration.points.layout import Layout, Records

POINT_LIMIT = 30_000
"""Points kept per view; more would not improve six parameters."""

LEAST_LIMIT, ALL_POINTS = 10_000, 3_000_000
"""Per view, and of all views together, where these are only compared; each takes about 80 bytes."""

MAX_RANGE_MM = 1e6
"""1 km: no scanner of parts measures as far; such coordinates stand for "no measurement"."""

NEIGHBOURS = 14
"""Number of points a normal is fitted to."""

CORRELATED_POINTS = 12.0
"""Neighbouring points share their error: this many count as one."""

MAX_LINE_RATIO = 0.02
"""A neighbourhood whose middle variance is below this share of its largest is a line and gets no normal."""


@dataclass(frozen=True, eq=False)
class Surface:
    """`points` (n, 3) in mm and unit `normals` (n, 3), both in the camera frame; `spacing_mm` between neighbours."""

    points: Array
    normals: Array
    spacing_mm: float
    tree: "scipy.spatial.cKDTree"

    @classmethod
    def of(cls, points: Array) -> "Surface":
        """Normals from the plane through each point's neighbours, directed towards the camera.

        Points whose neighbours lie on a line are dropped. `spacing_mm` is that of a square lattice as dense as the
        surface, independent of the order of points.
        """
        count = min(NEIGHBOURS, len(points))
        if count < 3:
            return cls(points, np.zeros_like(points), 1.0, scipy.spatial.cKDTree(points))
        distances, neighbours = scipy.spatial.cKDTree(points).query(points, k=count)
        normals, spreads = planes_of(points[neighbours])
        normals = np.where(np.sum(normals * points, axis=1, keepdims=True) > 0, -normals, normals)
        kept = spreads[:, 1] > MAX_LINE_RATIO * spreads[:, 2]
        spacing_mm = float(np.median(distances[:, -1]) * np.sqrt(np.pi / (count - 1)))
        points = np.ascontiguousarray(points[kept])  # which the tree refers to
        return cls(points, normals[kept], spacing_mm or 1.0, scipy.spatial.cKDTree(points))


def planes_of(patches: Array) -> tuple[Array, Array]:
    """Normals (n, 3), of arbitrary sign, of planes through patches (n, k, 3), and the spreads (n, 3), ascending."""
    patches = patches - patches.mean(axis=1, keepdims=True)
    spreads, vectors = np.linalg.eigh(patches.transpose(0, 2, 1) @ patches)
    return vectors[:, :, 0], spreads


class PointSample:
    """A sample of at most `limit` points of a stream within MAX_RANGE_MM, in order.

    Chosen by a hash of their index: every n-th point of a scanner's raster would form stripes, to which no normal can
    be fitted.
    """

    def __init__(self, scale_to_mm: float, limit: int = POINT_LIMIT) -> None:
        self._scale = scale_to_mm
        self._limit = limit
        self._below = 1 << 32
        self._seen = 0
        self._kept: list[Array] = []
        self._hashes: list[NDArray[np.uint32]] = []

    def add(self, block: Records, layout: Layout) -> None:
        """Take the points with a small hash; its bound halves whenever twice the limit is held."""
        hashes = _hashes(self._seen, len(block))
        self._seen += len(block)
        chosen = np.flatnonzero(hashes < self._below)
        points = np.stack([block[name][chosen].astype(float) for name in layout.xyz], axis=1)
        near = (np.abs(points) <= MAX_RANGE_MM / self._scale).all(axis=1)
        self._kept.append(points[near] * self._scale)
        self._hashes.append(hashes[chosen[near]])
        while sum(map(len, self._kept)) > 2 * self._limit:
            self._below >>= 1
            hashes = np.concatenate(self._hashes)
            small = hashes < self._below
            self._kept, self._hashes = [np.concatenate(self._kept)[small]], [hashes[small]]

    def points(self) -> Array:
        """The sample (n, 3) in mm."""
        if not self._kept:
            return np.empty((0, 3))
        points, hashes = np.concatenate(self._kept), np.concatenate(self._hashes)
        return points[np.sort(np.argsort(hashes, kind="stable")[: self._limit])]


def _hashes(start: int, count: int) -> NDArray[np.uint32]:
    """A pseudo-random number for each index: the finaliser of MurmurHash3 (Appleby)."""
    mixed = np.arange(start, start + count, dtype=np.uint64).astype(np.uint32)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35), (16, 1)):
        mixed ^= mixed >> np.uint32(shift)
        mixed *= np.uint32(factor)
    return mixed


def limit_of(views: int, *, refine: bool) -> int:
    """Points kept of each of so many views; all for a refinement, whose counterparts do not settle among fewer."""
    return POINT_LIMIT if refine else min(POINT_LIMIT, max(LEAST_LIMIT, ALL_POINTS // max(views, 1)))


def sample_points(blocks: Iterable[Records], layout: Layout, scale_to_mm: float, limit: int = POINT_LIMIT) -> Array:
    """A sample (n, 3) in mm of at most `limit` points, spread over the whole cloud."""
    sample = PointSample(scale_to_mm, limit)
    for block in blocks:
        sample.add(block, layout)
    return sample.points()

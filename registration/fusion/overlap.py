"""Agreement of overlapping views: distances along the normal from each point to the other's surface."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.transforms import Array, inverse, map_points
from registration.points.surface import Surface

MAX_GAP_MM = 4.0
"""Largest distance of a counterpart in mm (or four spacings): robots err by up to 2 mm."""

NORMAL_COSINE = 0.7
"""Surfaces that meet at more than 45 degrees are not taken for the same surface."""

MAX_LATERAL_SPACINGS = 1.5
"""Largest lateral offset of a counterpart in spacings; farther points lie beyond the surface's edge."""

MIN_PAIRS = 100
PROBE_LIMIT = 3_000
"""Points of one view that are compared with each other view."""


@dataclass(frozen=True, eq=False)
class Correspondences:
    """Points of one view and their counterparts on another, both in base: `gaps` (n,) along `normals` (n, 3) in mm.

    `fraction`: share of the probed points that have a counterpart.
    """

    points: Array
    normals: Array
    gaps: Array
    fraction: float

    @property
    def enough(self) -> bool:
        return len(self.gaps) >= MIN_PAIRS


def correspond(
    source: Surface, base_T_source: Array, target: Surface, base_T_target: Array, reach_mm: float
) -> Correspondences:
    """Counterparts of `source`'s points on `target`'s surface."""
    probes = slice(None, None, -(-len(source.points) // PROBE_LIMIT) or 1)
    target_T_source = inverse(base_T_target) @ base_T_source
    points = map_points(target_T_source, source.points[probes])
    normals = source.normals[probes] @ target_T_source[:3, :3].T
    distance, nearest = target.tree.query(points, distance_upper_bound=reach_mm)
    near = np.flatnonzero(np.isfinite(distance))
    opposite = target.normals[nearest[near]]
    offsets = points[near] - target.points[nearest[near]]
    gaps = np.sum(offsets * opposite, axis=1)
    beside = np.linalg.norm(offsets - gaps[:, None] * opposite, axis=1)
    same = np.sum(normals[near] * opposite, axis=1) > NORMAL_COSINE
    kept = same & (beside <= MAX_LATERAL_SPACINGS * target.spacing_mm)
    return Correspondences(
        map_points(base_T_target, points[near][kept]),
        opposite[kept] @ base_T_target[:3, :3].T,
        gaps[kept],
        float(kept.sum() / max(1, len(points))),
    )


@dataclass(frozen=True)
class Agreement:
    """`rms_mm` over all overlaps (None without one); per view its own RMS and the share seen by others."""

    rms_mm: float | None
    view_rms_mm: tuple[float | None, ...]
    view_overlap: tuple[float, ...]


def reach_of(surfaces: Sequence[Surface]) -> float:
    """Search radius of counterparts in mm."""
    return max(MAX_GAP_MM, 4 * max((surface.spacing_mm for surface in surfaces), default=1.0))


def pairs_within(surfaces: Sequence[Surface], poses: Sequence[Array], reach_mm: float) -> list[tuple[int, int]]:
    """Ordered pairs of views whose boxes in base are at most `reach_mm` apart along each axis; others cannot meet."""
    clouds = [map_points(pose, surface.points) for surface, pose in zip(surfaces, poses, strict=True)]
    low = np.array([cloud.min(axis=0, initial=np.inf) for cloud in clouds]).reshape(-1, 3)
    high = np.array([cloud.max(axis=0, initial=-np.inf) for cloud in clouds]).reshape(-1, 3)
    met = np.all(low[:, None] <= high[None] + reach_mm, axis=2)
    first, second = np.nonzero(met & met.T & ~np.eye(len(clouds), dtype=bool))
    return list(zip(first.tolist(), second.tolist(), strict=True))


def agreement(surfaces: Sequence[Surface], poses: Sequence[Array]) -> Agreement:
    """Point-to-plane deviations between all overlapping pairs of views at `poses` (base_T_camera)."""
    reach_mm = reach_of(surfaces)
    squares, counts = np.zeros(len(surfaces)), np.zeros(len(surfaces))
    overlap = np.zeros(len(surfaces))
    for index, other in pairs_within(surfaces, poses, reach_mm):
        pair = correspond(surfaces[index], poses[index], surfaces[other], poses[other], reach_mm)
        if pair.enough:
            squares[index] += float(pair.gaps @ pair.gaps)
            counts[index] += len(pair.gaps)
            overlap[index] = max(overlap[index], pair.fraction)
    rms = [float(np.sqrt(square / count)) if count else None for square, count in zip(squares, counts, strict=True)]
    whole = float(np.sqrt(squares.sum() / counts.sum())) if counts.any() else None
    return Agreement(whole, tuple(rms), tuple(overlap.tolist()))

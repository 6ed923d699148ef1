"""Fits a sphere in a cloud that also contains its stand, the table and stray points.

Candidate spheres through four points (RANSAC; Fischler and Bolles 1981), then robust least squares with Tukey's
weights.
"""

from dataclasses import dataclass

import numpy as np

from calibration.transforms import Array
from registration.errors import SphereError
from registration.points.surface import CORRELATED_POINTS

SAMPLES = 400
SCORED_POINTS = 3_000
MIN_POINTS = 100
MIN_SHARE = 0.15
MAX_ITERATIONS = 50
STEP_TOLERANCE_MM = 1e-6
RADIUS_TOLERANCE = 0.05
SIZE_TOLERANCE = 0.02
FREE_SIGMA = 0.005
"""A radius determined this well by the points (relative sigma) need not be fixed."""


@dataclass(frozen=True, eq=False)
class SphereFit:
    """`centre` (3,) with `covariance` (3, 3), `radius_mm`; `sigma_mm` of a point's distance; `used` (n,) bool."""

    centre: Array
    radius_mm: float
    radius_sigma_mm: float
    covariance: Array
    sigma_mm: float
    used: np.ndarray


def fit_sphere(points: Array, radius_mm: float | None = None) -> SphereFit:
    """Sphere on which most of `points` (n, 3) lie; its radius may be known. Raises SphereError."""
    points = points[np.isfinite(points).all(axis=1)]
    if radius_mm is not None and not 0 < radius_mm < np.inf:
        raise SphereError(f"a radius of {radius_mm} mm is not possible", "give the artefact's radius in mm")
    if len(points) < MIN_POINTS:
        raise SphereError(f"{len(points)} points are too few", f"scan at least {MIN_POINTS} points of the sphere")
    centre, radius, scale = _candidate(points, radius_mm)
    known = radius_mm is not None
    for _ in range(MAX_ITERATIONS):
        offsets = points - centre
        distance = np.maximum(np.linalg.norm(offsets, axis=1), 1e-9)
        gaps = distance - radius
        near = np.abs(gaps) < 3 * scale
        scale = max(1.4826 * float(np.median(np.abs(gaps[near]))), 1e-3) if near.any() else scale
        weights = np.clip(1 - (gaps / (4.685 * scale)) ** 2, 0, None) ** 2
        rows = np.hstack([-offsets / distance[:, None], -np.ones((len(points), 0 if known else 1))])
        information = (rows * weights[:, None]).T @ rows
        if np.linalg.cond(information) > 1e12:
            raise SphereError("the points lie too close together to fix a sphere", "scan more of the sphere")
        step = -np.linalg.solve(information, rows.T @ (weights * gaps))
        centre = centre + step[:3]
        radius = radius if known else radius + float(step[3])
        if np.abs(step).max() < STEP_TOLERANCE_MM:
            break
    used = weights > 0
    if used.sum() < max(MIN_POINTS, MIN_SHARE * len(points)):
        share = f"{int(used.sum())} of {len(points)} points"
        raise SphereError(f"only {share} lie on a common sphere", "check the radius, and cut away what is around it")
    covariance = np.linalg.inv(information) * scale**2 * CORRELATED_POINTS
    radius_sigma_mm = 0.0 if known else float(np.sqrt(covariance[3, 3]))
    return SphereFit(centre, radius, radius_sigma_mm, covariance[:3, :3], scale, used)


def find_artefact(points: Array, radius_mm: float) -> SphereFit:
    """Sphere of a known radius; its centre is fitted with free radius where the points determine both.

    A scanner that sees a sphere slightly too large (its probing error of size) would shift the centre of a sphere of
    fixed radius along the line of sight; ISO 10360-8 fits freely for the same reason. Raises SphereError.
    """
    forced = fit_sphere(points, radius_mm)
    free = fit_sphere(points[np.isfinite(points).all(axis=1)][forced.used])
    off = abs(free.radius_mm - radius_mm)
    if off > max(SIZE_TOLERANCE * radius_mm, 4 * free.radius_sigma_mm):
        what = f"the sphere found has a radius of {free.radius_mm:.2f} mm, not {radius_mm:.2f} mm"
        raise SphereError(what, "check the radius, the unit (m or mm) and the scanner's scale")
    return free if free.radius_sigma_mm < FREE_SIGMA * radius_mm else forced


def _candidate(points: Array, radius_mm: float | None) -> tuple[Array, float, float]:
    """Best of many spheres through four points: (centre, radius, scale of the distances)."""
    random = np.random.default_rng(0)
    four = points[random.integers(0, len(points), (SAMPLES, 4))]
    # |p - c|^2 = r^2 for four points, minus the first: 2 (p_i - p_0) c = |p_i|^2 - |p_0|^2
    matrix = 2 * (four[:, 1:] - four[:, :1])
    squares = np.sum(four**2, axis=2)
    solvable = np.abs(np.linalg.det(matrix)) > 1e-6
    matrix, four = matrix[solvable], four[solvable]
    right = (squares[solvable, 1:] - squares[solvable, :1])[..., None]
    centres = np.linalg.solve(matrix, right)[..., 0] if len(matrix) else np.empty((0, 3))
    radii = np.linalg.norm(four[:, 0] - centres, axis=1)
    if radius_mm is not None:
        close = np.abs(radii / radius_mm - 1) < RADIUS_TOLERANCE
        centres, radii = centres[close], np.full(int(close.sum()), radius_mm)
    if not len(centres):
        raise SphereError("no sphere of that radius passes through the points", "check radius and unit (m or mm)")
    scored = points[:: -(-len(points) // SCORED_POINTS)]
    gaps = np.abs(np.linalg.norm(scored[None] - centres[:, None], axis=2) - radii[:, None])
    medians = np.partition(gaps, max(1, int(0.4 * len(scored))), axis=1)[:, max(1, int(0.4 * len(scored)))]
    best = int(np.argmin(medians))
    return centres[best], float(radii[best]), max(2 * float(medians[best]), 1e-3)

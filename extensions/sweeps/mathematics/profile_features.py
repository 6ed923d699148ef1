"""Finds the sphere or the plane in the profiles of a sweep: circles or lines in each, through random points (RANSAC).

The circle in which the laser plane cuts a sphere of radius r at the distance y from its centre has the radius
sqrt(r² - y²); the arm moves steadily past the sphere, so that the square of the radius is a parabola over time, and at
its top the centre of the sphere lies in the laser plane.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.transforms import Array
from extensions.sweeps.mathematics.profile_solver import SweepPoints
from registration.errors import ProfileError, SphereError
from registration.profiles.profile_block import ProfileBlock
from registration.profiles.robot_path import RobotPath

PROFILES = 120
"""Profiles of a sweep that are searched."""
POINTS = 1_500
"""Points of a sweep that are used."""
SAMPLES = 60
MIN_POINTS = 15
MIN_PROFILES = 8
MIN_NOISE_MM = 0.01
CIRCLE_SHARE = (0.35, 1.03)
"""Radii of circles that are looked for, as shares of the sphere's."""
RADIUS_TOLERANCE = 0.04
LINE_SHARE = 0.4
MAX_EDGE_COSINE = float(np.cos(np.radians(10.0)))
"""Of the angle between two faces; lines at less are one that is bent."""
MAX_RANGE_MM = 1e5


def find_sphere(block: ProfileBlock, path: RobotPath, radius_mm: float) -> SweepPoints:
    """The sphere of a known radius in a sweep across it. Raises ProfileError, SphereError.

    Where the arm stood, every profile shows one circle, whose middle stands for the sphere's at first.
    """
    standing = path.stands
    if not 0 < radius_mm < MAX_RANGE_MM:
        raise SphereError(f"a radius of {radius_mm} mm is not possible", "give the sphere's radius in mm")
    searched = _searched(block, 1 if standing else MIN_PROFILES)
    tolerance = max(0.004 * radius_mm, 3 * _noise_mm(searched))
    rows, circles, kept = [], [], []
    random = np.random.default_rng(0)
    for row, points in enumerate(searched.points):
        circle = _circle(points, radius_mm, tolerance, random)
        if circle is not None:
            rows.append(row)
            circles.append(circle[0])
            kept.append(circle[1])
    fix = "sweep across the whole sphere, and check the radius and the unit (m or mm)"
    if len(rows) < (1 if standing else MIN_PROFILES):
        raise SphereError(f"{len(rows)} of {len(searched.points)} profiles show a circle", fix)
    x, z, radii = np.array(circles).T
    if standing:
        points, when = _collect(list(zip(searched.times_s[rows], kept, strict=True)))
        return SweepPoints(points, when, path, crossing=(float(when[0]), np.array([x.mean(), 0.0, z.mean()])))
    times = searched.times_s[rows]
    top, good = _parabola_top(times, radii**2)
    if good.sum() < MIN_PROFILES or not times[good].min() <= top[0] <= times[good].max():
        raise SphereError("the sphere's largest circle is not among the profiles", fix)
    largest = float(np.sqrt(max(top[1], 0.0)))
    if abs(largest / radius_mm - 1) > RADIUS_TOLERANCE:
        raise SphereError(f"the sphere found has a radius of {largest:.2f} mm, not {radius_mm:.2f} mm", fix)
    middle = [float(np.polyval(np.polyfit(times[good] - top[0], values[good], 1), 0.0)) for values in (x, z)]
    chosen = [(searched.times_s[rows[index]], kept[index]) for index in np.flatnonzero(good)]
    points, when = _collect(chosen)
    return SweepPoints(points, when, path, crossing=(top[0], np.array([middle[0], 0.0, middle[1]])))


def find_plane(block: ProfileBlock, path: RobotPath, face: int | None = None) -> SweepPoints:
    """The plane in a sweep over it: the longest line of each profile. Raises ProfileError.

    face : 0 of the left and 1 of the right of the two faces of an edge, whose lines are the two longest.
    """
    searched = _searched(block, least := 1 if path.stands else MIN_PROFILES)
    tolerance = 3 * _noise_mm(searched)
    random, chosen = np.random.default_rng(0), []
    for time_s, points in zip(searched.times_s, searched.points, strict=True):
        line = _line(points, tolerance, random) if face is None else _face(points, tolerance, random, face)
        if line is not None:
            chosen.append((time_s, line))
    if len(chosen) < least:
        what = f"{len(chosen)} of {len(searched.points)} profiles show {'a line' if face is None else 'two lines'}"
        raise ProfileError(what, "measure a plane, or an edge, that fills most of the profile")
    return SweepPoints(*_collect(chosen), path)


@dataclass(frozen=True, eq=False)
class _Searched:
    """The finite points (k, 2) of some profiles of a sweep, x and z in mm, with their times (n,)."""

    times_s: Array
    points: list[Array]


def _searched(block: ProfileBlock, least: int) -> _Searched:
    with np.errstate(invalid="ignore"):
        usable = (np.abs(block.x_mm) < MAX_RANGE_MM) & (np.abs(block.z_mm) < MAX_RANGE_MM)
    rows = np.flatnonzero(usable.sum(axis=1) >= MIN_POINTS)
    if len(block) < least:
        what = f"a sweep of {len(block)} profiles, where {MIN_PROFILES} across the surface are needed"
        raise ProfileError(what, "sweep more slowly, or stand still while profiles are taken")
    if len(rows) < least:
        what = f"{len(rows)} of {len(block)} profiles have {MIN_POINTS} points or more"
        raise ProfileError(what, "check exposure and measuring range, and sweep more slowly")
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, PROFILES).astype(int))]
    points = [
        np.column_stack([block.x_mm[row][usable[row]], block.z_mm[row][usable[row]]]).astype(float) for row in rows
    ]
    return _Searched(block.times_s[rows], points)


def _noise_mm(searched: _Searched) -> float:
    """Standard deviation of z by its second differences."""
    bends = np.concatenate([np.diff(points[:, 1], 2) for points in searched.points])
    return max(float(np.median(np.abs(bends)) / (0.6745 * np.sqrt(6))), MIN_NOISE_MM)


def _circle(
    points: Array, radius_mm: float, tolerance: float, random: np.random.Generator
) -> tuple[tuple[float, float, float], Array] | None:
    """(x, z, radius) of the circle with most points, and these (k, 2); None without one."""
    three = points[random.integers(0, len(points), (SAMPLES, 3))]
    sides = 2 * (three[:, 1:] - three[:, :1])
    squares = np.sum(three**2, axis=2)
    right = squares[:, 1:] - squares[:, :1]
    determinant = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]
    solvable = np.abs(determinant) > 1e-6
    if not solvable.any():
        return None
    sides, right, determinant, three = (values[solvable] for values in (sides, right, determinant, three))
    centres = np.column_stack([
        (right[:, 0] * sides[:, 1, 1] - right[:, 1] * sides[:, 0, 1]) / determinant,
        (right[:, 1] * sides[:, 0, 0] - right[:, 0] * sides[:, 1, 0]) / determinant,
    ])  # fmt: skip
    radii = np.linalg.norm(three[:, 0] - centres, axis=1)
    possible = (radii > CIRCLE_SHARE[0] * radius_mm) & (radii < CIRCLE_SHARE[1] * radius_mm)
    if not possible.any():
        return None
    centres, radii = centres[possible], radii[possible]
    near = np.abs(np.linalg.norm(points[None] - centres[:, None], axis=2) - radii[:, None]) < tolerance
    best = int(np.argmax(near.sum(axis=1)))
    inside = points[near[best]]
    for _ in range(2):
        if len(inside) < MIN_POINTS:
            return None
        matrix = np.column_stack([2 * inside, np.ones(len(inside))])
        x, z, rest = np.linalg.lstsq(matrix, np.sum(inside**2, axis=1), rcond=None)[0]
        radius = float(np.sqrt(max(rest + x * x + z * z, 0.0)))
        inside = points[np.abs(np.hypot(points[:, 0] - x, points[:, 1] - z) - radius) < tolerance]
    if len(inside) < MIN_POINTS or not CIRCLE_SHARE[0] * radius_mm < radius < CIRCLE_SHARE[1] * radius_mm:
        return None
    chord = float(np.linalg.norm(np.ptp(inside, axis=0)))
    return ((float(x), float(z), radius), inside) if chord > 0.8 * radius else None


def _line(points: Array, tolerance: float, random: np.random.Generator) -> Array | None:
    """The points (k, 2) of the longest line; None when it holds too few."""
    two = points[random.integers(0, len(points), (SAMPLES, 2))]
    along = two[:, 1] - two[:, 0]
    length = np.linalg.norm(along, axis=1)
    two, along, length = (values[length > 10 * tolerance] for values in (two, along, length))
    if not len(two):
        return None
    normals = np.column_stack([-along[:, 1], along[:, 0]]) / length[:, None]
    near = np.abs(points @ normals.T - np.sum(two[:, 0] * normals, axis=1)) < 2 * tolerance
    inside = points[near[:, int(np.argmax(near.sum(axis=0)))]]
    middle = inside.mean(axis=0)
    normal = np.linalg.eigh((inside - middle).T @ (inside - middle))[1][:, 0]
    inside = points[np.abs((points - middle) @ normal) < tolerance]
    return inside if len(inside) >= max(MIN_POINTS, LINE_SHARE * len(points)) else None


def _face(points: Array, tolerance: float, random: np.random.Generator, face: int) -> Array | None:
    """The points (k, 2) of the left (0) or right (1) of the two longest lines; None without two at an angle."""
    first = _line(points, tolerance, random)
    if first is None:
        return None
    place = np.array([1.0, 1j])
    rest = points[~np.isin(points @ place, first @ place)]
    second = _line(rest, tolerance, random) if len(rest) >= MIN_POINTS else None
    if second is None:
        return None
    along = [np.linalg.svd(one - one.mean(axis=0), full_matrices=False)[2][0] for one in (first, second)]
    if abs(float(along[0] @ along[1])) > MAX_EDGE_COSINE:
        return None
    found: Array = sorted((first, second), key=lambda one: float(one[:, 0].mean()))[face]
    return found


def _parabola_top(times_s: Array, squares: Array) -> tuple[tuple[float, float], NDArray[np.bool_]]:
    """(time, value) at the top of the parabola through most of the values, and which (n,) lie on it."""
    middle, random = times_s.mean(), np.random.default_rng(0)
    span = max(float(np.ptp(times_s)), 1e-6)
    u = (times_s - middle) / span
    powers = np.column_stack([np.ones_like(u), u, u * u])
    chosen = random.integers(0, len(u), (200, 3))
    solvable = np.abs(np.linalg.det(powers[chosen])) > 1e-9
    if not solvable.any():
        return (float(middle), 0.0), np.zeros(len(u), bool)
    curves = np.linalg.solve(powers[chosen[solvable]], squares[chosen[solvable]][..., None])[..., 0]
    gaps = np.abs(curves @ powers.T - squares)
    best = gaps[np.argmin(np.median(gaps, axis=1) + 1e12 * (curves[:, 2] >= 0))]
    good = best <= max(5 * float(np.median(best)), 1e-3 * float(squares.max()))
    for _ in range(2):
        if good.sum() < 4:
            break
        curve = np.linalg.lstsq(powers[good], squares[good], rcond=None)[0]
        gap = np.abs(powers @ curve - squares)
        good = gap <= max(5 * float(np.median(gap[good])), 1e-3 * float(squares.max()))
    if good.sum() < 4 or curve[2] >= 0:
        return (float(middle), 0.0), np.zeros(len(u), bool)
    at = -curve[1] / (2 * curve[2])
    return (float(middle + span * at), float(curve[0] + curve[1] * at / 2)), good


def _collect(chosen: list[tuple[float, Array]]) -> tuple[Array, Array]:
    """Points (k, 3) with y = 0 and times (k,): evenly from each profile, POINTS at most."""
    each = max(POINTS // len(chosen), 4)
    points, times = [], []
    for time_s, inside in chosen:
        some = inside[np.unique(np.linspace(0, len(inside) - 1, each).astype(int))]
        points.append(np.column_stack([some[:, 0], np.zeros(len(some)), some[:, 1]]))
        times.append(np.full(len(some), time_s))
    return np.concatenate(points), np.concatenate(times)

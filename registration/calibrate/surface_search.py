"""A rough X from overlapping views alone: a search over all rotations of the camera on its mount.

The views show one part, so that their middles are near one point of the anchor: with a rotation of X this gives its
translation by linear least squares. The rotations are compared by how well the views' surfaces then lie on each other,
and the best are refined by point-to-plane registration of all views over X (Xing et al., RegHEC, 2022, search the
rotation by Bayesian optimisation instead).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy

from calibration.errors import UndeterminedError
from calibration.sentences.sentence import Sentence
from calibration.transforms import (
    Array,
    difference,
    inverse,
    map_points,
    rotation_from_quaternion,
    transform,
    transform_from_vector,
)
from registration.points.surface import Surface

ROTATIONS = 800
"""Rotations that are compared first: neighbours are about 23 degrees apart; a start 45 degrees off is near enough."""

REFINED = 8
"""Of these the best are refined."""

MIN_APART_RAD = float(np.radians(12.0))
"""Starts closer than this to a better one lead to the same X."""

PROBES, PAIRS, POINTS = 60, 12, 1500
"""Points of a view that are compared, pairs of views at first, and points kept of a view."""

REACHES_MM = (60.0, 45.0, 34.0, 25.0, 19.0, 14.0, 10.0, 8.0, 6.0, 5.0, 5.0, 5.0)
"""Radius of counterparts in each round of the refinement."""

MAX_GAP_MM = 10.0
"""A probe without a nearer counterpart counts as this far."""

SAME_X_MM, SAME_X_RAD = 10.0, float(np.radians(4.0))
"""Two results closer than this are one."""

MIN_LEAD = 1.15
"""Ratio of the gaps of another X to those of the best from which the best is certain."""

MAX_SLIP = 0.004
"""A resistance below it is that of the normals' noise, up to 3 degrees. Scanned planes and spheres have 0.0004 at most,
cylinders and everything else 0.14."""

SEED = 1


@dataclass(frozen=True, eq=False)
class _View:
    """A thinned surface: points and normals (m, 3) in the camera, tree, and its pose anchor_T_mount (4, 4)."""

    points: Array
    normals: Array
    tree: "scipy.spatial.cKDTree"
    anchor_T_mount: Array


def find_rough_x(surfaces: Sequence[Surface], anchor_T_mount: Array) -> Array:
    """X (4, 4) within the reach of a registration. Raises UndeterminedError `surfaces-ambiguous`, `views-alone`."""
    views = [_thin(surface, pose) for surface, pose in zip(surfaces, anchor_T_mount, strict=True)]
    if any(not len(view.points) for view in views) or len(views) < 3:
        raise UndeterminedError("views-alone", Sentence("surfaces-too-few"), Sentence("give-rough-x"))
    if np.median([_slip(view) for view in views]) < MAX_SLIP:
        raise UndeterminedError("surfaces-ambiguous", Sentence("surfaces-slide"), Sentence("give-rough-x"))
    starts = _starts(views)
    pairs = list(combinations(range(len(views)), 2))
    refined = [_refine(views, pairs, start) for start in starts]
    ranked = sorted(((_mean_gap(views, pairs, x), index) for index, x in enumerate(refined)))
    least, best = ranked[0][0], refined[ranked[0][1]]
    if least >= MAX_GAP_MM / 2:
        raise UndeterminedError("views-alone", Sentence("surfaces-apart"), Sentence("give-rough-x"))
    for gap, index in ranked[1:]:
        off_mm, off_rad = difference(best, refined[index])
        if gap < MIN_LEAD * least and (off_rad > SAME_X_RAD or off_mm > SAME_X_MM):
            what = Sentence("surfaces-ambiguous", off_mm=off_mm, off_deg=float(np.degrees(off_rad)))
            raise UndeterminedError("surfaces-ambiguous", what, Sentence("give-rough-x"))
    return best


def _slip(view: _View) -> float:
    """How much the surface resists the third easiest of six motions, 0 where that leaves it on itself.

    A plane and a sphere have three such motions, a cylinder two, a cone one (Gelfand & Guibas, Shape segmentation
    using local slippage analysis, 2004). Lengths are in units of the points' RMS distance from their middle.
    """
    points = view.points - view.points.mean(axis=0)
    points /= max(float(np.sqrt(np.mean(np.sum(points**2, axis=1)))), 1e-9)
    rows = np.concatenate([np.cross(points, view.normals), view.normals], axis=1)
    return float(np.linalg.eigvalsh(rows.T @ rows / len(rows))[2])


def _thin(surface: Surface, pose: Array) -> _View:
    chosen = np.random.default_rng(SEED).permutation(len(surface.points))[:POINTS]
    points = surface.points[chosen]
    return _View(points, surface.normals[chosen], scipy.spatial.cKDTree(points), pose)


def _starts(views: list[_View]) -> list[Array]:
    """The REFINED best X of as many rotations as ROTATIONS, no two closer than MIN_APART_RAD."""
    everything = list(combinations(range(len(views)), 2))
    order = np.random.default_rng(SEED).permutation(len(everything))[:PAIRS]
    pairs = [everything[index] for index in order]
    candidates = _with_translations(views, _spread_rotations(ROTATIONS))
    gaps = np.array([_mean_gap(views, pairs, x) for x in candidates])
    kept: list[Array] = []
    for index in np.argsort(gaps, kind="stable"):
        if all(difference(candidates[index], other)[1] > MIN_APART_RAD for other in kept):
            kept.append(candidates[index])
        if len(kept) == REFINED:
            break
    return kept


def _spread_rotations(count: int) -> Array:
    """Rotations (n, 3, 3) spread evenly: super-Fibonacci spirals (M. Alexa, CVPR 2022)."""
    s = np.arange(count) + 0.5
    t, d = s / count, 2 * np.pi * s
    inner, outer = np.sqrt(t), np.sqrt(1 - t)
    alpha, beta = d / np.sqrt(2.0), d / 1.533751168755204288118041
    quaternions = np.stack([inner * np.sin(alpha), inner * np.cos(alpha), outer * np.sin(beta), outer * np.cos(beta)])
    return rotation_from_quaternion(quaternions.T)


def _with_translations(views: list[_View], rotations: Array) -> Array:
    """X (k, 4, 4) for rotations (k, 3, 3): the middles of all views at one point of the anchor, as far as possible."""
    turned = np.array([view.anchor_T_mount[:3, :3] for view in views])
    moved = np.array([view.anchor_T_mount[:3, 3] for view in views])
    middles = np.array([np.median(view.points, axis=0) for view in views])
    matrix = np.concatenate([turned, -np.broadcast_to(np.eye(3), turned.shape)], axis=2).reshape(-1, 6)
    seen = np.einsum("nij,kjl,nl->kni", turned, rotations, middles) + moved
    solved = -np.linalg.pinv(matrix) @ seen.reshape(len(rotations), -1).T
    return transform(rotations, solved[:3].T)


def _mean_gap(views: list[_View], pairs: list[tuple[int, int]], x: Array) -> float:
    """Mean distance of probes of one view to the surface of the other, each at most MAX_GAP_MM."""
    poses = [view.anchor_T_mount @ x for view in views]
    gaps = []
    for source, target in pairs:
        probes = map_points(inverse(poses[target]) @ poses[source], views[source].points[:PROBES])
        distances, _ = views[target].tree.query(probes, distance_upper_bound=MAX_GAP_MM)
        gaps.append(np.minimum(distances, MAX_GAP_MM).mean())
    return float(np.mean(gaps))


def _refine(views: list[_View], pairs: list[tuple[int, int]], x: Array) -> Array:
    """X after rounds of Gauss-Newton on the distances of probes along the counterparts' normals."""
    for reach_mm in REACHES_MM:
        information, gradient = 1e-6 * np.eye(6), np.zeros(6)
        for source, target in pairs:
            rows, gaps = _linearise(views[source], views[target], x, reach_mm)
            weights = np.clip(1 - (gaps / reach_mm) ** 2, 0, None) ** 2
            information += (rows * weights[:, None]).T @ rows
            gradient += rows.T @ (weights * gaps)
        step = -np.linalg.solve(information, gradient)
        longest = np.repeat([0.2, 40.0], 3)
        x = x @ transform_from_vector(np.clip(step, -longest, longest))
    return x


def _linearise(source: _View, target: _View, x: Array, reach_mm: float) -> tuple[Array, Array]:
    """Derivatives (n, 6) by X @ exp([rotation, translation]) of the gaps (n,) along the target's normals."""
    target_T_source = inverse(target.anchor_T_mount @ x) @ source.anchor_T_mount @ x
    own = source.points[: 2 * PROBES]
    points = map_points(target_T_source, own)
    distances, nearest = target.tree.query(points, distance_upper_bound=reach_mm)
    found = np.flatnonzero(np.isfinite(distances))
    normals = target.normals[nearest[found]]
    facing = np.sum((source.normals[found] @ target_T_source[:3, :3].T) * normals, axis=1) > 0
    found, normals = found[facing], normals[facing]
    gaps = np.sum((points[found] - target.points[nearest[found]]) * normals, axis=1)
    turned = normals @ target_T_source[:3, :3]
    by_rotation = np.cross(own[found], turned) - np.cross(points[found], normals)
    return np.concatenate([by_rotation, turned - normals], axis=1), gaps

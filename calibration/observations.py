"""The corners of a session as arrays over views, and which views have none that can be used."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.problem import Problem, View
from calibration.transforms import Array

NARROWEST_PX = 2.0
"""A target seen narrower than this has no pose worth the name."""

FURTHEST_MM = 1e8
"""Of a flange from its base. Even poses in micrometres are nearer, whose unit the diagnosis can tell."""

LARGEST_SKEW = 1e-3
"""Of a rotation's columns: those of any quaternion of unit length are a thousand million times better."""

FEWEST_CORNERS = 4
"""Four points of a plane determine its pose; fewer do not."""


@dataclass(frozen=True, eq=False)
class Observations:
    """n views of up to m points; views with fewer are padded with weight 0.

    `positions` (n,) in `problem.views`; `base_T_flange` (n, 4, 4); `ids` and `points_mm` (n, m, 3) on the target;
    `pixels` (n, m, 2); `weights` (n, m), 1 where a corner is used and 0 elsewhere; `present` (n, m), 1 where
    there is one.
    """

    positions: NDArray[np.intp]
    base_T_flange: Array
    ids: NDArray[np.intp]
    points_mm: Array
    pixels: Array
    weights: Array
    present: Array

    def __len__(self) -> int:
        return len(self.positions)

    def take(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> "Observations":
        """Only the chosen views."""
        return Observations(*(array[chosen] for array in vars(self).values()))

    def weighted(self, weights: Array) -> "Observations":
        """The same corners with other weights (n, m)."""
        return replace(self, weights=weights)


def scaled(seen: Observations, scale: float) -> Observations:
    """The same pictures of a target `scale` times as large."""
    return seen if scale == 1.0 else replace(seen, points_mm=scale * seen.points_mm)


@dataclass(frozen=True)
class Unusable:
    """Why a view takes no part: a code and a sentence."""

    code: str
    what: str


def observe(problem: Problem) -> tuple[Observations, dict[int, Unusable]]:
    """Everything usable, and by position in `problem.views` why the rest is not."""
    refused: dict[int, Unusable] = {}
    kept: list[tuple[int, NDArray[np.intp], Array]] = []
    for position, view in enumerate(problem.views):
        corners = _corners(problem, view)
        if isinstance(corners, Unusable):
            refused[position] = corners
        else:
            kept.append((position, *corners))
    return _padded(problem, kept), refused


def _corners(problem: Problem, view: View) -> tuple[NDArray[np.intp], Array] | Unusable:
    if view.detection is None:
        return Unusable(*(view.missing or ("target-not-found", "the target was not found in the image")))
    ids, pixels = np.asarray(view.detection.ids), np.asarray(view.detection.corners_px, float)
    if not np.all(np.isfinite(view.base_T_flange)):
        return Unusable("pose-not-finite", "the robot's pose holds a number that is not finite")
    if not _rigid(view.base_T_flange):
        return Unusable("pose-not-rigid", "the robot's pose is no rotation and a place that an arm can reach")
    if len(ids) != len(pixels):
        return Unusable("corners-damaged", f"{len(ids)} ids for {len(pixels)} corners")
    if len(ids) and (ids.min() < 0 or ids.max() >= len(problem.target.points_mm)):
        return Unusable("corner-id-unknown", f"a corner id is outside 0..{len(problem.target.points_mm) - 1}")
    if len(np.unique(ids)) < len(ids):
        return Unusable("corner-id-repeated", "the same corner id stands twice")
    size = np.array(problem.image_size)
    # Not a number is not inside either.
    inside = np.all((pixels > -size[0]) & (pixels < 2 * size), axis=1)
    ids, pixels = ids[inside], pixels[inside]
    if len(ids) < FEWEST_CORNERS:
        return Unusable("too-few-corners", f"{len(ids)} usable corners; a view needs {FEWEST_CORNERS} or more")
    long_mm, wide_mm = _extent(problem.target.points_mm[ids, :2])
    if wide_mm < 1e-6 * long_mm:
        return Unusable("corners-on-a-line", "all corners lie on one line of the target")
    if _extent(pixels)[1] < NARROWEST_PX:
        return Unusable("edge-on", "all corners lie on one line of the image: the target is seen edge-on")
    return ids, pixels


def _rigid(base_T_flange: Array) -> bool:
    """Is it a proper rotation and a place within reach?"""
    turn, place = base_T_flange[:3, :3], base_T_flange[:3, 3]
    if np.max(np.abs(place)) > FURTHEST_MM or np.max(np.abs(turn)) > 2.0:
        return False
    return float(np.max(np.abs(turn @ turn.T - np.eye(3)))) < LARGEST_SKEW and float(np.linalg.det(turn)) > 0


def _extent(points: Array) -> tuple[float, float]:
    """The singular values of points (n, 2) about their mean: the root of their summed squares along and across."""
    off = points - points.mean(axis=0)
    (xx, xy), (_, yy) = (off.T @ off).tolist()
    root = float(np.hypot(xx - yy, 2 * xy))
    longer = (xx + yy + root) / 2
    return longer**0.5, (max(xx * yy - xy * xy, 0.0) / max(longer, 1e-300)) ** 0.5


def _padded(problem: Problem, kept: list[tuple[int, NDArray[np.intp], Array]]) -> Observations:
    n, m = len(kept), max((len(ids) for _, ids, _ in kept), default=0)
    points, pixels, weights = np.zeros((n, m, 3)), np.zeros((n, m, 2)), np.zeros((n, m))
    names = np.zeros((n, m), np.intp)
    for row, (_, ids, corners) in enumerate(kept):
        names[row] = np.concatenate([ids, np.full(m - len(ids), ids[0])])
        points[row, : len(ids)] = problem.target.points_mm[ids]
        pixels[row, : len(ids)] = corners
        weights[row, : len(ids)] = 1.0
        # Padding repeats a real point, so that it is in front of the camera whenever the view is.
        points[row, len(ids) :], pixels[row, len(ids) :] = points[row, 0], pixels[row, 0]
    positions = np.array([position for position, _, _ in kept], dtype=np.intp)
    poses = np.array([problem.views[position].base_T_flange for position in positions]).reshape(-1, 4, 4)
    return Observations(positions, poses, names, points, pixels, weights, weights.copy())

"""The corners of a session as arrays over views, and which views have none that can be used."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.problem import Problem
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
    poses = np.array([view.base_T_flange for view in problem.views], float).reshape(-1, 4, 4)
    finite = np.all(np.isfinite(poses), axis=(1, 2))
    rigid = np.zeros(len(poses), bool)
    rigid[finite] = _rigid(poses[finite])
    refused: dict[int, Unusable] = {}
    whole: list[tuple[int, NDArray[np.intp], Array]] = []
    for position, view in enumerate(problem.views):
        if view.detection is None:
            why = Unusable(*(view.missing or ("target-not-found", "the target was not found in the image")))
        elif not finite[position]:
            why = Unusable("pose-not-finite", "the robot's pose holds a number that is not finite")
        elif not rigid[position]:
            why = Unusable("pose-not-rigid", "the robot's pose is no rotation and a place that an arm can reach")
        else:
            ids, pixels = np.asarray(view.detection.ids), np.asarray(view.detection.corners_px, float)
            if len(ids) == len(pixels):
                whole.append((position, ids, pixels))
                continue
            why = Unusable("corners-damaged", f"{len(ids)} ids for {len(pixels)} corners")
        refused[position] = why
    seen, by_corners = _corners(problem, poses, whole)
    return seen, refused | by_corners


def _rigid(base_T_flange: Array) -> NDArray[np.bool_]:
    """Which poses (n, 4, 4) are a proper rotation and a place within reach (n,)?"""
    turns, places = base_T_flange[:, :3, :3], base_T_flange[:, :3, 3]
    within = (np.abs(places).max(axis=1) <= FURTHEST_MM) & (np.abs(turns).max(axis=(1, 2)) <= 2.0)
    turns = np.where(within[:, None, None], turns, 0.0)
    skewed = np.abs(turns @ np.swapaxes(turns, 1, 2) - np.eye(3)).max(axis=(1, 2))
    rigid: NDArray[np.bool_] = within & (skewed < LARGEST_SKEW) & (np.linalg.det(turns) > 0)
    return rigid


def _corners(
    problem: Problem, poses: Array, whole: list[tuple[int, NDArray[np.intp], Array]]
) -> tuple[Observations, dict[int, Unusable]]:
    """The views (position, ids, pixels) whose corners can be used, and why the others cannot; all views at once."""
    n, k = len(whole), len(problem.target.points_mm)
    row = np.repeat(np.arange(n), [len(ids) for _, ids, _ in whole])
    ids = np.concatenate([np.zeros(0, np.intp), *(ids for _, ids, _ in whole)]).astype(np.intp)
    pixels = np.concatenate([np.zeros((0, 2)), *(pixels for _, _, pixels in whole)])
    known = (ids >= 0) & (ids < k)
    times = np.bincount(row[known] * k + ids[known], minlength=n * k).reshape(n, k)
    size = np.array(problem.image_size)
    # Not a number is not inside either.
    inside = known & np.all((pixels > -size[0]) & (pixels < 2 * size), axis=1)
    row, ids, pixels, unknown = row[inside], ids[inside], pixels[inside], np.bincount(row[~known], minlength=n)
    count = np.bincount(row, minlength=n)
    long_mm, wide_mm = _extents(problem.target.points_mm[ids, :2], row, count)
    causes = (
        (unknown > 0, "corner-id-unknown", f"a corner id is outside 0..{k - 1}"),
        (times.max(axis=1, initial=0) > 1, "corner-id-repeated", "the same corner id stands twice"),
        (count < FEWEST_CORNERS, "too-few-corners", f"{{}} usable corners; a view needs {FEWEST_CORNERS} or more"),
        (wide_mm < 1e-6 * long_mm, "corners-on-a-line", "all corners lie on one line of the target"),
        (
            _extents(pixels, row, count)[1] < NARROWEST_PX,
            "edge-on",
            "all corners lie on one line of the image: the target is seen edge-on",
        ),
    )
    refused = {}
    kept = np.ones(n, bool)
    for there, code, what in causes:
        for bad in np.flatnonzero(there & kept):
            refused[whole[bad][0]] = Unusable(code, what.format(count[bad]))
        kept &= ~there
    used = kept[row]
    positions = np.array([position for position, _, _ in whole], np.intp)[kept]
    of_kept = (np.cumsum(kept) - 1)[row[used]]
    return _padded(problem, positions, poses, of_kept, ids[used], pixels[used]), refused


def _extents(points: Array, row: NDArray[np.intp], count: NDArray[np.intp]) -> tuple[Array, Array]:
    """Singular values (n,) of each row's points (m, 2) about their mean: root of summed squares along and across."""

    def summed(values: Array) -> Array:
        return np.bincount(row, values, minlength=len(count)).astype(float, copy=False)

    some = np.maximum(count, 1)
    x, y = (points[:, axis] - (summed(points[:, axis]) / some)[row] for axis in range(2))
    xx, xy, yy = summed(x * x), summed(x * y), summed(y * y)
    longer = (xx + yy + np.hypot(xx - yy, 2 * xy)) / 2
    across = np.maximum(xx * yy - xy * xy, 0.0) / np.maximum(longer, 1e-300)
    return np.sqrt(longer), np.sqrt(across)


def _padded(
    problem: Problem,
    positions: NDArray[np.intp],
    poses: Array,
    row: NDArray[np.intp],
    ids: NDArray[np.intp],
    pixels: Array,
) -> Observations:
    """Corners (c,) that lie one view after the other, as arrays over views."""
    n = len(positions)
    count = np.bincount(row, minlength=n)
    start = np.cumsum(count) - count
    m = int(count.max(initial=0))
    # Padding repeats a real point, so that it is in front of the camera whenever the view is.
    column = np.arange(m)
    present = column < count[:, None]
    source = start[:, None] + np.where(present, column, 0)
    names, weights = ids[source], present.astype(float)
    return Observations(
        positions, poses[positions], names, problem.target.points_mm[names], pixels[source], weights, weights.copy()
    )

"""The corners of a session as arrays over views, and the reasons why the other views are unusable."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.closed_forms.observability import at_station
from calibration.problem import Problem
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array

MIN_WIDTH_PX = 2.0
"""Least width of the detected points in the image; below it the target's pose is not determined."""

MAX_DISTANCE_MM = 1e8
"""Largest distance of a flange from its base. Poses in micrometres pass, for the diagnosis to identify the unit."""

MAX_SKEW = 1e-3
"""Largest error of R R' - I of a rotation; that of a unit quaternion is a thousand million times smaller."""

IMAGE_REPEATED, STATION_REPEATED = "image-repeated", "duplicate-poses"

MOVED_MM = 1.0
"""Least motion of the target in the camera between two views for one that was not the robot's scatter."""

OTHER_JOINTS_RAD = float(np.radians(1.0))
"""An arm whose joints are this far apart at one pose errs there in another way."""

MIN_CORNERS = 4
"""Four points of a plane determine its pose; fewer do not."""


@dataclass(frozen=True, eq=False)
class Observations:
    """n views of up to m points; views with fewer are padded with weight 0.

    positions : (n,) in `problem.views`.
    base_T_flange : (n, 4, 4).
    ids, points_mm : (n, m) and (n, m, 3), on the target.
    pixels : (n, m, 2).
    weights : (n, m), 0 where a corner is not used.
    present : (n, m), 1 where there is a corner, 0 in the padding.
    effects : (n, m, 3, e) by which one unit of each of e effects moves the points, on the target; usually e = 0.
    """

    positions: NDArray[np.intp]
    base_T_flange: Array
    ids: NDArray[np.intp]
    points_mm: Array
    pixels: Array
    weights: Array
    present: Array
    effects: Array

    def __len__(self) -> int:
        return len(self.positions)

    def take(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> "Observations":
        """Only the chosen views."""
        return Observations(*(array[chosen] for array in vars(self).values()))

    def joined(self, others: "Observations") -> "Observations":
        """These views and others of the same session, without effects, after them."""
        others = replace(others, effects=np.zeros((*others.ids.shape, *self.effects.shape[2:])))
        pairs = zip(vars(self).values(), vars(others).values(), strict=True)
        return Observations(*(np.concatenate(pair) for pair in pairs))

    def with_weights(self, weights: Array) -> "Observations":
        """The same corners with other weights (n, m)."""
        return replace(self, weights=weights)


@dataclass(frozen=True)
class UnusableReason:
    """Why a view is not used: a stable code and a sentence."""

    code: str
    what: str


def observe(problem: Problem) -> tuple[Observations, dict[int, UnusableReason]]:
    """The usable views, and the reason by position in `problem.views` for the others."""
    poses = np.array([view.base_T_flange for view in problem.views], float).reshape(-1, 4, 4)
    finite = np.all(np.isfinite(poses), axis=(1, 2))
    rigid = np.zeros(len(poses), bool)
    rigid[finite] = rigid_mask(poses[finite])
    refused: dict[int, UnusableReason] = {}
    whole: list[tuple[int, NDArray[np.intp], Array]] = []
    for position, view in enumerate(problem.views):
        if view.detection is None:
            why = UnusableReason(*(view.missing or ("target-not-found", Sentence("target-not-found"))))
        elif not finite[position]:
            why = UnusableReason("pose-not-finite", Sentence("pose-not-finite"))
        elif not rigid[position]:
            why = UnusableReason("pose-not-rigid", Sentence("pose-not-rigid"))
        else:
            ids, pixels = np.asarray(view.detection.ids), np.asarray(view.detection.corners_px, float)
            if len(ids) == len(pixels):
                whole.append((position, ids, pixels))
                continue
            why = UnusableReason("corners-damaged", Sentence("corners-damaged", ids=len(ids), corners=len(pixels)))
        refused[position] = why
    seen, by_corners = _usable_corners(problem, poses, whole)
    first_of = _first_with_same_image(seen)
    kept = first_of == np.arange(len(seen))
    for row in np.flatnonzero(~kept):
        first = problem.views[seen.positions[first_of[row]]].index
        by_corners[int(seen.positions[row])] = UnusableReason(IMAGE_REPEATED, Sentence("image-repeated", view=first))
    return seen if np.all(kept) else seen.take(kept), refused | by_corners


def _first_with_same_image(seen: Observations) -> NDArray[np.intp]:
    """The first row (n,) with the same corners in every bit; no two exposures agree so far."""
    first_with: dict[bytes, int] = {}
    images = (ids.tobytes() + pixels.tobytes() for ids, pixels in zip(seen.ids, seen.pixels, strict=True))
    return np.array([first_with.setdefault(image, row) for row, image in enumerate(images)], np.intp)


def repetitions(problem: Problem, seen: Observations) -> dict[int, UnusableReason]:
    """Why pictures are not used where another of their station has as many corners, by position in `problem.views`.

    The arm errs by the same amount in all pictures of a station, so that another one tells next to nothing more of X.
    """
    kept, repeated = list[int](), dict[int, UnusableReason]()
    for row in np.argsort(-np.count_nonzero(seen.weights, axis=1), kind="stable").tolist():
        there = np.flatnonzero(at_station(seen.base_T_flange[kept], seen.base_T_flange[row]))
        same = next((kept[one] for one in there if _same_view(problem, seen, row, kept[one])), None)
        if same is None:
            kept.append(row)
        else:
            what = Sentence("station-repeated", view=problem.views[seen.positions[same]].index)
            repeated[int(seen.positions[row])] = UnusableReason(STATION_REPEATED, what)
    return repeated


def _same_view(problem: Problem, seen: Observations, row: int, other: int) -> bool:
    """Whether two pictures from one pose have the same joints, where known, and show the target within MOVED_MM."""
    stances = (problem.views[seen.positions[one]].stance for one in (row, other))
    joints = (() if one.joints_rad is None else one.joints_rad for one in stances)
    moved = any(np.cos(here - there) < np.cos(OTHER_JOINTS_RAD) for here, there in zip(*joints, strict=False))
    _, here, there = np.intersect1d(seen.ids[row], seen.ids[other], return_indices=True)
    if moved or len(here) < MIN_CORNERS:
        return False
    now, then, on_target = seen.pixels[row, here], seen.pixels[other, there], seen.points_mm[row, here]
    limit_px = MOVED_MM * np.linalg.norm(np.std(now, axis=0)) / np.linalg.norm(np.std(on_target, axis=0))
    return bool(np.median(np.linalg.norm(now - then, axis=1)) <= limit_px)


def rigid_mask(base_T_flange: Array) -> NDArray[np.bool_]:
    """Mask (n,) of the poses (n, 4, 4) that are a proper rotation and a translation up to MAX_DISTANCE_MM."""
    turns, places = base_T_flange[:, :3, :3], base_T_flange[:, :3, 3]
    within = (np.abs(places).max(axis=1) <= MAX_DISTANCE_MM) & (np.abs(turns).max(axis=(1, 2)) <= 2.0)
    turns = np.where(within[:, None, None], turns, 0.0)
    skewed = np.abs(turns @ np.swapaxes(turns, 1, 2) - np.eye(3)).max(axis=(1, 2))
    rigid: NDArray[np.bool_] = within & (skewed < MAX_SKEW) & (np.linalg.det(turns) > 0)
    return rigid


def _usable_corners(
    problem: Problem, poses: Array, whole: list[tuple[int, NDArray[np.intp], Array]]
) -> tuple[Observations, dict[int, UnusableReason]]:
    """The views (position, ids, pixels) with usable corners, and the reasons for the others; all views at once."""
    n, k = len(whole), len(problem.target.points_mm)
    row = np.repeat(np.arange(n), [len(ids) for _, ids, _ in whole])
    ids = np.concatenate([np.zeros(0, np.intp), *(ids for _, ids, _ in whole)]).astype(np.intp)
    pixels = np.concatenate([np.zeros((0, 2)), *(pixels for _, _, pixels in whole)])
    known = (ids >= 0) & (ids < k)
    times = np.bincount(row[known] * k + ids[known], minlength=n * k).reshape(n, k)
    size = np.array(problem.image_size)
    # NaN compares false, so it is not inside.
    inside = known & np.all((pixels > -size[0]) & (pixels < 2 * size), axis=1)
    row, ids, pixels, unknown = row[inside], ids[inside], pixels[inside], np.bincount(row[~known], minlength=n)
    count = np.bincount(row, minlength=n)
    long_mm, wide_mm = _extents(problem.target.points_mm[ids, :2], row, count)
    causes: tuple[tuple[NDArray[np.bool_], str, Callable[[int], Sentence]], ...] = (
        (unknown > 0, "corner-id-unknown", lambda corners: Sentence("corner-id-unknown", last=k - 1)),
        (times.max(axis=1, initial=0) > 1, "corner-id-repeated", lambda corners: Sentence("corner-id-repeated")),
        (
            count < MIN_CORNERS,
            "too-few-corners",
            lambda corners: Sentence("too-few-corners", corners=corners, least=MIN_CORNERS),
        ),
        (wide_mm < 1e-6 * long_mm, "corners-on-a-line", lambda corners: Sentence("corners-on-a-line")),
        (_extents(pixels, row, count)[1] < MIN_WIDTH_PX, "edge-on", lambda corners: Sentence("corners-edge-on")),
    )
    refused = {}
    kept = np.ones(n, bool)
    for there, code, sentence in causes:
        for bad in np.flatnonzero(there & kept):
            refused[whole[bad][0]] = UnusableReason(code, sentence(int(count[bad])))
        kept &= ~there
    used = kept[row]
    positions = np.array([position for position, _, _ in whole], np.intp)[kept]
    of_kept = (np.cumsum(kept) - 1)[row[used]]
    return _pad(problem, positions, poses, of_kept, ids[used], pixels[used]), refused


def _extents(points: Array, row: NDArray[np.intp], count: NDArray[np.intp]) -> tuple[Array, Array]:
    """Both singular values (n,) of each view's points (c, 2) about their mean; `row` (c,), `count` (n,) of points."""

    def row_sums(values: Array) -> Array:
        return np.bincount(row, values, minlength=len(count)).astype(float, copy=False)

    some = np.maximum(count, 1)
    x, y = (points[:, axis] - (row_sums(points[:, axis]) / some)[row] for axis in range(2))
    xx, xy, yy = row_sums(x * x), row_sums(x * y), row_sums(y * y)
    longer = (xx + yy + np.hypot(xx - yy, 2 * xy)) / 2
    across = np.maximum(xx * yy - xy * xy, 0.0) / np.maximum(longer, 1e-300)
    return np.sqrt(longer), np.sqrt(across)


def _pad(
    problem: Problem,
    positions: NDArray[np.intp],
    poses: Array,
    row: NDArray[np.intp],
    ids: NDArray[np.intp],
    pixels: Array,
) -> Observations:
    """Corners (c,) in order of their views as arrays over views."""
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
        positions, poses[positions], names, problem.target.points_mm[names], pixels[source], weights, weights.copy(),
        np.zeros((n, m, 3, 0)),
    )  # fmt: skip

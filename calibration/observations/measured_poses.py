"""The target's pose in the camera of views that measure it in space: given as a pose, or by points.

Points are linear in a small motion of the pose, so that their likelihood is that of the pose that fits them best with
the covariance of that fit. Their noise has two levels, across the line of sight and along it, and is estimated from
the distances that the rigid target leaves: m points leave 2 m - 3 numbers across and m - 3 along the sight.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.errors import UndeterminedError
from calibration.linear_algebra import scaled_inverse
from calibration.observations.observations import UnusableReason, rigid_mask
from calibration.problem import MeasuredPoints, MeasuredPose, Problem, View
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, map_points, skew, transform, transform_from_vector

MIN_POINTS = 3
"""Three points that are not on a line determine a pose."""

MIN_WIDTH_SHARE = 1e-3
"""Least width of the points over their length; below it they lie on a line."""

MAX_SIZE_RATIO = 1.5
"""Measured over described size of the target beyond which its description or the unit is wrong."""

UNITS = (("metres", 1e-3), ("centimetres", 0.1), ("inches", 1 / 25.4), ("micrometres", 1e3))
"""Units that lengths may be in by mistake, and their number per millimetre."""

MAX_UNIT_ERROR = 0.15
"""Relative distance of a ratio of lengths from that of a unit up to which it names the unit."""

OUTLIER_SIGMA = 5.0
"""A point further than this from where the rigid target puts it is not used."""

ROUNDS, ROBUST_ROUNDS = 6, 12
MIN_DEVIATION_MM = 1e-4
"""Floor of the noise of points, below the resolution of any camera."""

CHI2_MEDIANS = (1.386, 0.455)
"""Medians of chi-square with two degrees of freedom and with one."""

MIN_LEVEL_RATIO = 0.1
"""Least ratio of the two levels at first: of few points one may be small by chance."""

FEW_ALONG = 6
"""Fewer surplus numbers along the sight than this do not give a level of their own."""


@dataclass(frozen=True, eq=False)
class MeasuredViews:
    """n views with the target's pose in the camera.

    positions : (n,) in `problem.views`.
    base_T_flange, camera_T_target : (n, 4, 4).
    covariance : (n, 6, 6) of [rotation vector rad, translation of the target's origin mm] along the camera's axes; None
        where it is not known.
    points_mm : noise of measured points across and along the line of sight (2,), None without points.
    size_ratio : measured over described distances on the target, 1 without points.
    left_out : number of points that contradict the others of their view.
    """

    positions: NDArray[np.intp]
    base_T_flange: Array
    camera_T_target: Array
    covariance: Array | None
    points_mm: Array | None = None
    size_ratio: float = 1.0
    left_out: int = 0

    def __len__(self) -> int:
        return len(self.positions)


def measured_views(problem: Problem) -> tuple[MeasuredViews, dict[int, UnusableReason]]:
    """The usable views, and the reason by position in `problem.views` for the others.

    Raises UndeterminedError where the points are in another unit than the target.
    """
    refused = unusable_views(problem)
    kept = [position for position in range(len(problem.views)) if position not in refused]
    measured = [problem.views[position].measured for position in kept]
    poses = np.array([problem.views[position].base_T_flange for position in kept], float).reshape(-1, 4, 4)
    positions = np.array(kept, np.intp)
    points = [one for one in measured if isinstance(one, MeasuredPoints)]
    if points:
        return _from_points(problem, positions, poses, points), refused
    seen = [one for one in measured if isinstance(one, MeasuredPose)]
    camera_T_target = np.array([one.camera_T_target for one in seen], float).reshape(-1, 4, 4)
    known = [one.covariance for one in seen if one.covariance is not None]
    covariance = np.array(known, float) if known and len(known) == len(seen) else None
    return MeasuredViews(positions, poses, camera_T_target, covariance), refused


def unusable_views(problem: Problem) -> dict[int, UnusableReason]:
    """Why views hold no pose of the target, by position in `problem.views`."""
    return {position: why for position, view in enumerate(problem.views) if (why := _refusal(problem, view))}


def _refusal(problem: Problem, view: View) -> UnusableReason | None:
    if not _rigid(view.base_T_flange):
        return UnusableReason("pose-not-rigid", Sentence("pose-not-rigid"))
    match view.measured:
        case None:
            return UnusableReason(*(view.missing or ("target-not-found", Sentence("target-not-measured"))))
        case MeasuredPose(camera_T_target):
            if not _rigid(camera_T_target):
                return UnusableReason("camera-pose-not-rigid", Sentence("camera-pose-not-rigid"))
        case MeasuredPoints(ids, points_mm):
            return _points_refusal(problem, ids, points_mm)
    return None


def _rigid(a_T_b: Array) -> bool:
    pose = np.asarray(a_T_b, float)[None]
    return bool(np.all(np.isfinite(pose))) and bool(rigid_mask(pose)[0])


def _points_refusal(problem: Problem, ids: NDArray[np.intp], points_mm: Array) -> UnusableReason | None:
    last = len(problem.target.points_mm) - 1
    if len(ids) != len(points_mm) or not np.all(np.isfinite(points_mm)):
        return UnusableReason("points-damaged", Sentence("points-damaged", ids=len(ids), points=len(points_mm)))
    if len(ids) and not (int(np.min(ids)) >= 0 and int(np.max(ids)) <= last):
        return UnusableReason("corner-id-unknown", Sentence("point-id-unknown", last=last))
    if len(set(ids.tolist())) < len(ids):
        return UnusableReason("corner-id-repeated", Sentence("point-id-repeated"))
    if len(ids) < MIN_POINTS:
        return UnusableReason("too-few-points", Sentence("too-few-points", points=len(ids), least=MIN_POINTS))
    if _on_a_line(problem.target.points_mm[ids]) or _on_a_line(points_mm):
        return UnusableReason("points-on-a-line", Sentence("points-on-a-line"))
    return None


def _on_a_line(points: Array) -> bool:
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[1] <= MIN_WIDTH_SHARE * spread[0])


def _from_points(
    problem: Problem, positions: NDArray[np.intp], poses: Array, measured: list[MeasuredPoints]
) -> MeasuredViews:
    drawn = [problem.target.points_mm[one.ids] for one in measured]
    seen = [np.asarray(one.points_mm, float) for one in measured]
    ratio = float(np.median([_size(there) / _size(here) for here, there in zip(drawn, seen, strict=True)]))
    require_unit(ratio, "points", "the measured points are", "points_mm")
    whole = sum(map(len, seen))
    fitted = [_robust_pose(here, there) for here, there in zip(drawn, seen, strict=True)]
    deviations = _robust_deviations(drawn, seen, fitted)
    for _ in range(ROUNDS):
        kept = [_agreeing(*one, deviations) for one in zip(drawn, seen, fitted, strict=True)]
        here = [points[mask] for points, mask in zip(drawn, kept, strict=True)]
        there = [points[mask] for points, mask in zip(seen, kept, strict=True)]
        fitted = [_refined(*one, deviations) for one in zip(here, there, fitted, strict=True)]
        deviations = _deviations(here, there, fitted)
    covariance = np.array([_covariance(*one, deviations) for one in zip(here, fitted, strict=True)])
    left_out = whole - sum(map(len, here))
    return MeasuredViews(positions, poses, np.array(fitted), covariance, deviations, ratio, left_out)


def require_unit(ratio: float, name: str, what: str, field: str) -> None:
    """Raises UndeterminedError `<name>-in-<unit>` where a ratio of lengths is that of a unit, `<name>-size` beyond."""
    for unit, count in UNITS:
        if abs(np.log(ratio / count)) < MAX_UNIT_ERROR:
            fix = Sentence("multiply-lengths", factor=1 / count, field=field)
            raise UndeterminedError(f"{name}-in-{unit}", Sentence("lengths-in-unit", what=what, unit=unit), fix)
    if abs(np.log(ratio)) > np.log(MAX_SIZE_RATIO):
        raise UndeterminedError(
            f"{name}-size",
            Sentence("lengths-of-size", what=what, ratio=ratio),
            Sentence("check-target-and-unit", field=field),
        )


def rigid_pose(here: Array, there: Array, weights: Array) -> Array:
    """The pose (4, 4) that maps points `here` (m, 3) to `there` with least squares, weighted (m,).

    K. Arun, T. Huang & S. Blostein, "Least-squares fitting of two 3-D point sets", PAMI 9(5), 1987.
    """
    weights = weights / weights.sum()
    centre, other = weights @ here, weights @ there
    u, _, vt = np.linalg.svd((there - other).T @ (weights[:, None] * (here - centre)))
    rotation = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return transform(rotation, other - rotation @ centre)


def _robust_pose(here: Array, there: Array) -> Array:
    """As `rigid_pose`, with points far from the pose of little weight (S. Geman & D. McClure, 1987)."""
    weights = np.ones(len(here))
    for _ in range(ROBUST_ROUNDS):
        pose = rigid_pose(here, there, weights)
        apart = np.linalg.norm(map_points(pose, here) - there, axis=1)
        weights = 1 / (1 + (apart / max(2 * float(np.median(apart)), MIN_DEVIATION_MM)) ** 2) ** 2
    return pose


def _size(points: Array) -> float:
    return float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))


def _robust_deviations(drawn: list[Array], seen: list[Array], fitted: list[Array]) -> Array:
    """The two levels (2,) by the medians of squares, whose distributions have two degrees of freedom and one."""
    rows = zip(drawn, seen, fitted, strict=True)
    squares = [_split(map_points(pose, here) - there, _sight(there)) for here, there, pose in rows]
    across, along = (np.concatenate([one[part] for one in squares]) for part in (0, 1))
    levels: Array = np.sqrt([np.median(across) / CHI2_MEDIANS[0], np.median(along) / CHI2_MEDIANS[1]])
    return np.maximum(levels, max(float(levels.max()) * MIN_LEVEL_RATIO, MIN_DEVIATION_MM))


def _sight(points: Array) -> Array:
    """Unit vectors (m, 3) along the lines of sight."""
    directions: Array = points / np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 1e-9)
    return directions


def _split(apart: Array, sight: Array) -> tuple[Array, Array]:
    """Squares (m,) across and along the sight."""
    along = np.sum(apart * sight, axis=1) ** 2
    return np.sum(apart**2, axis=1) - along, along


def _agreeing(here: Array, there: Array, pose: Array, deviations: Array) -> NDArray[np.bool_]:
    """Mask (m,) of the points that agree with the pose; all when too few would remain."""
    across, along = _split(map_points(pose, here) - there, _sight(there))
    kept: NDArray[np.bool_] = across / deviations[0] ** 2 + along / deviations[1] ** 2 < OUTLIER_SIGMA**2
    if np.count_nonzero(kept) < MIN_POINTS or _on_a_line(here[kept]):
        return np.ones(len(here), bool)
    return kept


def _weighted(pose: Array, here: Array, deviations: Array) -> tuple[Array, Array]:
    """Points in the camera (m, 3) and their information matrices (m, 3, 3)."""
    points = map_points(pose, here)
    sight = _sight(points)
    along = sight[:, :, None] * sight[:, None, :]
    return points, (np.eye(3) - along) / deviations[0] ** 2 + along / deviations[1] ** 2


def _derivative(points: Array) -> Array:
    """(m, 3, 6) of points by a motion [rotation, translation] of their pose in the camera."""
    return np.concatenate([-skew(points), np.broadcast_to(np.eye(3), (len(points), 3, 3))], axis=2)


def _refined(here: Array, there: Array, pose: Array, deviations: Array) -> Array:
    """One Gauss-Newton step with the points' two levels of noise."""
    points, information = _weighted(pose, here, deviations)
    slopes = _derivative(points)
    weighted = np.swapaxes(slopes, 1, 2) @ information
    gradient = (weighted @ (points - there)[..., None]).sum(axis=0)
    step = -scaled_inverse((weighted @ slopes).sum(axis=0)) @ gradient[:, 0]
    moved: Array = transform_from_vector(step) @ pose
    return moved


def _deviations(drawn: list[Array], seen: list[Array], fitted: list[Array]) -> Array:
    """The two levels (2,) from all views: squares over the numbers that the poses leave."""
    squares, surplus = np.zeros(2), np.zeros(2)
    for here, there, pose in zip(drawn, seen, fitted, strict=True):
        points = map_points(pose, here)
        squares += [float(part.sum()) for part in _split(points - there, _sight(points))]
        surplus += [2 * len(here) - 3, len(here) - 3]
    if surplus[1] < FEW_ALONG:
        squares, surplus = np.full(2, squares.sum()), np.full(2, surplus.sum())
    levels: Array = np.maximum(np.sqrt(squares / np.maximum(surplus, 1.0)), MIN_DEVIATION_MM)
    return levels


def _covariance(here: Array, pose: Array, deviations: Array) -> Array:
    """(6, 6) of [rotation, translation of the target's origin] along the camera's axes."""
    points, information = _weighted(pose, here, deviations)
    slopes = _derivative(points - pose[:3, 3])
    return scaled_inverse((np.swapaxes(slopes, 1, 2) @ information @ slopes).sum(axis=0))

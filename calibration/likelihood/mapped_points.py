"""The points that matter: where the uncertainty of a point mapped through X is evaluated.

The standard deviation of a measured point is the root of the trace of its covariance (3, 3), over the three axes
together; U is COVERAGE_FACTOR (2) times it: at least 95 % of normal errors are smaller.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from calibration.camera import CameraModel
from calibration.problem import Problem, Setup
from calibration.solution import ArmScale, NamedPoint, PointUncertainty, Solution, used_views
from calibration.transforms import Array, inverse, map_points, skew

MAX_LISTED_POINTS = 27
"""Of more points the most uncertain ones are listed."""

WORKING_VOLUME_NAMES = tuple(
    f"{depth} {row} {column}"
    for depth, row, column in product(
        ("near", "middle", "far"), ("top", "middle", "bottom"), ("left", "middle", "right")
    )
)
"""Names of the working volume's points, in their order: distance, row and column of the image."""


def box_points(box_mm: Array) -> tuple[NamedPoint, ...]:
    """The corners of a box [lower, upper] (2, 3) in the base: the variance, convex in the point, is largest there."""
    return tuple(
        NamedPoint(f"box corner {number}", "base", _triple(box_mm[list(upper), range(3)]))
        for number, upper in enumerate(product((0, 1), repeat=3), start=1)
    )


def point_rows(points_mm: Array) -> Array:
    """Derivative (n, 3, 6) of points (n, 3) mapped through X, by [rotation rad, translation mm] of X @ exp(.)."""
    return np.concatenate([-skew(points_mm), np.eye(3)[None].repeat(len(points_mm), axis=0)], axis=-1)


def point_sigmas_mm(covariance: Array, points_mm: Array) -> Array:
    """Standard deviations (n,) of points (n, 3) of the camera's frame; infinite where X is not determined."""
    if not np.all(np.isfinite(covariance)):
        return np.full(len(points_mm), np.inf)
    rows = point_rows(points_mm)
    return np.asarray(np.sqrt(np.maximum(np.einsum("nij,jk,nik->n", rows, covariance, rows), 0.0)))


def scale_variance_mm2(scale: ArmScale, camera_mm: Array) -> float:
    """What the arm's millimetre adds to the variance, over three axes, of a cloud's point (3,) of the camera's frame.

    The scanner's millimetres are taken as true, X is in the arm's, and the cloud is not scaled: the point is off by
    the logarithm of the arm's scale times itself, which has a mean, a variance and a covariance with X.
    """
    squared = float(camera_mm @ camera_mm) * (scale.variance + scale.log**2)
    return squared + 2 * float(camera_mm @ (point_rows(camera_mm[None])[0] @ scale.with_x))


def working_volume_uncertainty(covariance: Array, points_mm: Array) -> tuple[PointUncertainty, ...]:
    """The uncertainty at points (n, 3) of the camera's frame; of more than MAX_LISTED_POINTS the largest ones."""
    sigmas = point_sigmas_mm(covariance, points_mm)
    named = len(points_mm) == len(WORKING_VOLUME_NAMES)
    names = WORKING_VOLUME_NAMES if named else [f"point {row + 1}" for row in range(len(points_mm))]
    listed = np.sort(np.argsort(-sigmas, kind="stable")[:MAX_LISTED_POINTS])
    places = [_triple(point_mm) for point_mm in points_mm]
    return tuple(PointUncertainty(names[row], "camera", places[row], places[row], float(sigmas[row])) for row in listed)


def at_points(problem: Problem, solution: Solution, points: Sequence[NamedPoint]) -> Solution:
    """The solution with its uncertainty at `points` in place of the working volume; unchanged without any, or X."""
    poses = np.array([problem.anchor_T_mount(view) for view in used_views(problem, solution)])
    return with_points(solution, points, poses)


def with_points(solution: Solution, points: Sequence[NamedPoint], anchor_T_mount: Array) -> Solution:
    """As `at_points`, from anchor_T_mount (n, 4, 4) of the views."""
    if not points or solution.uncertainty is None or solution.mount_T_camera is None:
        return solution
    covariance, x = solution.uncertainty.covariance, solution.mount_T_camera
    at = named_points_uncertainty(covariance, points, solution.setup, x, anchor_T_mount, solution.camera)
    return replace(solution, uncertainty=replace(solution.uncertainty, points=at))


def named_points_uncertainty(
    covariance: Array,
    points: Sequence[NamedPoint],
    setup: Setup,
    mount_T_camera: Array,
    anchor_T_mount: Array,
    camera: CameraModel | None,
) -> tuple[PointUncertainty, ...]:
    """The uncertainty at `points`, from the covariance (6, 6) of X and the views' anchor_T_mount (n, 4, 4).

    With the camera on the flange a point of the base is where the views saw it in the camera's frame, and the largest
    of their uncertainties counts; those that had it in the image, if any did.
    """
    found = []
    for point in points:
        seen_mm = camera_points_mm(point, setup, mount_T_camera, anchor_T_mount, camera)
        sigmas = point_sigmas_mm(covariance, seen_mm)
        worst = int(np.argmax(sigmas))
        found.append(PointUncertainty(**vars(point), camera_mm=_triple(seen_mm[worst]), sigma_mm=float(sigmas[worst])))
    return tuple(found)


def camera_points_mm(
    point: NamedPoint, setup: Setup, mount_T_camera: Array, anchor_T_mount: Array, camera: CameraModel | None
) -> Array:
    """A point in the camera's frame (n, 3), from each view that had it in the image (all, when none had)."""
    if point.frame == "camera":
        return np.array([point.position_mm])
    base_T_camera = anchor_T_mount @ mount_T_camera if setup == "eye-in-hand" else mount_T_camera[None]
    seen_mm = map_points(inverse(base_T_camera), np.array([point.position_mm]))[:, 0]
    if camera is None:
        return seen_mm
    with np.errstate(invalid="ignore", over="ignore"):
        pixels = camera.project(seen_mm)
        inside = np.all((pixels >= 0) & (pixels <= np.array(camera.image_size) - 1), axis=1)
    return seen_mm[inside] if inside.any() else seen_mm


def _triple(position_mm: Array) -> tuple[float, float, float]:
    x, y, z = position_mm.tolist()
    return x, y, z

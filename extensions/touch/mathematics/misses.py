"""The touch test: where the camera sees points, beside where a tip of known place has touched them, in the base.

The miss of point i is d_i = touched_i - seen_i. Its errors are those of X and of the tip, of the robot's poses and of
placing the tip. Errors that several points share (X, the tip, the pose of one look) have derivatives J and one
covariance C:

    cov d = blockdiag(own_i) + sum over shared errors of J C J'

Two questions are answered. Whether the misses are those that all stated uncertainties explain: d' (cov d)^-1 d has the
chi-square distribution with 3 n degrees of freedom. And whether the camera's points lie within a tolerance of where the
robot finds them: here the miss measures the error of X, so that the uncertainty of this measurement is that of
everything but X. Conformance is decided as by ISO 14253-1: within when |d| + U <= tolerance, beyond when |d| - U >
tolerance, else undecided.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from calibration.documents.touch_test import Conformance
from calibration.errors import GeometryError
from calibration.likelihood.mapped_points import point_rows
from calibration.linear_algebra import squared_distances
from calibration.solution import COVERAGE_FACTOR
from calibration.transforms import Array, map_points, skew

FALSE_ALARM_PROBABILITY = 0.01
"""Probability that misses which are as large as stated are called larger."""

MAX_COORDINATE_MM = 1e6


@dataclass(frozen=True, eq=False)
class SharedError:
    """An error that several points have: derivatives (n, 3, k) of the points by it, in the base, covariance (k, k)."""

    rows: Array
    covariance: Array

    def of_points(self) -> Array:
        """Covariance (3 n, 3 n) of the points."""
        flat = self.rows.reshape(-1, self.rows.shape[-1])
        covariance: Array = flat @ self.covariance @ flat.T
        return covariance


@dataclass(frozen=True, eq=False)
class TouchTest:
    """The misses (n, 3) in mm and what they mean.

    expanded_mm : (n,) U (k = 2) of each miss as a measurement of X's error: of the tip, the robot, placing the tip.
    claimed_mm : (n,) U of each miss with that of X: what it may be when X is as good as it claims.
    probability : that errors as claimed make misses as large as all of these together.
    agree : whether that is at least FALSE_ALARM_PROBABILITY.
    outlying : (n,) points whose miss alone is larger than claimed.
    conformance : against `tolerance_mm`, of the points together; None without one.
    """

    base_miss_mm: Array
    expanded_mm: Array
    claimed_mm: Array
    probability: float
    agree: bool
    outlying: NDArray[np.bool_]
    tolerance_mm: float | None
    conformance: Conformance | None

    @property
    def lengths_mm(self) -> Array:
        """Lengths (n,) of the misses."""
        lengths: Array = np.linalg.norm(self.base_miss_mm, axis=1)
        return lengths

    @property
    def base_mean_mm(self) -> Array:
        """Mean miss (3,): what a shift of the base, of X or of the tip would make."""
        mean: Array = self.base_miss_mm.mean(axis=0)
        return mean


def mapping_error(base_T_mount: Array, mount_T_camera: Array, camera_mm: Array, covariance: Array) -> SharedError:
    """Error of points (n, 3) of the camera's frame, seen from base_T_mount (n, 4, 4), by the covariance (6, 6) of X."""
    return SharedError((base_T_mount @ mount_T_camera)[:, :3, :3] @ point_rows(camera_mm), covariance)


def pose_error(base_T_flange: Array, flange_mm: Array, rotation_rad: float, translation_mm: float) -> SharedError:
    """Error of points (n, 3) of the flange's frame by one error of its pose (n, 4, 4), standard deviations per axis."""
    rotations = base_T_flange[:, :3, :3]
    rows = np.concatenate([-rotations @ skew(flange_mm), rotations], axis=-1)
    return SharedError(rows, np.diag([rotation_rad**2] * 3 + [translation_mm**2] * 3))


def tip_error(base_T_flange: Array, covariance: Array) -> SharedError:
    """Error of points touched in the poses (n, 4, 4) by the covariance (3, 3) of the tip in the flange's frame."""
    return SharedError(base_T_flange[:, :3, :3], covariance)


def seen_points_mm(base_T_mount: Array, mount_T_camera: Array, camera_mm: Array) -> Array:
    """Points (n, 3) of the camera's frame in the base, each seen from base_T_mount (n, 4, 4)."""
    return map_points(base_T_mount @ mount_T_camera, camera_mm[:, None])[:, 0]


def evaluate_touch_test(
    base_seen_mm: Array,
    base_touched_mm: Array,
    mapping: SharedError,
    shared: Sequence[SharedError],
    own: Array,
    tolerance_mm: float | None = None,
) -> TouchTest:
    """The touch test of points (n, 3), n >= 1: `mapping` is the error of X, `shared` and `own` (n, 3, 3) all others.

    Raises GeometryError for no points, numbers that are not finite, no tolerance above 0, or errors
    besides X's that are all zero along some axis.
    """
    points = np.stack([np.asarray(base_seen_mm, float), np.asarray(base_touched_mm, float)])
    if not points.size:
        raise GeometryError("no point was touched")
    if not np.all(np.abs(points) <= MAX_COORDINATE_MM):
        raise GeometryError("a point is not finite, or further away than 1 km")
    if tolerance_mm is not None and not 0 < tolerance_mm < np.inf:
        raise GeometryError(f"a tolerance of {tolerance_mm} mm is not possible")
    misses = points[1] - points[0]
    n = len(misses)
    check = scipy.linalg.block_diag(*own) + sum(error.of_points() for error in shared)
    claimed = check + mapping.of_points()
    if not np.all(np.abs(claimed) <= MAX_COORDINATE_MM**2):
        raise GeometryError("an uncertainty is not finite, or larger than 1 km")
    if np.any(np.diagonal(check) <= 0):
        raise GeometryError("a point without any uncertainty cannot be judged: state that of placing the tip")
    blocks = _blocks(claimed)
    squared = float(squared_distances(misses.ravel(), claimed))
    probability = float(scipy.special.chdtrc(3 * n, squared))
    alone = scipy.special.chdtrc(3, squared_distances(misses, blocks))
    expanded = _expanded_mm(_blocks(check))
    return TouchTest(
        misses, expanded, _expanded_mm(blocks), probability, probability >= FALSE_ALARM_PROBABILITY,
        alone < FALSE_ALARM_PROBABILITY / n, tolerance_mm,
        None if tolerance_mm is None else _conformance(np.linalg.norm(misses, axis=1), expanded, tolerance_mm),
    )  # fmt: skip


def _blocks(covariance: Array) -> Array:
    """The points' own covariances (n, 3, 3) out of that of all (3 n, 3 n)."""
    n = len(covariance) // 3
    points = np.arange(n)
    blocks: Array = covariance.reshape(n, 3, n, 3)[points, :, points]
    return blocks


def _expanded_mm(covariances: Array) -> Array:
    expanded: Array = COVERAGE_FACTOR * np.sqrt(np.trace(covariances, axis1=-2, axis2=-1))
    return expanded


def _conformance(lengths_mm: Array, expanded_mm: Array, tolerance_mm: float) -> Conformance:
    if np.any(lengths_mm - expanded_mm > tolerance_mm):
        return "beyond"
    return "within" if np.all(lengths_mm + expanded_mm <= tolerance_mm) else "undecided"

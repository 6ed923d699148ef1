"""What leaving out views says of the estimate: outlying views, the error of prediction, a second uncertainty.

The solution without a view is one Newton step away from that of all views. It is exact for the linearised model: the
view's part is subtracted from the normal equations.

Cross-validation predicts each view by the solution of the others. Two errors are computed:

- base error: the target points through the view's own camera_T_target (from its pixels alone), X of the rest and the
  robot's pose as reported, against the target's pose of the rest; RMS distance in the anchor (base or flange), mm;
- reprojection: the target of the rest, through the robot's pose as reported and X of the rest, in px.

Leaving out groups of neighbouring views gives an uncertainty of X that assumes no noise model. Under the model the
solution without group g differs from the solution by b_g, with the covariances

    cov(b_g, b_g) = C_g - C        cov(b_g, b_h) = C_g (F - F_g - F_h) C_h - C

where F = C^-1 is the information of all views, F_g that of the group and C_g = (F - F_g)^-1. Errors that neighbouring
views share (a lens, light or a robot's geometry beyond the model) make the b_g larger than that. The ratio of the
observed to the expected sum of squares of a point is compared with its distribution under the model, chi-square
with the degrees of freedom of the same expected variance (Satterthwaite). A ratio from few groups scatters, so it
counts only where it is significant.
Source: H. Kuensch, "The jackknife and the bootstrap for general stationary observations", Ann. Statist. 17, 1989.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.likelihood.chain import Chain
from calibration.likelihood.distributions import f_tail
from calibration.likelihood.estimate import Estimate, exact_pixels
from calibration.likelihood.mixed_model import per_view_equations
from calibration.linear_algebra import covariance_of, squared_distances
from calibration.observations.observations import Observations
from calibration.observations.pose_model import derivative_by_shared, pose_residuals
from calibration.observations.reprojection import PixelStatistics, pixel_statistics
from calibration.observations.view_poses import apply_pose_steps
from calibration.problem import anchor_T_mount_of
from calibration.solution import GroupedBy, HoldOutDocument, LeaveOutDocument
from calibration.transforms import Array, map_points


@dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """`b` (n, p): step from the estimate to the solution of the other views; `covariance` (n, p, p) of that."""

    b: Array
    covariance: Array


def leave_one_out(best: Estimate) -> LeaveOneOut:
    """For every view the solution of the others."""
    step = best.step
    information, gradient = per_view_equations(best.model, best.variances, step)
    covariance = covariance_of(step.information - information)
    return LeaveOneOut(-(covariance @ (step.gradient - gradient)[..., None])[..., 0] - step.b, covariance)


def squared_view_distances(best: Estimate) -> Array:
    """Squared Mahalanobis distance (n,) of each view's own pose from its prediction by the others; 6 dof."""
    left_out, by_shared = leave_one_out(best), derivative_by_shared(best.chain.camera_T_target())
    information, gradient = per_view_equations(best.model, best.variances, best.step)
    gradient = gradient + (information @ (left_out.b + best.step.b)[..., None])[..., 0]
    # The derivative of a view's pose by X is -1 in the camera's frame, so X's block is the pose's own information.
    own = covariance_of(information[:, :6, :6])
    off = (own @ gradient[:, :6, None])[..., 0]
    spread = own + by_shared @ left_out.covariance[:, :12, :12] @ np.swapaxes(by_shared, 1, 2)
    return squared_distances(off, spread)


def squared_outside_distances(best: Estimate, seen: Observations, camera_T_target: Array) -> Array:
    """The same (k,) for views that are not part of the estimate, from their own poses (k, 4, 4)."""
    chain = best.chain.for_poses(seen.base_T_flange)
    expected = chain.camera_T_target()
    off = pose_residuals(camera_T_target, expected)
    own = covariance_of(pixel_statistics(seen, best.camera, camera_T_target).normal / best.variances.pixel)
    by_robot = chain.correction_jacobian(expected) * best.variances.deviations()
    by_shared = derivative_by_shared(expected)
    spread = own + by_robot @ np.swapaxes(by_robot, 1, 2)
    spread += by_shared @ best.step.covariance[:12, :12] @ np.swapaxes(by_shared, 1, 2)
    return squared_distances(off, spread)


MIN_PREDICTING_VIEWS = 4
"""Least views of a cross-validation; two views do not determine X."""


def hold_out(seen: Observations, best: Estimate, camera_T_target: Array) -> HoldOutDocument | None:
    """RMS errors over all points of all views, each predicted by the others; None below four views.

    `camera_T_target` (n, 4, 4): each view's own pose, by its pixels alone and the estimated camera.
    """
    if len(seen) < MIN_PREDICTING_VIEWS:
        return None
    left_out = leave_one_out(best)
    # Of each view X and Y of the other views, and the robot's poses as reported.
    chain = best.chain.apply_step(left_out.b[:, :12], np.zeros_like(best.chain.corrections))
    assert best.nuisances is not None
    pixels = exact_pixels(seen, best.nuisances)
    alone = pixels(camera_T_target, best.z).normal
    towards = (alone[:, :6, 6:] @ left_out.b[:, 12 : 6 + alone.shape[1], None])[..., 0]
    own = -np.asarray(np.linalg.solve(alone[:, :6, :6], towards[..., None])[..., 0])  # at the others' intrinsics
    errors = base_errors(best.seen(seen), chain, apply_pose_steps(camera_T_target, own))
    predicted = pixels(chain.camera_T_target(), best.z)
    used = seen.weights > 0
    # The corners of one view have the same weight: divide by it to undo the weighting.
    per_view = 1 / np.maximum(seen.weights.max(axis=1), 1e-300)
    corners = float(np.count_nonzero(used))
    return HoldOutDocument(
        float(np.sqrt(np.sum(used * np.sum(errors**2, axis=-1)) / corners)),
        float(np.sqrt(np.sum(per_view * _squares(predicted, left_out)) / corners)),
    )


def base_errors(seen: Observations, chain: Chain, camera_T_target: Array) -> Array:
    """The target's points by each view's own pose minus by the chain, in the anchor (n, m, 3), mm."""
    anchor_T_mount = anchor_T_mount_of(chain.setup, chain.corrected_base_T_flange())
    by_view = map_points(anchor_T_mount @ chain.mount_T_camera @ camera_T_target, seen.points_mm)
    errors: Array = by_view - map_points(chain.anchor_T_target, seen.points_mm)
    return errors


def _squares(statistics: PixelStatistics, left_out: LeaveOneOut) -> Array:
    """Each view's sum of squared residuals (n,) at the intrinsics of the other views."""
    k = left_out.b[:, 12 : 6 + statistics.normal.shape[1]]
    towards = (statistics.normal[:, 6:, 6:] @ k[..., None])[..., 0]
    squares: Array = statistics.square + np.sum((2 * statistics.gradient[:, 6:] + towards) * k, axis=1)
    return squares


MIN_GROUPED_VIEWS = 8
"""Least views for groups: four of two."""

FEW_GROUPS, MANY_GROUPS, MAX_GROUPS = 4, 8, 24
MIN_VIEWS_OF_MANY = 16

PRIOR_BEYOND_MODEL = 0.1
"""Prior probability of errors beyond the model that neighbouring views share."""

FALSE_ALARM_PROBABILITY = 0.01
"""Probability of a share above 0 in a session that follows the model, over the three groupings."""

GROUPINGS = 3

Groups = Sequence[NDArray[np.intp]]


def leave_groups_out(best: Estimate, camera_T_centre: Array, weights: Array) -> LeaveOutDocument | None:
    """The uncertainty by the grouping that disagrees most with the model; None below MIN_GROUPED_VIEWS views.

    `camera_T_centre` (n, 4, 4): the target's middle in each view; `weights` (6, 6): of a point's squared error.
    """
    if len(camera_T_centre) < MIN_GROUPED_VIEWS:
        return None
    found = [_compare(best, name, groups, weights) for name, groups in _groupings(camera_T_centre)]
    return max(found, key=lambda left_out: (left_out.inflation, left_out.ratio))


def _groupings(camera_T_centre: Array) -> Iterator[tuple[GroupedBy, Groups]]:
    """Groups of views alike in the target's place in the image and in its whole pose in the camera; single views.

    Of more than MAX_GROUPS views, the single ones are small groups of neighbours.
    """
    places = camera_T_centre[:, :3, 3]
    distance = float(np.median(np.linalg.norm(places, axis=1)))
    poses = np.concatenate([2 * places / distance, camera_T_centre[:, :3, :3].reshape(-1, 9) / np.sqrt(2)], axis=1)
    yield "image", split(places[:, :2] / places[:, 2:], FEW_GROUPS)
    yield "pose", split(poses, MANY_GROUPS if len(places) >= MIN_VIEWS_OF_MANY else FEW_GROUPS)
    yield "view", split(poses, min(len(places), MAX_GROUPS))


def split(features: Array, count: int) -> Groups:
    """The rows of (n, d) in `count` groups of neighbours: the largest is halved across its longest direction."""
    groups = [np.arange(len(features))]
    while len(groups) < count:
        groups.sort(key=len)
        largest = groups.pop()
        off = features[largest] - features[largest].mean(axis=0)
        order = np.argsort(off @ np.linalg.svd(off, full_matrices=False)[2][0], kind="stable")
        half = len(largest) // 2
        groups += [largest[order[:half]], largest[order[half:]]]
    return groups


def _compare(best: Estimate, name: GroupedBy, groups: Groups, weights: Array) -> LeaveOutDocument:
    information, gradient = per_view_equations(best.model, best.variances, best.step)
    total, all_gradient = best.step.information, best.step.gradient
    covariance = covariance_of(total)
    views = len(information)
    parts = np.array([information[rows].sum(axis=0) for rows in groups])
    without = covariance_of(total - parts)
    towards = all_gradient - np.array([gradient[rows].sum(axis=0) for rows in groups])
    steps = (covariance @ all_gradient - (without @ towards[..., None])[..., 0])[:, :6]
    between = without[:, None] @ (total - parts[:, None] - parts[None]) @ without[None]
    between[np.arange(len(parts)), np.arange(len(parts))] = without
    expected = (between - covariance)[:, :, :6, :6]  # covariances of the steps of X under the model
    root = np.linalg.cholesky(weights)
    rooted = np.swapaxes(root, 0, 1) @ expected @ root  # (g, g, 6, 6)
    mean = float(np.einsum("ggkk->", rooted))
    redundancy = mean**2 / float(np.sum(rooted**2))
    ratio = float(np.einsum("gi,ij,gj->", steps, weights, steps)) / mean
    # Whether a ratio of this redundancy is rare under the model, whose noise is estimated from the same views.
    significant = GROUPINGS * f_tail(redundancy, 3 * views - 6, ratio) < FALSE_ALARM_PROBABILITY
    share = _share_beyond(ratio, redundancy) if significant else 0.0
    point_mm = float(np.sqrt(ratio * np.sum(weights * covariance[:6, :6])))
    return LeaveOutDocument(point_mm, ratio, redundancy, share, name, len(groups))


def _share_beyond(ratio: float, redundancy: float) -> float:
    """Posterior probability that the ratio is above 1, from the likelihood ratio of a variance."""
    if ratio <= 1:
        return 0.0
    gain = 0.5 * redundancy * (ratio - 1 - np.log(ratio))
    odds = np.log(PRIOR_BEYOND_MODEL / (1 - PRIOR_BEYOND_MODEL)) + gain
    return float(1 / (1 + np.exp(-min(odds, 500.0))))

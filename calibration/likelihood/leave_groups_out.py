"""A second estimate of X's uncertainty, by leaving out groups of neighbouring views, that assumes no noise model.

Under the model the solution without group g differs from the solution by b_g, with the covariances

    cov(b_g, b_g) = C_g - C        cov(b_g, b_h) = C_g (F - F_g - F_h) C_h - C

where F = C^-1 is the information of all views, F_g that of the group and C_g = (F - F_g)^-1. Errors that neighbouring
views share (a lens, light or a robot's geometry beyond the model) make the b_g larger than that. The ratio of the
observed to the expected sum of squares of a mapped point is compared with its distribution under the model, chi-square
with the degrees of freedom of the same expected variance (Satterthwaite). A ratio from few groups scatters, so it
counts only where it is significant.
Source: H. Kuensch, "The jackknife and the bootstrap for general stationary observations", Ann. Statist. 17, 1989.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from calibration.likelihood.distributions import f_tail
from calibration.likelihood.estimate import Estimate
from calibration.likelihood.mixed_model import per_view_equations
from calibration.linear_algebra import covariance_of
from calibration.solution import GroupedBy, LeaveOut
from calibration.transforms import Array

MIN_VIEWS = 8
"""Least views: four groups of two."""

FEW_GROUPS, MANY_GROUPS, MAX_GROUPS = 4, 8, 24
MIN_VIEWS_MANY = 16

PRIOR_BEYOND_MODEL = 0.1
"""Prior probability of errors beyond the model that neighbouring views share."""

FALSE_ALARM_PROBABILITY = 0.01
"""Probability of a share above 0 in a session that follows the model, over the three groupings."""

GROUPINGS = 3

Groups = Sequence[NDArray[np.intp]]


def leave_groups_out(best: Estimate, camera_T_centre: Array, weights: Array) -> LeaveOut | None:
    """The uncertainty by the grouping that disagrees most with the model; None below MIN_VIEWS views.

    `camera_T_centre` (n, 4, 4): the target's middle in each view; `weights` (6, 6): of a mapped point's squared error.
    """
    if len(camera_T_centre) < MIN_VIEWS:
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
    yield "pose", split(poses, MANY_GROUPS if len(places) >= MIN_VIEWS_MANY else FEW_GROUPS)
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


def _compare(best: Estimate, name: GroupedBy, groups: Groups, weights: Array) -> LeaveOut:
    information, gradient = per_view_equations(best.model, best.variances, best.step)
    total, all_gradient = best.step.information, best.step.gradient
    covariance = covariance_of(total)
    views = len(information)
    parts = np.array([information[rows].sum(axis=0) for rows in groups])
    without = covariance_of(total - parts)
    towards = all_gradient - np.array([gradient[rows].sum(axis=0) for rows in groups])
    steps = (covariance @ all_gradient - (without @ towards[..., None])[..., 0])[:, :6]
    expected = _expected(total, parts, without, covariance)
    root = np.linalg.cholesky(weights)
    rooted = np.swapaxes(root, 0, 1) @ expected @ root  # (g, g, 6, 6)
    mean = float(np.einsum("ggkk->", rooted))
    redundancy = mean**2 / float(np.sum(rooted**2))
    ratio = float(np.einsum("gi,ij,gj->", steps, weights, steps)) / mean
    share = _share_beyond(ratio, redundancy) if _is_significant(ratio, redundancy, views) else 0.0
    point_mm = float(np.sqrt(ratio * np.sum(weights * covariance[:6, :6])))
    return LeaveOut(point_mm, ratio, redundancy, share, name, len(groups))


def _is_significant(ratio: float, redundancy: float, views: int) -> bool:
    """Whether a ratio of this redundancy is rare under the model, whose noise is estimated from the same views."""
    chance = f_tail(redundancy, 3 * views - 6, ratio)
    return GROUPINGS * chance < FALSE_ALARM_PROBABILITY


def _expected(total: Array, parts: Array, without: Array, covariance: Array) -> Array:
    """Covariances (g, g, 6, 6) of the steps of X under the model."""
    between = without[:, None] @ (total - parts[:, None] - parts[None]) @ without[None]
    own = np.arange(len(parts))
    between[own, own] = without
    return np.asarray((between - covariance)[:, :, :6, :6])


def _share_beyond(ratio: float, redundancy: float) -> float:
    """Posterior probability that the ratio is above 1, from the likelihood ratio of a variance."""
    if ratio <= 1:
        return 0.0
    gain = 0.5 * redundancy * (ratio - 1 - np.log(ratio))
    odds = np.log(PRIOR_BEYOND_MODEL / (1 - PRIOR_BEYOND_MODEL)) + gain
    return float(1 / (1 + np.exp(-min(odds, 500.0))))

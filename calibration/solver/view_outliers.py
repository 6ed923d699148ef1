"""Rejection of views whose robot pose disagrees with their image and all other views."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.likelihood.chain import Chain
from calibration.likelihood.distributions import f_quantile
from calibration.likelihood.estimate import Estimate, average, estimate, exact_pixels
from calibration.likelihood.leave_out import squared_outside_distances, squared_view_distances
from calibration.likelihood.mixed_model import Variances
from calibration.observations.view_poses import refine_poses
from calibration.preprocessing.prepare import PreparedSession
from calibration.solver.initial_guess import chain_from_mount
from calibration.solver.least_median import agreeing_views
from calibration.transforms import Array

FALSE_ALARM_PROBABILITY = 1e-4
"""Probability of rejecting any view of a clean session, whatever the number of views."""

MAX_ROUNDS = 20


@dataclass(frozen=True, eq=False)
class Selection:
    """The views that agree, `used` (n,), and the estimate from them."""

    used: NDArray[np.bool_]
    best: Estimate

    def widened(self, more: Array) -> "Selection":
        """The same with `more` (12, 12) added to the covariance of X and the target's pose."""
        covariance = self.best.step.covariance.copy()
        covariance[:12, :12] += more
        return replace(self, best=replace(self.best, step=replace(self.best.step, covariance=covariance)))


def agreeing_rows(prepared: PreparedSession) -> NDArray[np.bool_]:
    """A first, robust choice (n,) of views before the estimate; all when no majority agrees."""
    axis = None if prepared.given is None else prepared.given.axis_mount
    agreeing = agreeing_views(prepared.anchor_T_mount, prepared.camera_T_target, prepared.nominal_mm, axis)
    return agreeing if np.count_nonzero(agreeing) >= min_remaining(len(agreeing)) else np.ones(len(agreeing), bool)


def min_remaining(n: int) -> int:
    """The least number of n views that must remain: a majority, and three."""
    return max(3, n // 2 + 1)


def select_views(
    prepared: PreparedSession,
    used: NDArray[np.bool_],
    chain: Chain,
    variances: Variances,
    z: Array | None = None,
    *,
    trend: bool = False,
) -> Selection:
    """Estimate from the `used` views, readmit views that fit, drop the one that fits worst, until nothing changes.

    `chain`, `variances`, `z`: the start. `trend`: part of the robot's errors follows its pose. Returns the final
    choice, averaged over priors and noise levels.
    """
    seen_before: set[bytes] = set()
    changed = used.copy()
    for _ in range(MAX_ROUNDS):
        used = changed
        rows = prepared.take(used)
        pixels = exact_pixels(rows.seen, prepared.nuisances)
        start = chain_from_mount(rows, chain.mount_T_camera)
        best = estimate(pixels, start, variances, prepared.nuisances, z, trend=trend)
        chain, variances, z = best.chain, best.variances, best.z
        seen_before.add(used.tobytes())
        changed = _update_selection(prepared, used, best)
        if np.array_equal(changed, used) or changed.tobytes() in seen_before:
            break
    return Selection(used, average(pixels, best, prepared.belief))


def _update_selection(prepared: PreparedSession, used: NDArray[np.bool_], best: Estimate) -> NDArray[np.bool_]:
    n, changed = len(used), used.copy()
    limit = outlier_limit(int(np.count_nonzero(used)), n)
    if not np.all(used):
        outside = prepared.take(~used)
        seen = best.seen(outside.seen)
        back = (
            squared_outside_distances(best, seen, refine_poses(seen, best.camera, outside.camera_T_target)) / 6 < limit
        )
        if np.any(back):
            changed[np.flatnonzero(~used)[back]] = True
            return changed
    if np.count_nonzero(used) > min_remaining(n):
        distances = squared_view_distances(best) / 6
        if distances.max() > limit:
            changed[np.flatnonzero(used)[np.argmax(distances)]] = False
    return changed


def outlier_limit(used: int, n: int) -> float:
    """Limit of a squared distance / 6 at FALSE_ALARM_PROBABILITY over n views: a quantile of Fisher's F."""
    redundancy = max(3 * used - 6, 3)
    return f_quantile(6, redundancy, FALSE_ALARM_PROBABILITY / n)

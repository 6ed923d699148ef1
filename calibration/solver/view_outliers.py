"""Views whose robot pose disagrees with what their image and all other views say."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from calibration.likelihood.chain import Chain
from calibration.likelihood.estimate import Estimate, averaged_over_noise, estimate, measured
from calibration.likelihood.leave_one_out import disagreement, leave_one_out, outside_disagreement
from calibration.likelihood.mixed_model import Variances
from calibration.preprocessing.prepare import Prepared
from calibration.solver.initial_guess import closed_form_chain
from calibration.solver.least_median import agreeing_views

CHANCE = 1e-4
"""A clean session loses a view this often, whatever the number of views."""

MOST_ROUNDS = 20


@dataclass(frozen=True, eq=False)
class Selection:
    """`used` (n,): the views that agree, and the estimate from them."""

    used: NDArray[np.bool_]
    best: Estimate


def agreeing_rows(prepared: Prepared) -> NDArray[np.bool_]:
    """A first, robust choice (n,) before anything is estimated; all when there is no majority that agrees."""
    agreeing = agreeing_views(prepared.anchor_T_mount, prepared.camera_T_target, prepared.drawn_mm)
    return agreeing if np.count_nonzero(agreeing) >= fewest(len(agreeing)) else np.ones(len(agreeing), bool)


def fewest(n: int) -> int:
    """The least number of views of n that may remain: a majority, and three."""
    return max(3, n // 2 + 1)


def select(prepared: Prepared, used: NDArray[np.bool_], chain: Chain, variances: Variances) -> Selection:
    """Estimate, take back views that fit after all, drop the one that fits least, until nothing changes."""
    seen_before: set[bytes] = set()
    used = used.copy()
    for _ in range(MOST_ROUNDS):
        rows = prepared.take(used)
        pixels = measured(rows.seen, prepared.free)
        start = closed_form_chain(rows, chain.mount_T_camera)
        best = estimate(pixels, prepared.camera, start, variances, prepared.free, prepared.scale, prepared.doubt)
        chain, variances = best.chain, best.variances
        seen_before.add(used.tobytes())
        changed = _changed(prepared, used, best)
        if np.array_equal(changed, used) or changed.tobytes() in seen_before:
            break
        used = changed
    return Selection(used, averaged_over_noise(best))


def _changed(prepared: Prepared, used: NDArray[np.bool_], best: Estimate) -> NDArray[np.bool_]:
    n, changed = len(used), used.copy()
    limit = _limit(int(np.count_nonzero(used)), n)
    if not np.all(used):
        outside = prepared.take(~used)
        back = outside_disagreement(best, outside.seen, outside.camera_T_target) / 6 < limit
        if np.any(back):
            changed[np.flatnonzero(~used)[back]] = True
            return changed
    if np.count_nonzero(used) > fewest(n):
        left_out = leave_one_out(best)
        by_shared = best.chain.by_shared(best.chain.camera_T_target())
        distances = disagreement(best, left_out, by_shared) / 6
        if distances.max() > limit:
            changed[np.flatnonzero(used)[np.argmax(distances)]] = False
    return changed


def _limit(used: int, n: int) -> float:
    """What six normal errors, scaled by an estimate of their own size, exceed by chance alone (Fisher's F)."""
    redundancy = max(3 * used - 6, 3)
    return float(scipy.stats.f.isf(CHANCE / n, 6, redundancy))

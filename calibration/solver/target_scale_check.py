"""Test of the target's size against the robot's travel.

A printer that scales by half a percent, or a mistyped pitch, makes every distance from the camera wrong by the same
share, while the robot's travel is in true millimetres. Only a significant share is adopted, because an unneeded
unknown costs accuracy.
"""

from dataclasses import replace

import numpy as np

from calibration.likelihood.augmented_model import AugmentedModel
from calibration.likelihood.cross_validation import hold_out
from calibration.likelihood.distributions import f_quantile
from calibration.likelihood.mixed_model import solve
from calibration.likelihood.variance_components import estimate_variances
from calibration.observations.reprojection import INTRINSICS
from calibration.preprocessing.prepare import PreparedSession
from calibration.solver.view_outliers import Selection
from calibration.transforms import Array

MIN_VIEWS = 6
FALSE_ALARM_PROBABILITY = 1e-5
MIN_SCALE_ERROR = 2e-4
"""Scale errors below it are ignored; paper changes by as much with humidity."""

PRINT_SCALE_SIGMA = 0.03
"""Half-width of the prior of a print's scale error (Cauchy's): paper and printers make some per cent."""

MAX_SCALE_ERROR = 0.5
"""A scale error above it is a wrong unit of the robot or the target, not a printing error."""


def scale_error(wider: AugmentedModel) -> float:
    """Share by which the target is larger than described (negative: smaller); 0 when it is not significant.

    The further a share is beyond what prints can be, the stronger its evidence has to be.
    """
    best, views = wider.best, len(wider.model.count)
    if views < MIN_VIEWS or best.free[INTRINSICS]:
        return 0.0
    free = best.free.copy()
    free[INTRINSICS] = True
    model = wider.restrict_to(free)
    # A wrong scale inflates the robot's noise, so the noise is estimated again with the scale free.
    step = solve(model, estimate_variances(model, best.variances))
    share, deviation = float(step.b[-1]), float(np.sqrt(step.covariance[-1, -1]))
    probability = FALSE_ALARM_PROBABILITY / (1 + (share / PRINT_SCALE_SIGMA) ** 2)
    significant = abs(share) > deviation * f_quantile(1, 3 * views - 7, probability) ** 0.5
    return share if significant and MIN_SCALE_ERROR < abs(share) < MAX_SCALE_ERROR else 0.0


def predicts_better(scaled: PreparedSession, with_it: Selection, prepared: PreparedSession, without: Selection) -> bool:
    """Whether views left out are predicted better with the scale than without, in pixels.

    Not in millimetres: a smaller target lessens those by itself.
    """
    after, before = (
        hold_out(session.take(chosen.used).seen, chosen.best, session.take(chosen.used).camera_T_target)
        for session, chosen in ((scaled, with_it), (prepared, without))
    )
    after_px, before_px = (None if found is None else found.reprojection_px for found in (after, before))
    return after_px is not None and before_px is not None and after_px < before_px


def with_scale(prepared: PreparedSession, share: float) -> PreparedSession:
    """The session with the target's scale unknown, starting from 1 + `share`."""
    free = prepared.free.copy()
    free[INTRINSICS] = True
    poses: Array = prepared.camera_T_target.copy()
    poses[:, :3, 3] *= 1 + share
    return replace(prepared, free=free, scale=1 + share, camera_T_target=poses)

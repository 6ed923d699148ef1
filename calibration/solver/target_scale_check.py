"""Test of the target's size against the robot's travel.

A printer that scales by half a percent, or a mistyped pitch, makes every distance from the camera wrong by the same
share, while the robot's travel is in true millimetres. Only a significant share is adopted, because an unneeded
unknown costs accuracy.
"""

from dataclasses import replace

import numpy as np
import scipy

from calibration.likelihood.augmented_model import AugmentedModel
from calibration.likelihood.mixed_model import solve
from calibration.likelihood.variance_components import estimate_variances
from calibration.observations.reprojection import INTRINSICS
from calibration.preprocessing.prepare import PreparedSession
from calibration.transforms import Array

MIN_VIEWS = 6
FALSE_ALARM_PROBABILITY = 1e-5
MIN_SCALE_ERROR = 2e-4
"""Scale errors below it are ignored; paper changes by as much with humidity."""

MAX_SCALE_ERROR = 0.5
"""A scale error above it is a wrong unit of the robot or the target, not a printing error."""


def scale_error(wider: AugmentedModel) -> float:
    """Share by which the target is larger than described (negative: smaller); 0 when it is not significant."""
    best, views = wider.best, len(wider.model.count)
    if views < MIN_VIEWS or best.free[INTRINSICS]:
        return 0.0
    free = best.free.copy()
    free[INTRINSICS] = True
    model = wider.restrict_to(free)
    # A wrong scale inflates the robot's noise, so the noise is estimated again with the scale free.
    step = solve(model, estimate_variances(model, best.variances))
    share, deviation = float(step.b[-1]), float(np.sqrt(step.covariance[-1, -1]))
    significant = abs(share) > deviation * float(scipy.stats.t.isf(FALSE_ALARM_PROBABILITY / 2, 3 * views - 7))
    return share if significant and MIN_SCALE_ERROR < abs(share) < MAX_SCALE_ERROR else 0.0


def with_scale(prepared: PreparedSession, share: float) -> PreparedSession:
    """The session with the target's scale unknown, starting from 1 + `share`."""
    free = prepared.free.copy()
    free[INTRINSICS] = True
    poses: Array = prepared.camera_T_target.copy()
    poses[:, :3, 3] *= 1 + share
    return replace(prepared, free=free, scale=1 + share, camera_T_target=poses)

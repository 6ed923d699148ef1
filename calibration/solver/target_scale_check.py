"""Is the target as large as it was said to be? The robot measures it.

A printer that scales by half a percent, or a pitch typed wrong, makes every distance before the camera wrong by the
same share; the robot's travel is in true millimetres and tells. Only a share that is far beyond chance is taken up,
because an unneeded unknown costs accuracy.
"""

from dataclasses import replace

import numpy as np
import scipy

from calibration.likelihood.augmented_model import Widened
from calibration.likelihood.mixed_model import solve
from calibration.likelihood.variance_components import estimate_variances
from calibration.observations.reprojection import INTRINSICS
from calibration.preprocessing.prepare import Prepared
from calibration.transforms import Array

FEWEST_VIEWS = 6
CHANCE = 1e-5
SMALLEST = 2e-4
"""Less than this share is paper that breathes."""

LARGEST = 0.5
"""More than this share is a unit, not a print: the robot's or the target's numbers are not in millimetres."""


def scale_error(wider: Widened) -> float:
    """By what share the target is larger than described (negative: smaller); 0 when that is not beyond doubt."""
    best, views = wider.best, len(wider.model.count)
    if views < FEWEST_VIEWS or best.free[INTRINSICS]:
        return 0.0
    free = best.free.copy()
    free[INTRINSICS] = True
    model = wider.freeing(free)
    # A wrong scale looks like a poor robot: the noise is estimated anew with the scale free.
    step = solve(model, estimate_variances(model, best.variances))
    share, deviation = float(step.b[-1]), float(np.sqrt(step.covariance[-1, -1]))
    beyond_doubt = abs(share) > deviation * float(scipy.stats.t.isf(CHANCE / 2, 3 * views - 7))
    return share if beyond_doubt and SMALLEST < abs(share) < LARGEST else 0.0


def with_scale(prepared: Prepared, share: float) -> Prepared:
    """The same session with the target's scale unknown, starting from the given share."""
    free = prepared.free.copy()
    free[INTRINSICS] = True
    poses: Array = prepared.camera_T_target.copy()
    poses[:, :3, 3] *= 1 + share
    return replace(prepared, free=free, scale=1 + share, camera_T_target=poses)

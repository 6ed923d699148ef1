"""An arm that turns its flange about the vertical only, as a SCARA does: a six-axis arm that refuses to tilt it."""

import numpy as np
from numpy.typing import ArrayLike

from calibration.kinematics.arm import SINGULAR_EXACT, Arm, UnreachablePoseError
from calibration.transforms import Array

TILT_RAD = np.radians(0.1)
"""A taught pose has as many digits as somebody wrote down."""


class ScaraArm(Arm):
    """Takes poses whose flange looks straight down."""

    def branches(
        self, base_T_flange: ArrayLike, near_rad: ArrayLike | None = None, singular: float = SINGULAR_EXACT
    ) -> Array:
        """As of an arm of six axes; raises UnreachablePoseError where the flange would tilt."""
        tilt_rad = np.arccos(np.clip(-np.asarray(base_T_flange, float)[..., 2, 2], -1.0, 1.0)).max()
        if tilt_rad > TILT_RAD:
            what = f"the flange would tilt by {np.degrees(tilt_rad):.1f}°, which a SCARA cannot"
            raise UnreachablePoseError(what, "turn it about the vertical only")
        return super().branches(base_T_flange, near_rad, singular)

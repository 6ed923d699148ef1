"""Arms as built: geometry, gears, sag and play drawn about the drawing, by the class of an arm.

A controller computes poses with the drawing; the flange is where the built arm puts it.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from calibration.kinematics.arm import SINGULAR_EXACT, Arm, UnreachablePoseError
from calibration.kinematics.arm_errors import ArmErrorModel, Group, Postures
from calibration.transforms import Array

ArmClass = Literal["perfect", "calibrated", "standard", "worn"]
ARM_CLASSES: tuple[ArmClass, ...] = get_args(ArmClass)

_SHARES: dict[ArmClass, dict[Group, float]] = {
    "perfect": {},
    "calibrated": {"zeros": 0.15, "links": 0.15, "gears": 0.7, "sag": 0.3, "play": 0.5, "warmth": 1.0},
    "standard": {"zeros": 1.0, "links": 1.0, "gears": 1.0, "sag": 1.0, "play": 0.5, "warmth": 1.0},
    "worn": {"zeros": 2.0, "links": 1.0, "gears": 2.0, "sag": 1.5, "play": 3.0, "warmth": 1.0},
}
"""Standard deviations of each group in units of those of an arm as delivered. `standard`: 0.5 to 1 mm at the flange."""

SWITCHED_ON_C = 20.0
"""Temperature at which an arm is switched on, and has the errors that were drawn."""

MAX_WARMTH_K, WARMING_S = 10.0, 3600.0
"""By how much an arm that runs gets warmer, and after which time it is at 63 % of that; assumed."""


def warmth_k(running_s: float) -> float:
    """Temperature of an arm above that at which it was switched on."""
    return float(MAX_WARMTH_K * -np.expm1(-max(running_s, 0.0) / WARMING_S))


@dataclass(frozen=True, eq=False)
class BuiltArm:
    """An arm with its errors (k,)."""

    model: ArmErrorModel
    errors: Array

    @property
    def drawing(self) -> Arm:
        """The arm as the controller knows it."""
        return self.model.arm

    def base_T_flange(self, postures: Postures) -> Array:
        """Where the flange truly is (n, 4, 4)."""
        return self.model.forward(self.errors, postures)


def build_arm(drawing: Arm, arm_class: ArmClass, seed: int) -> BuiltArm:
    """An arm of that class; the same seed gives the same arm."""
    model = ArmErrorModel(drawing)
    draw = np.random.default_rng([seed, 19]).standard_normal(len(model))
    shares = np.array([_SHARES[arm_class].get(parameter.group, 0.0) for parameter in model.parameters])
    return BuiltArm(model, shares * (model.means + model.sigmas * draw))


TILT_RAD = np.radians(0.1)
"""A taught pose has as many digits as somebody wrote down."""


class ScaraArm(Arm):
    """Turns its flange about the vertical only, as a SCARA does: a six-axis arm that refuses to tilt it."""

    def branches(
        self, base_T_flange: ArrayLike, near_rad: ArrayLike | None = None, singular: float = SINGULAR_EXACT
    ) -> Array:
        """As of an arm of six axes; raises UnreachablePoseError where the flange would tilt."""
        tilt_rad = np.arccos(np.clip(-np.asarray(base_T_flange, float)[..., 2, 2], -1.0, 1.0)).max()
        if tilt_rad > TILT_RAD:
            what = f"the flange would tilt by {np.degrees(tilt_rad):.1f}°, which a SCARA cannot"
            raise UnreachablePoseError(what, "turn it about the vertical only")
        return super().branches(base_T_flange, near_rad, singular)

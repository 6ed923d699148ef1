"""The arm as built, identified from sessions: where its flange is at joints that the controller reports."""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from calibration.kinematics.arm_conditions import ArmConditions
from calibration.kinematics.arm_errors import ArmErrorModel, Postures
from calibration.kinematics.load import NO_LOAD, Load
from calibration.transforms import Array

UNKNOWN_WARMTH_K = 5.0
"""One standard deviation of the temperature of an arm that is not known now; an arm at work warms by about 10 K."""


@dataclass(frozen=True, eq=False)
class ArmEstimate:
    """The arm as built, and X with it.

    parameters : (k,), all zero where no errors were taken up.
    covariance : (6 + k, 6 + k) of [X, as of Uncertainty.covariance; the parameters].
    load : on the flange where the estimate is used; none where it is not known, when its sag is that of own weight.
    temperature_c : of the arm at which the parameters hold; None where it was not recorded.
    warmth_k : temperature of the arm above that, where the estimate is used.
    warmth_sigma_k : one standard deviation of it.
    """

    model: ArmErrorModel
    parameters: Array
    covariance: Array
    mount_T_camera: Array
    load: Load = field(default=NO_LOAD, kw_only=True)
    temperature_c: float | None = field(default=None, kw_only=True)
    warmth_k: float = field(default=0.0, kw_only=True)
    warmth_sigma_k: float = field(default=0.0, kw_only=True)

    def under(self, conditions: ArmConditions) -> Self:
        """The same arm under conditions that may be others than when it was identified.

        It keeps the load and the temperature of then where either is not known; where only that of now is not known,
        it is UNKNOWN_WARMTH_K uncertain.
        """
        load = conditions.load
        load = self.load if load is None or self.load == NO_LOAD or load.is_as(self.load) else load
        if self.temperature_c is None:
            return replace(self, load=load)
        if conditions.temperature_c is None:
            return replace(self, load=load, warmth_k=0.0, warmth_sigma_k=UNKNOWN_WARMTH_K)
        return replace(self, load=load, warmth_k=conditions.temperature_c - self.temperature_c, warmth_sigma_k=0.0)

    def base_T_flange(self, joints_rad: Array) -> Array:
        """Poses (n, 4, 4) of the built arm's flange at joints (n, 6) as reported; sides as not known."""
        return self.model.forward(self.parameters, self.postures(joints_rad))

    def postures(self, joints_rad: Array, sides: Array | None = None) -> Postures:
        """Standstills with its load, at its temperature."""
        return Postures(joints_rad, self.load, sides, np.full(len(joints_rad), self.warmth_k))

"""The arm as built, identified from sessions: where its flange is at joints that the controller reports."""

from dataclasses import dataclass, field

from calibration.kinematics.arm_errors import ArmErrorModel, Postures
from calibration.kinematics.load import NO_LOAD, Load
from calibration.transforms import Array


@dataclass(frozen=True, eq=False)
class ArmEstimate:
    """The arm as built, and X with it.

    parameters : (k,), all zero where no errors were taken up.
    covariance : (6 + k, 6 + k) of [X, as of Uncertainty.covariance; the parameters].
    load : on the flange where the estimate is used; none where it is not known, when its sag is that of own weight.
    """

    model: ArmErrorModel
    parameters: Array
    covariance: Array
    mount_T_camera: Array
    load: Load = field(default=NO_LOAD, kw_only=True)

    def base_T_flange(self, joints_rad: Array) -> Array:
        """Poses (n, 4, 4) of the built arm's flange at joints (n, 6) as reported; sides as not known."""
        return self.model.forward(self.parameters, self.postures(joints_rad))

    def postures(self, joints_rad: Array, sides: Array | None = None) -> Postures:
        """Standstills with its load."""
        return Postures(joints_rad, self.load, sides)

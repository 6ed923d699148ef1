"""The arm as built, identified from sessions: where its flange is at joints that the controller reports."""

from dataclasses import dataclass

from calibration.kinematics.arm_errors import ArmErrorModel, Postures
from calibration.transforms import Array


@dataclass(frozen=True, eq=False)
class ArmEstimate:
    """The arm as built, and X with it.

    parameters : (k,), all zero where no errors were taken up.
    covariance : (6 + k, 6 + k) of [X, as of Uncertainty.covariance; the parameters].
    """

    model: ArmErrorModel
    parameters: Array
    covariance: Array
    mount_T_camera: Array

    def base_T_flange(self, joints_rad: Array) -> Array:
        """Poses (n, 4, 4) of the built arm's flange at joints (n, 6) as reported; load and sides as not known."""
        return self.model.forward(self.parameters, Postures(joints_rad))

"""Errors that all views of a session share: an offset of the given principal point, and a trend of the robot's errors.

A given camera was calibrated on another day, or with another pixel origin; a robot's geometric errors differ little
between neighbouring poses. Neither shows in a single view, and both bias X. Each is an unknown with a Gaussian prior:
the camera's standard deviation is a constant, the robot's is estimated from the data with the other noise levels.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.likelihood.mixed_model import MixedModel, with_trend
from calibration.transforms import Array, vector_from_rotation

PRINCIPAL_POINT_SIGMA_PX = 1.0
"""Standard deviation of a given principal point per axis: between calibrations of one camera on two days."""

CENTRE_INDICES = (2, 3)
"""cx and cy among the intrinsics."""


@dataclass(frozen=True, eq=False)
class SystematicErrors:
    """`given_camera`: the camera whose principal point is unknown, None when it is exact; `trend` of robot errors."""

    given_camera: CameraModel | None = None
    trend: bool = False

    def __bool__(self) -> bool:
        return self.given_camera is not None or self.trend

    def apply(
        self, model: MixedModel, free: NDArray[np.bool_], camera: CameraModel, base_T_flange: Array
    ) -> MixedModel:
        """The model with these unknowns and their priors; `free` (10,) as in `likelihood.estimate`."""
        if self.given_camera is not None:
            known, offset = model.prior_information.copy(), model.prior_offset.copy()
            columns = 12 + np.flatnonzero(np.isin(np.flatnonzero(free), CENTRE_INDICES))
            known[columns] = 1 / PRINCIPAL_POINT_SIGMA_PX**2
            offset[columns] = camera.matrix[:2, 2] - self.given_camera.matrix[:2, 2]
            model = replace(model, prior_information=known, prior_offset=offset)
        return with_trend(model, trend_basis(base_T_flange)) if self.trend else model


NO_SYSTEMATIC_ERRORS = SystematicErrors()


def trend_basis(base_T_flange: Array) -> Array:
    """Regressors (n, 6) of the trend: position and orientation about their mean, in units of their spread."""
    places = base_T_flange[:, :3, 3] - base_T_flange[:, :3, 3].mean(axis=0)
    turns = vector_from_rotation(base_T_flange[0, :3, :3].T @ base_T_flange[:, :3, :3])
    turns = turns - turns.mean(axis=0)
    parts = [part / max(float(np.sqrt(np.mean(np.sum(part**2, axis=1)))), 1e-12) for part in (places, turns)]
    return np.concatenate(parts, axis=1)

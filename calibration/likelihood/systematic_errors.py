"""What all views of a session may share in error: the given camera's principal point, and the robot's slow trend.

A given camera was calibrated on another day, or counts pixels from another corner; a robot's geometric errors differ
little between neighbouring poses. Both look like nothing in any single view and bend X. Each is an unknown with a
deviation of its own beforehand: the camera's is stated, the robot's estimated from the data with the other levels.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.likelihood.mixed_model import MixedModel, with_trend
from calibration.transforms import Array, vector_from_rotation

PRINCIPAL_POINT_PX = 1.0
"""One deviation of a given principal point per axis: what calibrations of one camera on two days differ by."""

CENTRE = (2, 3)
"""cx and cy among the intrinsics."""


@dataclass(frozen=True, eq=False)
class Doubt:
    """`given`: the camera whose principal point is doubted, None: it is not; `trend`: whether the robot has one."""

    given: CameraModel | None = None
    trend: bool = False

    def __bool__(self) -> bool:
        return self.given is not None or self.trend

    def applied(
        self, model: MixedModel, free: NDArray[np.bool_], camera: CameraModel, base_T_flange: Array
    ) -> MixedModel:
        """The model with what is known beforehand; `free` (10,) as in `likelihood.estimate`."""
        if self.given is not None:
            known, offset = model.known.copy(), model.offset.copy()
            columns = 12 + np.flatnonzero(np.isin(np.flatnonzero(free), CENTRE))
            known[columns] = 1 / PRINCIPAL_POINT_PX**2
            offset[columns] = camera.matrix[:2, 2] - self.given.matrix[:2, 2]
            model = replace(model, known=known, offset=offset)
        return with_trend(model, trend_basis(base_T_flange)) if self.trend else model


NO_DOUBT = Doubt()


def trend_basis(base_T_flange: Array) -> Array:
    """Where (n, 6) each pose lies among the others: place, then orientation, both in units of their spread."""
    places = base_T_flange[:, :3, 3] - base_T_flange[:, :3, 3].mean(axis=0)
    turns = vector_from_rotation(base_T_flange[0, :3, :3].T @ base_T_flange[:, :3, :3])
    turns = turns - turns.mean(axis=0)
    parts = [part / max(float(np.sqrt(np.mean(np.sum(part**2, axis=1)))), 1e-12) for part in (places, turns)]
    return np.concatenate(parts, axis=1)

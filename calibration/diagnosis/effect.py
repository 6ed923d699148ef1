"""By how much a mapped point moves when an explanation of a contradiction is taken into account."""

from collections.abc import Set
from dataclasses import dataclass

import numpy as np

from calibration.camera import CameraModel
from calibration.diagnosis.fit import Fit, fit
from calibration.diagnosis.hypothesis import Hypothesis
from calibration.likelihood.predicted_uncertainty import point_weights, working_points_mm
from calibration.linear_algebra import inverse_or_pseudo_inverse, scaled_inverse
from calibration.transforms import Array, inverse, vector_from_transform

MIN_VIEWS = 3
"""Least views by which X is known without the cause."""


@dataclass(frozen=True, eq=False)
class MappedPoint:
    """The views (indices) and the target's size that the solution used, and the weights (6, 6) of the squared error of
    a point mapped through X."""

    used: Set[int]
    scale: float
    weights: Array

    @classmethod
    def of(cls, used: Set[int], scale: float, camera: CameraModel, camera_T_target: Array) -> "MappedPoint":
        """At the median distance of the target's poses (n, 4, 4)."""
        distance_mm = float(np.median(np.linalg.norm(camera_T_target[:, :3, 3], axis=1)))
        return cls(used, scale, point_weights(working_points_mm(camera, distance_mm)))

    def shift_mm(self, cause: Hypothesis) -> float | None:
        """RMS shift of the point under the cause, less what the uncertainty of its own X explains; the largest X's.

        Against X by the same poses without the cause: the solution's own camera may be another one, and X with it. None
        for another reading of the poses, under which X is another transform.
        """
        rows = np.flatnonzero([index in self.used for index in cause.baseline.indices.tolist()])
        if cause.whole_session or len(rows) < MIN_VIEWS:
            return None
        without = fit(cause.baseline.take(rows).scale_target(self.scale)).mount_T_camera[0]
        fitted = fit(cause.evidence, cause.x_labels, cause.y_labels)
        covariance = _covariance(fitted)
        squares = [0.0]
        for index, mount_T_camera in enumerate(fitted.mount_T_camera):
            own = slice(6 * index, 6 * index + 6)
            off = vector_from_transform(inverse(without) @ mount_T_camera)
            squares.append(float(off @ self.weights @ off - np.sum(self.weights * covariance[own, own])))
        largest = float(np.sqrt(max(squares)))
        return largest if np.isfinite(largest) else None


def _covariance(fitted: Fit) -> Array:
    """Covariance (p, p) of the shared unknowns."""
    weighted = inverse_or_pseudo_inverse(fitted.covariance) @ fitted.by_shared
    return scaled_inverse((np.swapaxes(fitted.by_shared, 1, 2) @ weighted).sum(axis=0))

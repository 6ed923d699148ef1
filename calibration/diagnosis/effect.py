"""By how much a measured point moves when an explanation of a contradiction, or another lens, is taken into account."""

from collections.abc import Set
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, fit
from calibration.diagnosis.hypothesis import Hypothesis
from calibration.likelihood.predicted_uncertainty import point_weights, working_points_mm
from calibration.linear_algebra import inverse_or_pseudo_inverse, scaled_inverse
from calibration.transforms import Array, inverse, vector_from_transform
from calibration.verdict import DEFAULT_VERDICT_LIMITS

MIN_VIEWS = 3
"""Least views by which X is known without the cause."""


@dataclass(frozen=True, eq=False)
class MappedPoint:
    """A point mapped through X, at the median distance of the target's poses `camera_T_target` (n, 4, 4).

    used, scale : the views (indices) and the target's size that the solution used.
    """

    used: Set[int]
    scale: float
    camera: CameraModel
    camera_T_target: Array

    @cached_property
    def weights(self) -> Array:
        """Weights (6, 6) of the point's squared error."""
        distance_mm = float(np.median(np.linalg.norm(self.camera_T_target[:, :3, 3], axis=1)))
        return point_weights(working_points_mm(self.camera, distance_mm))

    def shift_mm(self, cause: Hypothesis) -> float | None:
        """RMS shift of the point under the cause, less what the uncertainty of its own X explains; the largest X's.

        Against X by the same poses without the cause: the solution's own camera may be another one, and X with it. 0
        for a size of the target that a print may have: it is among the solution's unknowns. None for another reading of
        the poses, under which X is another transform.
        """
        rows = self._rows(cause.baseline)
        if cause.whole_session or len(rows) < MIN_VIEWS:
            return None
        if 0 < abs(cause.size - 1) <= DEFAULT_VERDICT_LIMITS.print_scale_share:
            return 0.0
        size = self.scale if cause.size == 1 else 1.0
        without = fit(cause.baseline.take(rows).scale_target(self.scale)).mount_T_camera[0]
        fitted = fit(cause.evidence.scale_target(size), cause.x_labels, cause.y_labels)
        covariance = _covariance(fitted)
        squares = [0.0]
        for index, mount_T_camera in enumerate(fitted.mount_T_camera):
            own = slice(6 * index, 6 * index + 6)
            squares.append(self._square(without, mount_T_camera, covariance[own, own]))
        largest = float(np.sqrt(max(squares)))
        return largest if np.isfinite(largest) else None

    def shift_by_lens_mm(self, mount_T_camera: Array, fitting: Evidence) -> float | None:
        """RMS shift of the point from the solution's X (4, 4) to that by other intrinsics, less what the uncertainty of
        the latter, with that of these intrinsics, explains."""
        rows = self._rows(fitting)
        if len(rows) < MIN_VIEWS:
            return None
        evidence = fitting.take(rows).scale_target(self.scale)
        fitted = fit(evidence)
        covariance = _covariance(fitted)
        if evidence.by_camera is not None:
            weighted = np.swapaxes(inverse_or_pseudo_inverse(fitted.covariance) @ fitted.by_shared, 1, 2)
            by_camera = covariance @ (weighted @ evidence.by_camera).sum(axis=0)
            covariance = covariance + by_camera @ by_camera.T
        square = self._square(mount_T_camera, fitted.mount_T_camera[0], covariance[:6, :6])
        return float(np.sqrt(max(square, 0.0))) if np.isfinite(square) else None

    def _rows(self, evidence: Evidence) -> NDArray[np.intp]:
        """Rows of the evidence that the solution used."""
        return np.flatnonzero([index in self.used for index in evidence.indices.tolist()])

    def _square(self, before: Array, after: Array, covariance: Array) -> float:
        """Mean squared shift (mm²) of the point between two X, less what the covariance (6, 6) of the second
        explains."""
        off = vector_from_transform(inverse(before) @ after)
        return float(off @ self.weights @ off - np.sum(self.weights * covariance))


def _covariance(fitted: Fit) -> Array:
    """Covariance (p, p) of the shared unknowns."""
    weighted = inverse_or_pseudo_inverse(fitted.covariance) @ fitted.by_shared
    return scaled_inverse((np.swapaxes(fitted.by_shared, 1, 2) @ weighted).sum(axis=0))

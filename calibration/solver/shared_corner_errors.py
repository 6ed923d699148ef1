"""Errors of the corners that are alike in all views, by light, lens and detector, as far as the residuals show them.

Each corner's mean residual over the views is its noise, which falls with the number of views, and what the views share.
The part of shared errors that moves or scales every picture alike is taken up by the poses and shows in no residual;
it is taken to be as large per corner as the part that shows.
"""

import numpy as np

from calibration.camera import CameraModel
from calibration.likelihood.estimate import Estimate
from calibration.observations.reprojection import pixel_residuals
from calibration.preprocessing.prepare import PreparedSession
from calibration.transforms import Array

MIN_VIEWS = 3
"""Least views of a corner whose mean is taken."""

SIGNIFICANT_SIGMA = 3.0
"""Standard deviations of the mean square by which it must exceed that of noise."""


def shared_corner_sigma_px(rows: PreparedSession, best: Estimate) -> float:
    """Standard deviation per axis of errors that the views share; 0 where they are not significant.

    `rows`: the views of the estimate `best`.
    """
    seen = rows.seen
    residuals = pixel_residuals(best.seen(seen), best.camera, best.chain.camera_T_target())
    used = seen.weights > 0
    ids, count = seen.ids[used], int(seen.ids.max()) + 1
    views = np.bincount(ids, minlength=count)
    often = views >= MIN_VIEWS
    if not np.any(often):
        return 0.0
    sums = np.stack([np.bincount(ids, residuals[used][:, axis], minlength=count) for axis in (0, 1)], axis=1)
    squares = (sums[often] / views[often, None]) ** 2
    noise = best.variances.pixel / views[often]
    excess = float(np.mean(squares) - np.mean(noise))
    deviation = float(np.sqrt(np.mean(noise**2) / len(noise)))  # of a mean of 2 k squares, each of variance 2 noise²
    return float(np.sqrt(excess)) if excess > SIGNIFICANT_SIGMA * deviation else 0.0


def variance_by_shared_corners(sigma_px: float, camera: CameraModel, distance_mm: float) -> Array:
    """The covariance (6, 6) of X by a common shift, turn and scale of all pictures of this size at their rim.

    In the camera frame, [rad, mm]: a shift turns the line of sight, a scale moves the target along it.
    """
    focal_px, half_px = float(np.sqrt(np.prod(np.diagonal(camera.matrix)[:2]))), 0.5 * max(camera.image_size)
    shift, rim = sigma_px / focal_px, sigma_px / half_px
    return np.diag(np.square([shift, shift, rim, 0.0, 0.0, rim * distance_mm]))

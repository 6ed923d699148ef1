"""Each view against the solution of all the others, one Newton step from the full one.

The step is exact for the linearised model: the view's part is taken out of the normal equations.
"""

from dataclasses import dataclass

import numpy as np

from calibration.likelihood.chain import Chain
from calibration.likelihood.estimate import Estimate
from calibration.likelihood.mixed_model import of_views
from calibration.linear_algebra import covariance_of, squared_distances
from calibration.observations.observations import Observations
from calibration.observations.pose_model import pose_residuals
from calibration.observations.reprojection import pixel_statistics
from calibration.transforms import Array


@dataclass(frozen=True, eq=False)
class LeftOut:
    """`b` (n, p): what the others' solution differs by from the estimate; `covariance` (n, p, p) of it."""

    b: Array
    covariance: Array


def leave_one_out(best: Estimate) -> LeftOut:
    """For every view the solution without it."""
    step = best.step
    information, gradient = of_views(best.model, best.variances, step)
    covariance = covariance_of(step.information - information)
    return LeftOut(-(covariance @ (step.gradient - gradient)[..., None])[..., 0] - step.b, covariance)


def without_each_view(best: Estimate, left_out: LeftOut) -> Chain:
    """The chain of each view (stacked) by X and Y of the others, with the robot's pose as it was reported."""
    chain = best.chain
    return chain.moved(left_out.b[:, :12], np.zeros_like(chain.corrections))


def disagreement(best: Estimate, left_out: LeftOut, by_shared: Array) -> Array:
    """Squared Mahalanobis distance (n,) of each view's own pose from where the others expect it; 6 degrees of freedom.

    `by_shared` (n, 6, 12) is the derivative of camera_T_target by (X, Y).
    """
    information, gradient = of_views(best.model, best.variances, best.step)
    gradient = gradient + (information @ (left_out.b + best.step.b)[..., None])[..., 0]
    # A view's pose moves by -1 with X in the camera's frame: X's block is the information about the pose itself.
    own = covariance_of(information[:, :6, :6])
    off = (own @ gradient[:, :6, None])[..., 0]
    spread = own + by_shared @ left_out.covariance[:, :12, :12] @ np.swapaxes(by_shared, 1, 2)
    return squared_distances(off, spread)


def outside_disagreement(best: Estimate, seen: Observations, camera_T_target: Array) -> Array:
    """The same (k,) for views that took no part, from their own poses (k, 4, 4)."""
    chain = best.chain.of_views(seen.base_T_flange)
    expected = chain.camera_T_target()
    off = pose_residuals(camera_T_target, expected)
    own = covariance_of(pixel_statistics(seen, best.camera, camera_T_target).normal / best.variances.pixel)
    by_robot, by_shared = chain.by_correction(expected) * best.variances.deviations(), chain.by_shared(expected)
    spread = own + by_robot @ np.swapaxes(by_robot, 1, 2)
    spread += by_shared @ best.step.covariance[:12, :12] @ np.swapaxes(by_shared, 1, 2)
    return squared_distances(off, spread)

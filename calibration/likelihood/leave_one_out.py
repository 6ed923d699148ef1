"""The solution without each view, one Newton step from the full one, and the view's distance from it.

The step is exact for the linearised model: the view's part is subtracted from the normal equations.
"""

from dataclasses import dataclass

import numpy as np

from calibration.likelihood.chain import Chain
from calibration.likelihood.estimate import Estimate
from calibration.likelihood.mixed_model import per_view_equations
from calibration.linear_algebra import covariance_of, squared_distances
from calibration.observations.observations import Observations
from calibration.observations.pose_model import pose_residuals
from calibration.observations.reprojection import pixel_statistics
from calibration.transforms import Array


@dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """`b` (n, p): step from the estimate to the solution of the other views; `covariance` (n, p, p) of that."""

    b: Array
    covariance: Array


def leave_one_out(best: Estimate) -> LeaveOneOut:
    """For every view the solution of the others."""
    step = best.step
    information, gradient = per_view_equations(best.model, best.variances, step)
    covariance = covariance_of(step.information - information)
    return LeaveOneOut(-(covariance @ (step.gradient - gradient)[..., None])[..., 0] - step.b, covariance)


def leave_one_out_chain(best: Estimate, left_out: LeaveOneOut) -> Chain:
    """The chain of each view (stacked) with X and Y of the other views, and the robot's poses as reported."""
    chain = best.chain
    return chain.apply_step(left_out.b[:, :12], np.zeros_like(chain.corrections))


def squared_view_distances(best: Estimate, left_out: LeaveOneOut, by_shared: Array) -> Array:
    """Squared Mahalanobis distance (n,) of each view's own pose from its prediction by the others; 6 dof.

    `by_shared` (n, 6, 12): derivative of camera_T_target by (X, Y).
    """
    information, gradient = per_view_equations(best.model, best.variances, best.step)
    gradient = gradient + (information @ (left_out.b + best.step.b)[..., None])[..., 0]
    # The derivative of a view's pose by X is -1 in the camera's frame, so X's block is the pose's own information.
    own = covariance_of(information[:, :6, :6])
    off = (own @ gradient[:, :6, None])[..., 0]
    spread = own + by_shared @ left_out.covariance[:, :12, :12] @ np.swapaxes(by_shared, 1, 2)
    return squared_distances(off, spread)


def squared_outside_distances(best: Estimate, seen: Observations, camera_T_target: Array) -> Array:
    """The same (k,) for views that are not part of the estimate, from their own poses (k, 4, 4)."""
    chain = best.chain.for_poses(seen.base_T_flange)
    expected = chain.camera_T_target()
    off = pose_residuals(camera_T_target, expected)
    own = covariance_of(pixel_statistics(seen, best.camera, camera_T_target).normal / best.variances.pixel)
    by_robot, by_shared = (
        chain.correction_jacobian(expected) * best.variances.deviations(),
        chain.shared_jacobian(expected),
    )
    spread = own + by_robot @ np.swapaxes(by_robot, 1, 2)
    spread += by_shared @ best.step.covariance[:12, :12] @ np.swapaxes(by_shared, 1, 2)
    return squared_distances(off, spread)

"""Cross-validation: the errors with which the solution of the other views predicts each view.

The solution without a view is one Newton step away (`likelihood.leave_one_out`). Two errors of the left-out view are
computed:

- base error: the target points through the view's own camera_T_target (from its pixels alone), X of the rest and the
  robot's pose as reported, against the target's pose of the rest; RMS distance in the anchor (base or flange), mm;
- reprojection: the target of the rest, through the robot's pose as reported and X of the rest, in px.
"""

import numpy as np

from calibration.likelihood.chain import Chain
from calibration.likelihood.estimate import Estimate, exact_pixels
from calibration.likelihood.leave_one_out import LeaveOneOut, leave_one_out, leave_one_out_chain
from calibration.observations.observations import Observations
from calibration.observations.reprojection import PixelStatistics
from calibration.observations.view_poses import apply_pose_steps
from calibration.problem import anchor_T_mount_of
from calibration.solution import HoldOut
from calibration.transforms import Array, map_points

MIN_VIEWS = 4
"""Least views; two views do not determine X."""


def hold_out(seen: Observations, best: Estimate, camera_T_target: Array) -> HoldOut | None:
    """RMS errors over all points of all views, each predicted by the others; None below four views.

    `camera_T_target` (n, 4, 4): each view's own pose, by its pixels alone and the estimated camera.
    """
    if len(seen) < MIN_VIEWS:
        return None
    left_out = leave_one_out(best)
    chain = leave_one_out_chain(best, left_out)
    assert best.nuisances is not None
    pixels = exact_pixels(seen, best.nuisances)
    own = _own_poses(pixels(camera_T_target, best.z), left_out)
    errors = base_errors(best.seen(seen), chain, apply_pose_steps(camera_T_target, own))
    predicted = pixels(chain.camera_T_target(), best.z)
    used = seen.weights > 0
    # The corners of one view have the same weight: divide by it to undo the weighting.
    per_view = 1 / np.maximum(seen.weights.max(axis=1), 1e-300)
    corners = float(np.count_nonzero(used))
    return HoldOut(
        float(np.sqrt(np.sum(used * np.sum(errors**2, axis=-1)) / corners)),
        float(np.sqrt(np.sum(per_view * _squares(predicted, left_out)) / corners)),
    )


def base_errors(seen: Observations, chain: Chain, camera_T_target: Array) -> Array:
    """The target's points by each view's own pose minus by the chain, in the anchor (n, m, 3), mm."""
    anchor_T_mount = anchor_T_mount_of(chain.setup, chain.corrected_base_T_flange())
    by_view = map_points(anchor_T_mount @ chain.mount_T_camera @ camera_T_target, seen.points_mm)
    errors: Array = by_view - map_points(chain.anchor_T_target, seen.points_mm)
    return errors


def _own_poses(statistics: PixelStatistics, left_out: LeaveOneOut) -> Array:
    """Steps (n, 6) of each view's own pose at the intrinsics of the other views."""
    towards = (statistics.normal[:, :6, 6:] @ left_out.b[:, 12 : 6 + statistics.normal.shape[1], None])[..., 0]
    return -np.asarray(np.linalg.solve(statistics.normal[:, :6, :6], towards[..., None])[..., 0])


def _squares(statistics: PixelStatistics, left_out: LeaveOneOut) -> Array:
    """Each view's sum of squared residuals (n,) at the intrinsics of the other views."""
    k = left_out.b[:, 12 : 6 + statistics.normal.shape[1]]
    towards = (statistics.normal[:, 6:, 6:] @ k[..., None])[..., 0]
    squares: Array = statistics.square + np.sum((2 * statistics.gradient[:, 6:] + towards) * k, axis=1)
    return squares

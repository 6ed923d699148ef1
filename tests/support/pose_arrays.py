"""X from bare arrays of poses, as the product finds it for a session of pose pairs: for tests and benchmarks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.pose_pairs.alike_errors import with_alike_errors
from calibration.pose_pairs.residuals import PosePairs
from calibration.pose_pairs.solve import fit_pose_pairs
from calibration.problem import Setup
from calibration.transforms import Array


@dataclass(frozen=True, eq=False)
class PoseSolution:
    """What was found from pairs of poses.

    mount_T_camera, anchor_T_target : (4, 4).
    covariance : (12, 12) of both, of `pose @ exp(.)`, [rad, mm] each.
    used : (n,) mask of the views that agree.
    scale : length in the camera's poses over true length.
    camera : the kind of noise that explains the views best.
    deviations : one standard deviation per axis and source, rad or mm.
    """

    mount_T_camera: Array
    anchor_T_target: Array
    covariance: Array
    used: NDArray[np.bool_]
    scale: float
    camera: str
    deviations: dict[str, float]


def solve_hand_eye_poses(
    setup: Setup, base_T_flange: Array, camera_T_target: Array, *, metric: bool = True
) -> PoseSolution:
    """X from the robot's and the camera's poses (n, 4, 4), mm. Raises UndeterminedError where it is not determined.

    `metric=False`: the camera's lengths are right up to one unknown factor, as those of a single moving camera are.
    """
    pairs = PosePairs(setup, base_T_flange, camera_T_target, () if metric else (np.inf,))
    fitted, used = fit_pose_pairs(pairs)
    fitted = with_alike_errors(pairs.take(used), fitted)
    return PoseSolution(
        fitted.chain.mount_T_camera,
        fitted.chain.anchor_T_target,
        fitted.covariance[:12, :12],
        used,
        fitted.chain.scale,
        fitted.camera,
        {source: float(np.sqrt(variance)) for source, variance in fitted.variances.items()},
    )

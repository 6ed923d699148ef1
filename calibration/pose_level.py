"""X from pairs of poses alone, for sources that give no pixels: trackers, odometry, another program's detections.

Maximum likelihood over X, the target's pose and four noise levels: rotation and translation of the robot, which
`calibration.diagnosis.fit` scores, and of the camera, the likeliest of a table. Views that disagree are left out.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from calibration.consistency.consensus import agreeing_views
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, fits, residuals_of
from calibration.errors import UndeterminedError
from calibration.observability import axis_in_words, motion_of, require_determined
from calibration.problem import Setup
from calibration.transforms import Array

MOST_ROUNDS = 4
REACH_MM = 100.0
"""Views vote with four points this far from the target's origin."""

OUTLYING = float(chi2.ppf(1 - 1e-4, 6))
LEAST_AXIS_SPREAD = float(np.tan(np.radians(0.5)))
"""Of two turns whose axes are one degree apart; unlike the widest angle it is not fooled by small, noisy turns."""

CAMERA_LEVELS_RAD = (1e-5, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
CAMERA_LEVELS_MM = (1e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)


@dataclass(frozen=True, eq=False)
class PoseSolution:
    """`mount_T_camera` (4, 4), `anchor_T_target` (4, 4), `used` (n,); `covariance` (12, 12) of both, [rad, mm] each.

    The covariance is of `pose @ exp(.)`. Noise levels are one standard deviation per axis.
    """

    mount_T_camera: Array
    anchor_T_target: Array
    covariance: Array
    used: NDArray[np.bool_]
    robot_rotation_rad: float
    robot_translation_mm: float
    camera_rotation_rad: float
    camera_translation_mm: float


def solve_hand_eye_poses(setup: Setup, base_T_flange: Array, camera_T_target: Array) -> PoseSolution:
    """X from the robot's and the camera's poses (n, 4, 4), mm. Raises UndeterminedError where it is not determined."""
    _require_poses(base_T_flange, camera_T_target)
    everything = _evidence(setup, base_T_flange, camera_T_target, CAMERA_LEVELS_RAD[0], CAMERA_LEVELS_MM[0])
    points = REACH_MM * np.array([[-1.0, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]])
    used = agreeing_views(everything.anchor_T_mount(), camera_T_target, points)
    for _ in range(MOST_ROUNDS):
        _require_axes(base_T_flange[used])
        likeliest, level = _likeliest(setup, base_T_flange[used], camera_T_target[used])
        residuals, covariance = residuals_of(_evidence(setup, base_T_flange, camera_T_target, *level), likeliest)
        distances = np.einsum("ni,ni->n", residuals, np.linalg.solve(covariance, residuals[..., None])[..., 0])
        agreeing = distances < OUTLYING
        if np.array_equal(agreeing, used) or agreeing.sum() <= len(used) // 2:
            break
        used = agreeing
    return PoseSolution(
        likeliest.mount_T_camera[0],
        likeliest.anchor_T_target[0],
        _covariance(likeliest),
        used,
        likeliest.robot_rotation_rad,
        likeliest.robot_translation_mm,
        *level,
    )


def _require_poses(base_T_flange: Array, camera_T_target: Array) -> None:
    if base_T_flange.shape != camera_T_target.shape or base_T_flange.shape[1:] != (4, 4):
        raise ValueError(
            f"as many poses (n, 4, 4) of the robot as of the camera: {base_T_flange.shape} and {camera_T_target.shape}"
        )
    for name, poses in (("robot", base_T_flange), ("camera", camera_T_target)):
        wrong = np.flatnonzero(~np.isfinite(poses).all(axis=(1, 2)))
        if len(wrong):
            raise UndeterminedError("bad-pose", f"the {name}'s pose {wrong[0]} is not made of numbers", "leave it out")
    _require_axes(base_T_flange)


def _require_axes(base_T_flange: Array) -> None:
    require_determined(base_T_flange)
    motion = motion_of(base_T_flange)
    if motion.axis_spread < LEAST_AXIS_SPREAD:
        axis = axis_in_words(motion.main_axis, base_T_flange)
        raise UndeterminedError(
            "parallel-axes",
            f"all turns are about one axis, but for noise: translation along {axis} is not determined",
            f"add poses turned by 30 degrees or more about an axis across {axis}",
        )


def _likeliest(setup: Setup, base_T_flange: Array, camera_T_target: Array) -> tuple[Fit, tuple[float, float]]:
    """The best fit over the table of camera levels, all of them tried in one go."""
    levels = list(product(CAMERA_LEVELS_RAD, CAMERA_LEVELS_MM))
    fitted = fits([_evidence(setup, base_T_flange, camera_T_target, *level) for level in levels])
    best = int(np.argmax([one.log_likelihood for one in fitted]))
    return fitted[best], levels[best]


def _evidence(setup: Setup, base_T_flange: Array, camera_T_target: Array, rad: float, mm: float) -> Evidence:
    n = len(base_T_flange)
    covariance = np.tile(np.diag(np.repeat([rad**2, mm**2], 3)), (n, 1, 1))
    return Evidence(setup, np.arange(n), base_T_flange, camera_T_target, covariance)


def _covariance(fitted: Fit) -> Array:
    weighted = np.swapaxes(fitted.by_shared, 1, 2) @ np.linalg.inv(fitted.covariance)
    covariance: Array = np.linalg.inv((weighted @ fitted.by_shared).sum(axis=0))
    return covariance

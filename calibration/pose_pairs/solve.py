"""X from pairs of poses alone, for sources that give no pixels: trackers, odometry, another program's detections.

Maximum likelihood over X, the target's pose, a scale where the camera knows none, and the noise: what kind of camera it
is (`calibration.pose_pairs.noise_models`), how large each of its errors and the robot's are, and how heavy their tails.
Views that disagree are left out. What the motions do not tell is refused.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.errors import UndeterminedError
from calibration.observability import describe_axis, require_observable, summarise_motion
from calibration.pose_pairs.independent_noise import PoseFit, distances_of, fit_white, outlying
from calibration.pose_pairs.noise_marginalisation import MOST_VIEWS, averaged
from calibration.pose_pairs.noise_models import CAMERAS
from calibration.pose_pairs.random_walk_noise import FEWEST_VIEWS, fit_drift
from calibration.pose_pairs.residuals import PosePairs, closed_form
from calibration.problem import Setup
from calibration.solver.least_median import agreeing_views
from calibration.transforms import Array

MOST_ROUNDS = 4
REACH_MM = 100.0
"""Views vote with four points this far from the target's origin."""

FEWEST_VOTERS = 6
"""Of five views three are a majority, and any three agree with themselves: honest views would be dropped too often."""

TAILS = (np.inf, 4.0)
LEAST_AXIS_SPREAD = float(np.tan(np.radians(0.5)))
"""Of two turns whose axes are one degree apart; unlike the widest angle it is not fooled by small, noisy turns."""

LARGEST_SCALE_DOUBT = 0.1
"""One standard deviation, as a share of the scale; beyond it X's translation is a guess."""


@dataclass(frozen=True, eq=False)
class PoseSolution:
    """`mount_T_camera` (4, 4), `anchor_T_target` (4, 4), `used` (n,); `covariance` (12, 12) of both, [rad, mm] each.

    The covariance is of `pose @ exp(.)`. `scale`: the camera's millimetres in true ones. `camera` is the kind of noise
    that explains it best, `deviations` are one standard deviation per axis and source, in rad or mm.
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
    _require_poses(base_T_flange, camera_T_target)
    pairs = PosePairs(setup, base_T_flange, camera_T_target, metric)
    used = _agreeing(pairs)
    for _ in range(MOST_ROUNDS):
        _require_axes(base_T_flange[used])
        likeliest = _likeliest(pairs.take(used))
        distances = distances_of(pairs, likeliest)
        agreeing = distances < outlying(likeliest.tails, int(used.sum()))
        if np.array_equal(agreeing, used) or agreeing.sum() <= len(used) // 2:
            break
        used = agreeing
    if used.sum() >= FEWEST_VIEWS:
        drifting = fit_drift(pairs.take(used), likeliest.chain)
        likeliest = max(likeliest, drifting, key=lambda one: one.evidence(int(used.sum())))
    if used.sum() <= MOST_VIEWS and likeliest.camera in CAMERAS and not np.isfinite(likeliest.tails):
        likeliest = averaged(pairs.take(used), likeliest)
    _require_scale(pairs, likeliest)
    return PoseSolution(
        likeliest.chain.mount_T_camera,
        likeliest.chain.anchor_T_target,
        likeliest.covariance[:12, :12],
        used,
        likeliest.chain.scale,
        likeliest.camera,
        {source: float(np.sqrt(variance)) for source, variance in likeliest.variances.items()},
    )


def _likeliest(pairs: PosePairs) -> PoseFit:
    start = closed_form(pairs)
    tails = TAILS if len(pairs) >= FEWEST_VIEWS else TAILS[:1]
    fitted = [fit_white(pairs, start, camera, t) for camera in CAMERAS for t in tails]
    return max(fitted, key=lambda one: one.evidence(len(pairs)))


def _require_scale(pairs: PosePairs, fitted: PoseFit) -> None:
    if not pairs.metric and not np.sqrt(fitted.covariance[12, 12]) < LARGEST_SCALE_DOUBT:
        raise UndeterminedError(
            "scale-undetermined",
            "the camera hardly moves compared with its errors: how long its millimetres are is not determined",
            "move the camera further between views, or use a target of known size",
        )


def _agreeing(pairs: PosePairs) -> NDArray[np.bool_]:
    if len(pairs) < FEWEST_VOTERS:
        return np.ones(len(pairs), bool)
    seen = pairs.camera_T_target
    if not pairs.metric:
        seen = seen.copy()
        seen[:, :3, 3] /= closed_form(pairs).scale
    points = REACH_MM * np.array([[-1.0, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]])
    return agreeing_views(pairs.anchor_T_mount(), seen, points)


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
    require_observable(base_T_flange)
    motion = summarise_motion(base_T_flange)
    if motion.axis_spread < LEAST_AXIS_SPREAD:
        axis = describe_axis(motion.main_axis, base_T_flange)
        raise UndeterminedError(
            "parallel-axes",
            f"all turns are about one axis, but for noise: translation along {axis} is not determined",
            f"add poses turned by 30 degrees or more about an axis across {axis}",
        )

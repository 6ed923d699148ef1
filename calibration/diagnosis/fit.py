"""Maximum likelihood of X, the target's pose and the robot noise, given the evidence under a hypothesis.

The robot's errors have two unknown levels (rotation, translation), so a wrong hypothesis gives large levels, and two
hypotheses are compared by their likelihoods at their own best levels. X or the target's pose may change once.
Hypotheses of the same shape are fitted together in a few array operations.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.closed_forms.kronecker import kronecker
from calibration.diagnosis.evidence import Evidence
from calibration.kinematics.robot_accuracy import MIN_REPEATABILITY, RobotNoise
from calibration.likelihood.variance_components import nonnegative_variances
from calibration.linear_algebra import inverse_or_pseudo_inverse, scaled_solve
from calibration.observations.pose_model import (
    clip_step,
    derivative_by_flange,
    derivative_by_shared,
    pose_residuals,
    predicted_camera_T_target,
)
from calibration.problem import Setup, base_T_flange_of
from calibration.transforms import Array, inverse, rotation_from_vector, transform, transform_from_vector

ITERATIONS = 8
MIN_LOG_LIKELIHOOD = -1e15
"""Log-likelihood of an impossible state."""

LOG_LIKELIHOOD_TOLERANCE = 1e-2
"""The iteration ends when the log-likelihood changes by less."""

MIN_VARIANCES = MIN_REPEATABILITY.levels() ** 2
"""rad², mm²"""

MAX_VARIANCES = np.array([1.0**2, 1e5**2])
"""rad², mm²: bound of the variances, beyond those of any robot."""

INITIAL_VARIANCES = np.array([1e-4**2, 0.1**2])
MIN_INFORMATION = 1e-30
"""Floor of information; under a wrong hypothesis rounding may leave zero or less."""

STARTS = 16
"""Random starts for motions that do not determine X; one in three leads to another optimum."""

Labels = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Fit:
    """`mount_T_camera` (g, 4, 4) and `anchor_T_target` (h, 4, 4), one a label; robot variances (2,) in rad² and mm².

    Residuals (n, 6) with their covariance (n, 6, 6) and the images' part in it, derivatives by the shared unknowns
    (n, 6, p) and by the robot's error (n, 6, 6). `redundancy` (n,): see `Evidence`.
    """

    mount_T_camera: Array
    anchor_T_target: Array
    variances: Array
    residuals: Array
    covariance: Array
    image_covariance: Array
    by_shared: Array
    by_robot: Array
    redundancy: Array
    log_likelihood: float

    @property
    def robot_noise(self) -> RobotNoise:
        """One standard deviation of the robot's pose under this hypothesis."""
        rotation_rad, translation_mm = np.sqrt(self.variances).tolist()
        return RobotNoise(translation_mm, rotation_rad)

    def step(self) -> Array:
        """The next Gauss-Newton step of the shared unknowns (p,)."""
        information = inverse_or_pseudo_inverse(self.covariance)[None]
        step, _ = _step(_Linear(self.residuals[None], self.by_shared[None], self.by_robot[None]), information)
        missing: Array = step[0]
        return missing

    def distances(self) -> Array:
        """Squared Mahalanobis distance (n,) of every view."""
        return _squared_distances(self.residuals, inverse_or_pseudo_inverse(self.covariance))


@dataclass(frozen=True, eq=False)
class _Stack:
    """t hypotheses about n views each: both poses (t, n, 4, 4), covariance (t, n, 6, 6), labels (t, n)."""

    setup: Setup
    anchor_T_mount: Array
    camera_T_target: Array
    covariance: Array
    x_labels: Labels
    y_labels: Labels


@dataclass(frozen=True, eq=False)
class _Linear:
    """Residuals (t, n, 6), their derivatives by the shared unknowns (t, n, 6, p), by the robot's error (t, n, 6, 6)."""

    residuals: Array
    by_shared: Array
    by_robot: Array


def fit(evidence: Evidence, x_labels: Labels | None = None, y_labels: Labels | None = None) -> Fit:
    """The fit; `x_labels`, `y_labels` (n,): which X and which target pose applies to each view, by default one."""
    return fits([evidence], [x_labels], [y_labels])[0]


def fits(
    evidences: Sequence[Evidence],
    x_labels: Sequence[Labels | None] | None = None,
    y_labels: Sequence[Labels | None] | None = None,
    iterations: int = ITERATIONS,
) -> list[Fit]:
    """One fit for each evidence; all must have the same numbers of views and of labels."""
    stack = _stack_evidence(evidences, x_labels or [None] * len(evidences), y_labels or [None] * len(evidences))
    X, Y = _start(stack)
    variances = np.tile(INITIAL_VARIANCES, (len(evidences), 1))
    # Scoring may overshoot under a wrong hypothesis, so the most likely state is kept.
    before = likeliest = np.full(len(evidences), MIN_LOG_LIKELIHOOD)
    kept = X, Y, variances
    for iteration in range(iterations + 1):
        linear = _linearise(stack, X, Y)
        information, value = _weigh(stack, linear, variances)
        better = value > likeliest
        likeliest = np.where(better, value, likeliest)
        kept = _where(better, X, kept[0]), _where(better, Y, kept[1]), _where(better, variances, kept[2])
        if iteration == iterations or np.all(np.abs(value - before) < LOG_LIKELIHOOD_TOLERANCE):
            break
        step, left = _step(linear, information)
        x_numbers = 6 * X.shape[1]
        steps = (X, step[:, :x_numbers]), (Y, step[:, x_numbers:])
        X, Y = (pose @ transform_from_vector(moved.reshape(*pose.shape[:2], 6)) for pose, moved in steps)
        variances = _variances(stack, left, linear, information)
        before = value
    X, Y, variances = kept
    linear = _linearise(stack, X, Y)
    covariance = _covariance(stack.covariance, linear.by_robot, variances)
    return [
        Fit(
            X[t], Y[t], variances[t], linear.residuals[t], covariance[t], stack.covariance[t], linear.by_shared[t],
            linear.by_robot[t], evidence.redundancy, float(likeliest[t]),
        )
        for t, evidence in enumerate(evidences)
    ]  # fmt: skip


def likeliest_fit(evidence: Evidence) -> Fit:
    """The best of several fits from random starts, for motions that do not determine X.

    The starts differ by random rotations of the frames, which do not change the likelihood; X and the target's pose
    of the result are in those rotated frames.
    """
    turns = transform(rotation_from_vector(np.random.default_rng(0).uniform(-2, 2, (2 * STARTS, 3))), np.zeros(3))
    turned = [
        evidence.with_robot_poses(base @ evidence.base_T_flange @ flange)
        for base, flange in zip(turns[:STARTS], turns[STARTS:], strict=True)
    ]
    return max(fits([evidence, *turned]), key=lambda fitted: fitted.log_likelihood)


def predict_base_T_flange(evidence: Evidence, fitted: Fit, view: int) -> Array:
    """The robot's pose (4, 4) in a view as predicted by its image and the fit."""
    anchor_T_mount = fitted.anchor_T_target[0] @ inverse(fitted.mount_T_camera[0] @ evidence.camera_T_target[view])
    return base_T_flange_of(evidence.setup, anchor_T_mount)


def apply_fit(evidence: Evidence, fitted: Fit) -> Fit:
    """The fit with residuals and derivatives of other views, which need not be part of it."""
    stack = _stack_evidence([evidence], [None], [None])
    linear = _linearise(stack, fitted.mount_T_camera[None, :1], fitted.anchor_T_target[None, :1])
    covariance = _covariance(stack.covariance, linear.by_robot, fitted.variances[None])[0]
    seen = replace(fitted, residuals=linear.residuals[0], covariance=covariance, image_covariance=evidence.covariance)
    return replace(seen, by_shared=linear.by_shared[0], by_robot=linear.by_robot[0], redundancy=evidence.redundancy)


def _stack_evidence(
    evidences: Sequence[Evidence], x_labels: Sequence[Labels | None], y_labels: Sequence[Labels | None]
) -> _Stack:
    one = np.zeros(len(evidences[0]), np.intp)
    return _Stack(
        evidences[0].setup,
        np.stack([evidence.anchor_T_mount() for evidence in evidences]),
        np.stack([evidence.camera_T_target for evidence in evidences]),
        np.stack([evidence.covariance for evidence in evidences]),
        np.stack([one if labels is None else labels for labels in x_labels]),
        np.stack([one if labels is None else labels for labels in y_labels]),
    )


def _start(stack: _Stack) -> tuple[Array, Array]:
    """X in closed form from the longest stretch with one X and one target pose, and the mean of Y with that X."""
    t, n = stack.x_labels.shape
    g, h = int(stack.x_labels.max()) + 1, int(stack.y_labels.max()) + 1
    rows = np.tile(np.arange(n), (t, 1))
    if g * h > 1:
        for index, stretch in enumerate(stack.x_labels * h + stack.y_labels):
            # Views of the stretch are repeated to fill the row; this changes only their weights.
            rows[index] = np.resize(np.flatnonzero(stretch == np.bincount(stretch).argmax()), n)
    chosen = np.arange(t)[:, None], rows
    X = np.repeat(kronecker(stack.anchor_T_mount[chosen], stack.camera_T_target[chosen])[:, None], g, axis=1)
    anchor_T_target = stack.anchor_T_mount @ X[:, :1] @ stack.camera_T_target
    share = (stack.y_labels[:, None] == np.arange(h)[:, None]).astype(float)  # (t, h, n)
    share /= np.maximum(share.sum(axis=-1, keepdims=True), 1.0)
    mean = np.einsum("thn,tnij->thij", share, anchor_T_target)
    u, _, vt = np.linalg.svd(mean[..., :3, :3])
    u[..., 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    return X, transform(u @ vt, mean[..., :3, 3])


def _linearise(stack: _Stack, X: Array, Y: Array) -> _Linear:
    t, n = stack.x_labels.shape
    g, h = X.shape[1], Y.shape[1]
    rows = np.arange(t)[:, None]
    X_of_view, Y_of_view = X[rows, stack.x_labels], Y[rows, stack.y_labels]
    camera_T_target = predicted_camera_T_target(stack.anchor_T_mount, X_of_view, Y_of_view)
    by_x_and_y = derivative_by_shared(camera_T_target)[:, :, :, None]
    of_x = (stack.x_labels[..., None] == np.arange(g))[:, :, None, :, None]
    of_y = (stack.y_labels[..., None] == np.arange(h))[:, :, None, :, None]
    by_x, by_y = of_x * by_x_and_y[..., :6], of_y * by_x_and_y[..., 6:]
    by_shared = np.concatenate([by_x.reshape(t, n, 6, -1), by_y.reshape(t, n, 6, -1)], axis=-1)
    by_robot = derivative_by_flange(stack.setup, camera_T_target, X_of_view, Y_of_view)
    return _Linear(pose_residuals(camera_T_target, stack.camera_T_target), by_shared, by_robot)


def _covariance(by_images: Array, by_robot: Array, variances: Array) -> Array:
    deviation = np.sqrt(np.repeat(np.maximum(variances, MIN_VARIANCES), 3, axis=-1))
    spread = by_robot * deviation[:, None, None]
    by_robots: Array = spread @ np.swapaxes(spread, -1, -2)
    return by_images + by_robots


def _weigh(stack: _Stack, linear: _Linear, variances: Array) -> tuple[Array, Array]:
    """Inverse covariance (t, n, 6, 6) and the log-likelihood (t,)."""
    covariance = _covariance(stack.covariance, linear.by_robot, variances)
    information = inverse_or_pseudo_inverse(covariance)
    sign, log_determinant = np.linalg.slogdet(covariance)
    squared = _squared_distances(linear.residuals, information)
    value = -0.5 * np.sum(log_determinant + squared, axis=-1)
    # Under a wrong hypothesis rounding may give negative squares, which would have the highest likelihood.
    return information, np.where(np.all((sign > 0) & (squared >= 0), axis=-1), value, MIN_LOG_LIKELIHOOD)


def _step(linear: _Linear, information: Array) -> tuple[Array, Array]:
    """Gauss-Newton step (t, p) and the residuals it leaves (t, n, 6)."""
    t, n, _, p = linear.by_shared.shape
    weighted = np.swapaxes((information @ linear.by_shared).reshape(t, 6 * n, p), -1, -2)
    normal = weighted @ linear.by_shared.reshape(t, 6 * n, p)
    gradient = weighted @ linear.residuals.reshape(t, 6 * n, 1)
    step = -scaled_solve(normal, gradient)[..., 0]
    step = clip_step(np.nan_to_num(step))  # a wrong hypothesis may have no sensible fit
    left: Array = linear.residuals + (linear.by_shared @ step[:, None, :, None])[..., 0]
    return step, left


def _variances(stack: _Stack, residuals: Array, linear: _Linear, information: Array) -> Array:
    """Fisher scoring of the two robot variances (t, 2), neither below zero, corrected for the unknowns spent.

    Of quadratic = sum |U_g' W r|² the images' own noise explains tr(U_g' W S_image W U_g), the robot the rest.
    """
    t, n, _, shared = linear.by_shared.shape
    weighted = information @ linear.by_robot
    seen = (np.swapaxes(weighted, -1, -2) @ residuals[..., None])[..., 0]
    inner = np.swapaxes(linear.by_robot, -1, -2) @ weighted
    by_images = np.sum(weighted * (stack.covariance @ weighted), axis=-2)
    spent = 6 * n / max(6 * n - shared, 1)
    explained = (seen**2 * spent - by_images).reshape(t, n, 2, 3).sum(axis=(1, 3))
    fisher = np.sum((inner**2).reshape(t, n, 2, 3, 2, 3), axis=(1, 3, 5))
    variances: Array = np.minimum(nonnegative_variances(fisher, explained), MAX_VARIANCES)
    return variances


def _where(chosen: NDArray[np.bool_], new: Array, old: Array) -> Array:
    """`new` for the chosen members of a stack, `old` for the others."""
    return np.where(chosen.reshape(-1, *[1] * (new.ndim - 1)), new, old)


def _squared_distances(residuals: Array, information: Array) -> Array:
    distances: Array = np.sum(residuals * (information @ residuals[..., None])[..., 0], axis=-1)
    return distances

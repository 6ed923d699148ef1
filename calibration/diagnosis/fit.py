"""How likely the evidence is under one assumption: maximum likelihood over X, target's pose and robot noise.

Robot errors have two unknown levels (rotation, translation), so a wrong assumption shows as a large level, and two
assumptions are compared by their likelihoods at their own best levels. X or the target's pose may change once.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.closed_forms.kronecker import kronecker
from calibration.diagnosis.evidence import Evidence
from calibration.prediction import adjoint
from calibration.transforms import (
    Array,
    inverse,
    nearest_rotation,
    rotation_from_vector,
    transform,
    vector_from_rotation,
)

ITERATIONS = 8
GROUPS = (slice(0, 3), slice(3, 6))
SMALLEST_VARIANCE = np.array([1e-7**2, 1e-4**2])
"""rad², mm²: below what any controller prints."""

LARGEST_VARIANCE = np.array([1.0**2, 1e5**2])
"""rad², mm²: beyond any robot; a wrong assumption needs no better number."""

LONGEST_STEP = np.repeat([0.5, 2000.0], 3)
"""rad, mm"""

Labels = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Fit:
    """`mount_T_camera` (g, 4, 4) and `anchor_T_target` (h, 4, 4), one a label; robot variances (2,) in rad² and mm²."""

    mount_T_camera: Array
    anchor_T_target: Array
    variances: Array
    residuals: Array
    covariance: Array
    log_likelihood: float

    @property
    def robot_translation_mm(self) -> float:
        """The robot's translation noise that this assumption needs."""
        return float(np.sqrt(self.variances[1]))

    @property
    def robot_rotation_rad(self) -> float:
        """The robot's rotation noise that this assumption needs."""
        return float(np.sqrt(self.variances[0]))

    def distances(self) -> Array:
        """Squared Mahalanobis distance (n,) of every view."""
        return _squared(self.residuals, self.covariance)


def fit(evidence: Evidence, x_labels: Labels | None = None, y_labels: Labels | None = None) -> Fit:
    """`x_labels`, `y_labels` (n,): which X and which target pose holds in each view; one of each by default."""
    n = len(evidence)
    x_labels = np.zeros(n, np.intp) if x_labels is None else x_labels
    y_labels = np.zeros(n, np.intp) if y_labels is None else y_labels
    X, Y = _start(evidence, x_labels, y_labels)
    variances = np.array([1e-4**2, 0.1**2])
    for _ in range(ITERATIONS):
        residuals, by_shared, by_robot = _linearised(evidence, X, Y, x_labels, y_labels)
        covariance = _covariance(evidence, by_robot, variances)
        step, left = _step(residuals, by_shared, covariance)
        X, Y = _moved(X, step[: 6 * len(X)]), _moved(Y, step[6 * len(X) :])
        variances = _variances(evidence, left, by_robot, covariance, by_shared.shape[-1])
    residuals, _, by_robot = _linearised(evidence, X, Y, x_labels, y_labels)
    covariance = _covariance(evidence, by_robot, variances)
    _, log_determinant = np.linalg.slogdet(covariance)
    log_likelihood = -0.5 * float(np.sum(log_determinant + _squared(residuals, covariance)))
    return Fit(X, Y, variances, residuals, covariance, log_likelihood)


def predicted_base_T_flange(evidence: Evidence, fitted: Fit, view: int) -> Array:
    """Where the robot must have stood in a view (4, 4), judging by its image and the fit."""
    anchor_T_mount = fitted.anchor_T_target[0] @ inverse(fitted.mount_T_camera[0] @ evidence.camera_T_target[view])
    return anchor_T_mount if evidence.setup == "eye-in-hand" else inverse(anchor_T_mount)


def residuals_of(evidence: Evidence, fitted: Fit) -> tuple[Array, Array]:
    """Residuals (n, 6) and their covariance (n, 6, 6) of views that need not have taken part in the fit."""
    zeros = np.zeros(len(evidence), np.intp)
    residuals, _, by_robot = _linearised(evidence, fitted.mount_T_camera, fitted.anchor_T_target, zeros, zeros)
    return residuals, _covariance(evidence, by_robot, fitted.variances)


def _start(evidence: Evidence, x_labels: Labels, y_labels: Labels) -> tuple[Array, Array]:
    """Closed form for X from the longest stretch with one X and one target pose, then the mean of what it says of Y."""
    anchor_T_mount = evidence.anchor_T_mount()
    stretch = x_labels * (y_labels.max() + 1) + y_labels
    longest = stretch == np.bincount(stretch).argmax()
    X = np.repeat(
        kronecker(anchor_T_mount[longest], evidence.camera_T_target[longest])[None], x_labels.max() + 1, axis=0
    )
    anchor_T_target = anchor_T_mount @ X[x_labels] @ evidence.camera_T_target
    Y = np.array([_mean(anchor_T_target[y_labels == label]) for label in range(y_labels.max() + 1)])
    return X, Y


def _mean(poses: Array) -> Array:
    return transform(nearest_rotation(poses[:, :3, :3].mean(axis=0))[0], poses[:, :3, 3].mean(axis=0))


def _linearised(
    evidence: Evidence, X: Array, Y: Array, x_labels: Labels, y_labels: Labels
) -> tuple[Array, Array, Array]:
    """Residuals (n, 6), their derivatives by the shared unknowns (n, 6, p) and by the robot's error (n, 6, 6)."""
    n = len(evidence)
    camera_T_target = inverse(evidence.anchor_T_mount() @ X[x_labels]) @ Y[y_labels]
    off = camera_T_target @ inverse(evidence.camera_T_target)
    residuals = np.concatenate([vector_from_rotation(off[:, :3, :3]), off[:, :3, 3]], axis=1)
    rows = np.arange(n)
    by_x, by_y = np.zeros((n, 6, len(X), 6)), np.zeros((n, 6, len(Y), 6))
    by_x[rows, :, x_labels] = -np.eye(6)
    by_y[rows, :, y_labels] = adjoint(camera_T_target)
    if evidence.setup == "eye-in-hand":
        by_robot = -adjoint(inverse(X))[x_labels]
    else:
        by_robot = adjoint(camera_T_target @ inverse(Y)[y_labels])
    return residuals, np.concatenate([by_x.reshape(n, 6, -1), by_y.reshape(n, 6, -1)], axis=-1), by_robot


def _covariance(evidence: Evidence, by_robot: Array, variances: Array) -> Array:
    deviation = np.sqrt(np.repeat(np.maximum(variances, SMALLEST_VARIANCE), 3))
    spread = by_robot * deviation
    return evidence.covariance + spread @ np.swapaxes(spread, 1, 2)


def _step(residuals: Array, by_shared: Array, covariance: Array) -> tuple[Array, Array]:
    """Gauss-Newton step (p,) and the residuals it leaves (n, 6)."""
    weighted = np.linalg.solve(covariance, by_shared)
    normal = np.einsum("nij,nik->jk", by_shared, weighted)
    gradient = np.einsum("nij,ni->j", weighted, residuals)
    scale = 1 / np.sqrt(np.maximum(np.diagonal(normal), 1e-300))
    scaled = scale[:, None] * normal * scale + 1e-12 * np.eye(len(scale))
    step = -scale * np.linalg.solve(scaled, scale * gradient)
    # A wrong assumption may have no sensible fit: keep the steps within what still is a cell.
    step = np.clip(step, -np.tile(LONGEST_STEP, len(step) // 6), np.tile(LONGEST_STEP, len(step) // 6))
    left: Array = residuals + by_shared @ step
    return step, left


def _variances(evidence: Evidence, residuals: Array, by_robot: Array, covariance: Array, shared: int) -> Array:
    """Fisher scoring of the two robot variances (2,), neither below zero, corrected for the unknowns spent.

    Of quadratic = sum |U_g' W r|² the images' own noise explains tr(U_g' W S_image W U_g), the robot the rest.
    """
    weighted = np.linalg.solve(covariance, by_robot)
    seen = np.einsum("nij,ni->nj", weighted, residuals)
    inner = np.swapaxes(by_robot, 1, 2) @ weighted
    by_images = np.einsum("nij,nik,nkj->nj", weighted, evidence.covariance, weighted)
    spent = residuals.size / max(residuals.size - shared, 1)
    explained = np.array([np.sum(seen[:, g] ** 2) * spent - np.sum(by_images[:, g]) for g in GROUPS])
    fisher = np.array([[np.sum(inner[:, g, h] ** 2) for h in GROUPS] for g in GROUPS])
    scale = 1 / np.sqrt(np.diagonal(fisher))
    both = scale * np.linalg.solve(scale[:, None] * fisher * scale, scale * explained)
    alone = np.where(scale * explained == np.max(scale * explained), np.maximum(scale**2 * explained, 0.0), 0.0)
    return np.minimum(np.where(np.all(both >= 0), both, alone), LARGEST_VARIANCE)


def _moved(a_T_b: Array, step: Array) -> Array:
    """T @ exp(step), for stacks (g, 4, 4) and a flat step (6 g,)."""
    steps = step.reshape(-1, 6)
    moved: Array = a_T_b @ transform(rotation_from_vector(steps[:, :3]), steps[:, 3:])
    return moved


def _squared(residuals: Array, covariance: Array) -> Array:
    distances: Array = np.einsum("ni,ni->n", residuals, np.linalg.solve(covariance, residuals[..., None])[..., 0])
    return distances

"""The linearised model of one step: y_i + A_i b + U_i c_i = -e_i, with c_i ~ N(0, D) and e_i ~ N(0, s_px²).

b (p,) are the shared unknowns (X, Y[, intrinsics]), c_i (6,) the correction of robot pose i. Marginalising c_i leaves
V_i = s_px² I + U_i D U_i', and everything the estimator needs is a sum over views of 6×6 and 6×p products (the Schur
complement over the views); V^-1 is applied by Woodbury's identity, which also holds where D is zero.
Source: D. Harville, "Maximum likelihood approaches to variance component estimation", JASA 72, 1977.
"""

from dataclasses import dataclass

import numpy as np

from calibration.likelihood.chain import Chain
from calibration.likelihood.pixels import PixelStatistics
from calibration.transforms import Array


@dataclass(frozen=True)
class Variances:
    """Of a pixel coordinate, of a robot rotation and of a robot translation component (px², rad², mm²)."""

    pixel: float
    rotation: float
    translation: float

    def deviations(self) -> Array:
        """Standard deviations (6,) of a correction."""
        deviations: Array = np.sqrt(np.repeat([self.rotation, self.translation], 3))
        return deviations


@dataclass(frozen=True, eq=False)
class MixedModel:
    """Sums of products per view, unweighted; y is the residual with the robot pose taken as reported."""

    yy: Array
    Uy: Array
    UU: Array
    UA: Array
    Ay: Array
    AA: Array
    count: Array

    @property
    def shared(self) -> int:
        """p"""
        return int(self.Ay.shape[1])

    def take(self, chosen: Array) -> "MixedModel":
        """Only the chosen views."""
        return MixedModel(*(array[chosen] for array in vars(self).values()))


def linearised(statistics: PixelStatistics, chain: Chain, camera_T_target: Array) -> MixedModel:
    """The model around the present chain, whose poses are `camera_T_target`."""
    n, k = statistics.gradient.shape
    by_pose, by_robot = chain.by_shared(camera_T_target), chain.by_correction(camera_T_target)
    by_shared = np.zeros((n, k, 12 + k - 6))
    by_shared[:, :6, :12] = by_pose
    by_shared[:, 6:, 12:] = np.eye(k - 6)
    # The residual as if the corrections were zero: y = r - U c.
    undo = -(by_robot @ chain.corrections[..., None])
    towards = (statistics.normal[:, :, :6] @ undo)[..., 0]
    gradient = statistics.gradient + towards
    square = statistics.square + ((2 * statistics.gradient + towards)[:, :6] * undo[..., 0]).sum(axis=1)
    shared_t, robot_t = np.swapaxes(by_shared, 1, 2), np.swapaxes(by_robot, 1, 2)
    normal_shared = statistics.normal @ by_shared
    return MixedModel(
        yy=square,
        Uy=(robot_t @ gradient[:, :6, None])[..., 0],
        UU=robot_t @ statistics.normal[:, :6, :6] @ by_robot,
        UA=robot_t @ normal_shared[:, :6],
        Ay=(shared_t @ gradient[..., None])[..., 0],
        AA=shared_t @ normal_shared,
        count=statistics.count,
    )


@dataclass(frozen=True, eq=False)
class Step:
    """Best linear unbiased prediction: shared step b (p,), corrections c (n, 6), information and covariance (p, p).

    `view_information` (n, p, p) and `view_gradient` (n, p) are each view's part of the marginal normal equations at
    b = 0; `K` (n, 6, 6) is D^½ (s² I + D^½ U'U D^½)^-1 D^½.
    """

    b: Array
    corrections: Array
    information: Array
    covariance: Array
    view_information: Array
    view_gradient: Array
    K: Array


def solve(model: MixedModel, variances: Variances) -> Step:
    """Generalised least squares for b, and the prediction of every c_i given b."""
    K = woodbury(model, variances)
    pixel = variances.pixel
    KUA = K @ model.UA
    KUy = (K @ model.Uy[..., None])[..., 0]
    UA_t = np.swapaxes(model.UA, 1, 2)
    view_information = (model.AA - UA_t @ KUA) / pixel
    view_gradient = (model.Ay - (UA_t @ KUy[..., None])[..., 0]) / pixel
    information = view_information.sum(axis=0)
    covariance = covariance_of(information)
    b = -covariance @ view_gradient.sum(axis=0)
    return Step(b, -(KUy + KUA @ b), information, covariance, view_information, view_gradient, K)


def woodbury(model: MixedModel, variances: Variances) -> Array:
    """K (n, 6, 6) with V^-1 = (I - U K U') / s²; zero where the robot is exact."""
    deviation = variances.deviations()
    scaled = deviation[:, None] * model.UU * deviation + variances.pixel * np.eye(6)
    K: Array = deviation[:, None] * np.linalg.inv(scaled) * deviation
    return K


def covariance_of(information: Array) -> Array:
    """Inverses of symmetric positive matrices (..., k, k) whose unknowns have different units."""
    scale = 1 / np.sqrt(np.maximum(np.diagonal(information, axis1=-2, axis2=-1), 1e-30))
    values, vectors = np.linalg.eigh(scale[..., :, None] * information * scale[..., None, :])
    vectors = scale[..., :, None] * vectors
    covariance: Array = (vectors / np.maximum(values, 1e-14)[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return covariance

"""The linearised model of one step: y_i + A_i b + U_i c_i = -e_i, with c_i ~ N(0, D) and e_i ~ N(0, s_px²).

b (p,) are the shared unknowns (X, Y[, intrinsics]), c_i (6,) the correction of robot pose i. Marginalising c_i leaves
V_i = s_px² I + U_i D U_i', and everything the estimator needs is a sum over views of 6×6 and 6×p products (the Schur
complement over the views); V^-1 is applied by Woodbury's identity, which also holds where D is zero.
Some of b may be known beforehand, to within a deviation of their own: they are random as c_i is, and share every sum.
Source: D. Harville, "Maximum likelihood approaches to variance component estimation", JASA 72, 1977.
"""

from dataclasses import dataclass, replace

import numpy as np

from calibration.likelihood.chain import Chain
from calibration.likelihood.pixels import PixelStatistics
from calibration.transforms import Array

SMALLEST_TREND = np.array([1e-7, 1e-4]) ** 2
"""rad², mm²: below what any controller prints."""


@dataclass(frozen=True)
class Variances:
    """Of a pixel coordinate, of a robot rotation and of a robot translation component (px², rad², mm²).

    `trend_rotation`, `trend_translation`: of a coefficient of the robot's errors that neighbouring poses share.
    """

    pixel: float
    rotation: float
    translation: float
    trend_rotation: float = 0.0
    trend_translation: float = 0.0

    def deviations(self) -> Array:
        """Standard deviations (6,) of a correction."""
        deviations: Array = np.sqrt(np.repeat([self.rotation, self.translation], 3))
        return deviations

    def trend_variances(self) -> Array:
        """(6,) of the trend's coefficients; never quite zero, for they are divided by."""
        both: Array = np.repeat(np.maximum([self.trend_rotation, self.trend_translation], SMALLEST_TREND), 3)
        return both


@dataclass(frozen=True, eq=False)
class MixedModel:
    """Sums of products per view, unweighted; y is the residual with the robot pose taken as reported.

    `known` (p,): inverse variances of what is known of b beforehand, about `-offset` (p,). Of the robot's corrections
    a part follows the `basis` (n, m) over the views: its 6 m coefficients end b, their variances are noise levels.
    """

    yy: Array
    Uy: Array
    UU: Array
    UA: Array
    Ay: Array
    AA: Array
    count: Array
    known: Array
    offset: Array
    basis: Array

    @property
    def shared(self) -> int:
        """p"""
        return int(self.Ay.shape[1])

    @property
    def trend(self) -> int:
        """m"""
        return int(self.basis.shape[1])

    def known_information(self, variances: Variances) -> Array:
        """(p,)"""
        if not self.trend:
            return self.known
        return np.concatenate([self.known[: -6 * self.trend], np.tile(1 / variances.trend_variances(), self.trend)])

    def corrections(self, K: Array, b: Array) -> Array:
        """The prediction (n, 6) of every correction given b (p,)."""
        own = -(K @ (self.Uy + self.UA @ b)[..., None])[..., 0]
        return own + self.basis @ b[self.shared - 6 * self.trend :].reshape(self.trend, 6)


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
        known=np.zeros(12 + k - 6),
        offset=np.zeros(12 + k - 6),
        basis=np.zeros((n, 0)),
    )


def with_trend(model: MixedModel, basis: Array) -> MixedModel:
    """The same, with corrections that follow the `basis` (n, m) over the views beside those of each view alone."""
    n, m = basis.shape
    follow = (basis[:, None, :, None] * np.eye(6)[:, None]).reshape(n, 6, 6 * m)  # correction (6) by coefficients
    follow_t = np.swapaxes(follow, 1, 2)
    mixed = np.swapaxes(model.UA, 1, 2) @ follow
    own = follow_t @ model.UU @ follow
    zeros = np.zeros(6 * m)
    return replace(
        model,
        UA=np.concatenate([model.UA, model.UU @ follow], axis=2),
        Ay=np.concatenate([model.Ay, (follow_t @ model.Uy[..., None])[..., 0]], axis=1),
        AA=np.concatenate(
            [np.concatenate([model.AA, mixed], axis=2), np.concatenate([np.swapaxes(mixed, 1, 2), own], axis=2)], axis=1
        ),
        known=np.concatenate([model.known, zeros]),
        offset=np.concatenate([model.offset, zeros]),
        basis=basis,
    )


@dataclass(frozen=True, eq=False)
class Step:
    """Best linear unbiased prediction: shared step b (p,), corrections c (n, 6), information and covariance (p, p).

    `view_information` (n, p, p) and `view_gradient` (n, p) are each view's part of the marginal normal equations at
    b = 0; what is known beforehand is in the sums only. `K` (n, 6, 6) is D^½ (s² I + D^½ U'U D^½)^-1 D^½.
    """

    b: Array
    corrections: Array
    information: Array
    gradient: Array
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
    known = model.known_information(variances)
    information = view_information.sum(axis=0) + np.diag(known)
    gradient = view_gradient.sum(axis=0) + known * model.offset
    covariance = covariance_of(information)
    b = -covariance @ gradient
    return Step(b, model.corrections(K, b), information, gradient, covariance, view_information, view_gradient, K)


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

"""The linearised model of one step: y_i + A_i b + U_i c_i = -e_i, with c_i ~ N(0, D) and e_i ~ N(0, s_px²).

b (p,) are the shared unknowns (X, Y[, intrinsics]), c_i (6,) the correction of robot pose i. Marginalising c_i leaves
V_i = s_px² I + U_i D U_i', and everything the estimator needs is a sum over views of 6×6 and 6×p products (the Schur
complement over the views); V^-1 is applied by Woodbury's identity, which also holds where D is zero.
Elements of b may have a Gaussian prior, which is added to the normal equations.
Source: D. Harville, "Maximum likelihood approaches to variance component estimation", JASA 72, 1977.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calibration.knowledge import PriorMixture
from calibration.likelihood.chain import Chain
from calibration.linear_algebra import covariance_of, inverse_or_pseudo_inverse
from calibration.observations.pose_model import derivative_by_shared
from calibration.observations.reprojection import PixelStatistics
from calibration.transforms import Array, vector_from_rotation

MIN_TREND_VARIANCES = np.array([1e-7, 1e-4]) ** 2
"""rad², mm²: floor of the trend's variances, below the resolution of any controller."""


@dataclass(frozen=True)
class Variances:
    """Variances of a pixel coordinate (px²), and of a component of a robot rotation (rad²) and translation (mm²).

    `trend_rotation`, `trend_translation`: of a coefficient of the part of the robot's errors that follows the pose.
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
        """Variances (6,) of the trend's coefficients, at least MIN_TREND_VARIANCES."""
        both: Array = np.repeat(np.maximum([self.trend_rotation, self.trend_translation], MIN_TREND_VARIANCES), 3)
        return both


@dataclass(frozen=True, eq=False)
class MixedModel:
    """Sums of products per view, unweighted; y is the residual with the robot pose taken as reported.

    `by_robot` (n, 6, 6 + p + 1): U' [U, A, y]; `squares` (n, q + 1, q + 1): [A, y]' [A, y], without the trend.
    `prior_information` (p,): inverse variances of the prior of b, whose mean is `-prior_offset` (p,). A part of the
    robot's corrections follows the `basis` (n, m) over the views; its 6 m coefficients are the last elements of b,
    and their variances are noise levels. `direct` (p + 1, p + 1): [G, g]' [G, g] of observations g + G b = -e of b
    alone, each over its standard deviation; for a model without a trend. `mixture`: the prior of the unknowns from
    place `mixture_at` on, of which `prior_information` is a single normal density.
    """

    by_robot: Array
    squares: Array
    count: Array
    prior_information: Array
    prior_offset: Array
    basis: Array
    direct: Array | None = None
    mixture: PriorMixture | None = None
    mixture_at: int = 12

    @property
    def unknowns(self) -> int:
        """Number of shared unknowns, p."""
        return len(self.prior_information)

    @property
    def trend_terms(self) -> int:
        """Number of trend terms, m; 0 without a trend."""
        return int(self.basis.shape[1])

    @property
    def UU(self) -> Array:
        """U' U (n, 6, 6)"""
        return self.by_robot[:, :, :6]

    @property
    def UAy(self) -> Array:
        """U' [A, y] (n, 6, p + 1)"""
        return self.by_robot[:, :, 6:]

    @cached_property
    def total(self) -> Array:
        """[A, y]' [A, y] over all views (p + 1, p + 1)."""
        total: Array = self.squares.sum(axis=0)
        if not self.trend_terms:
            return total
        n, m, q = len(self.count), self.trend_terms, len(total) - 1
        follow = (self.basis.T @ self.by_robot.reshape(n, -1)).reshape(6 * m, -1)  # sum of basis U' [U, A, y]
        both = (self.basis[:, :, None] * self.basis[:, None]).reshape(n, m * m)
        own = (both.T @ self.UU.reshape(n, 36)).reshape(m, m, 6, 6).transpose(0, 2, 1, 3).reshape(6 * m, 6 * m)
        return insert_columns(total, np.delete(follow[:, 6:], slice(q, q + 6 * m), axis=1), own)

    def per_view(self) -> Array:
        """[A, y]' [A, y] (n, p + 1, p + 1) of each view."""
        if not self.trend_terms:
            return self.squares
        n, m, q = len(self.count), self.trend_terms, self.squares.shape[1] - 1
        follow = (self.basis[:, :, None, None] * self.by_robot[:, None]).reshape(n, 6 * m, -1)
        own = (follow[:, :, None, :6] * self.basis[:, None, :, None]).reshape(n, 6 * m, 6 * m)
        return insert_columns(self.squares, np.delete(follow[:, :, 6:], slice(q, q + 6 * m), axis=2), own)

    def full_prior_information(self, variances: Variances) -> Array:
        """Inverse prior variances (p,), including those of the trend's coefficients."""
        if not self.trend_terms:
            return self.prior_information
        return np.concatenate(
            [
                self.prior_information[: -6 * self.trend_terms],
                np.tile(1 / variances.trend_variances(), self.trend_terms),
            ]
        )

    def beside_views(self, variances: Variances) -> Array:
        """Normal equations (p + 1, p + 1), as [A, y]' V^-1 [A, y], of the prior and of the observations of b alone."""
        known = self.full_prior_information(variances)
        weighed = known * self.prior_offset
        squares = np.diag(np.append(known, np.sum(weighed * self.prior_offset)))
        squares[:-1, -1] = squares[-1, :-1] = weighed
        return squares if self.direct is None else squares + self.direct

    def corrections(self, K: Array, b: Array) -> Array:
        """The prediction (n, 6) of every correction given b (p,)."""
        own: Array = -(K @ (self.UAy @ np.append(b, 1.0))[..., None])[..., 0]
        if not self.trend_terms:
            return own
        shared: Array = self.basis @ b[self.unknowns - 6 * self.trend_terms :].reshape(self.trend_terms, 6)
        return own + shared


def insert_columns(squares: Array, across: Array, own: Array) -> Array:
    """[A, y]' [A, y] (..., q + 1, q + 1) with more columns between A and y: `across` is T' [A, y], `own` T' T."""
    q, t = squares.shape[-1] - 1, own.shape[-1]
    order = np.concatenate([np.arange(q), q + 1 + np.arange(t), [q]])
    above = np.concatenate([squares, np.swapaxes(across, -1, -2)], axis=-1)
    whole = np.concatenate([above, np.concatenate([across, own], axis=-1)], axis=-2)
    bordered: Array = whole[..., order[:, None], order]
    return bordered


def linearise_model(statistics: PixelStatistics, chain: Chain, camera_T_target: Array) -> MixedModel:
    """The model around the present chain, whose poses are `camera_T_target`."""
    n, k = statistics.gradient.shape
    p = 12 + k - 6
    # Derivatives of pose, intrinsics and residual by [robot pose, shared unknowns, 1].
    by = np.zeros((n, k + 1, 6 + p + 1))
    robot = by[:, :6, :6] = chain.correction_jacobian(camera_T_target)
    by[:, :6, 6:18] = derivative_by_shared(camera_T_target)
    by[:, 6:, 18:] = np.eye(k - 5)
    # The residual as if the corrections were zero: y = r - U c.
    by[:, :6, -1] = -(robot @ chain.corrections[..., None])[..., 0]
    sums = statistics.sums @ by
    squares = np.swapaxes(by[:, :, 6:], 1, 2) @ sums[:, :, 6:]
    if chain.given is not None:
        squares += chain.given.squares(chain.mount_T_camera, chain.anchor_T_target, p) / n
    return MixedModel(
        by_robot=np.swapaxes(robot, 1, 2) @ sums[:, :6],
        squares=squares,
        count=statistics.count,
        prior_information=np.zeros(p),
        prior_offset=np.zeros(p),
        basis=np.zeros((n, 0)),
    )


def with_trend(model: MixedModel, basis: Array) -> MixedModel:
    """The model with a trend: corrections that follow the `basis` (n, m), besides those of the single views."""
    n, m = basis.shape
    follow = (model.UU[:, :, None] * basis[:, None, :, None]).reshape(n, 6, 6 * m)
    zeros = np.zeros(6 * m)
    return replace(
        model,
        by_robot=np.concatenate([model.by_robot[:, :, :-1], follow, model.by_robot[:, :, -1:]], axis=2),
        prior_information=np.concatenate([model.prior_information, zeros]),
        prior_offset=np.concatenate([model.prior_offset, zeros]),
        basis=basis,
    )


def with_arm(model: MixedModel, jacobian: Array, prior_information: Array, prior_offset: Array) -> MixedModel:
    """The model with k more unknowns (their last places), which correct robot pose i by `jacobian`[i] (n, 6, k).

    `prior_information`, `prior_offset` (k,): as of MixedModel. For a model without a trend.
    """
    follow = model.UU @ jacobian
    turned = np.swapaxes(jacobian, 1, 2)
    own = turned @ follow
    return replace(
        model,
        by_robot=np.concatenate([model.by_robot[:, :, :-1], follow, model.by_robot[:, :, -1:]], axis=2),
        squares=insert_columns(model.squares, turned @ model.UAy, own),
        prior_information=np.concatenate([model.prior_information, prior_information]),
        prior_offset=np.concatenate([model.prior_offset, prior_offset]),
    )


@dataclass(frozen=True, eq=False)
class Step:
    """Best linear unbiased prediction of the shared step b (p,), its information, gradient and covariance (p, p).

    `K` (n, 6, 6) is D^½ (s² I + D^½ U'U D^½)^-1 D^½, `KUAy` (n, 6, p + 1) K U' [A, y].
    """

    b: Array
    information: Array
    gradient: Array
    covariance: Array
    K: Array
    KUAy: Array


def solve(model: MixedModel, variances: Variances) -> Step:
    """Generalised least squares for b at the given variances."""
    K = woodbury(model, variances)
    p = model.unknowns
    KUAy = K @ model.UAy
    marginal = (model.total - sum_products(model.UAy, KUAy)) / variances.pixel
    beside = model.beside_views(variances)
    information, gradient = marginal[:p, :p] + beside[:p, :p], marginal[:p, p] + beside[:p, p]
    covariance = covariance_of(information)
    return Step(-covariance @ gradient, information, gradient, covariance, K, KUAy)


def per_view_equations(model: MixedModel, variances: Variances, step: Step) -> tuple[Array, Array]:
    """Each view's part (n, p, p) and (n, p) of the marginal normal equations at b = 0, without the prior."""
    p = model.unknowns
    marginal = (model.per_view() - np.swapaxes(model.UAy, 1, 2) @ step.KUAy) / variances.pixel
    return marginal[:, :p, :p], marginal[:, :p, p]


def sum_products(left: Array, right: Array) -> Array:
    """sum_n left_n' right_n (..., p, q) of (n, k, p) and (..., n, k, q)."""
    n, k, p = left.shape
    summed: Array = left.reshape(n * k, p).T @ right.reshape(*right.shape[:-3], n * k, right.shape[-1])
    return summed


def woodbury(model: MixedModel, variances: Variances) -> Array:
    """K (n, 6, 6) with V^-1 = (I - U K U') / s²; zero where the robot is exact."""
    deviation = variances.deviations()
    scaled = deviation[:, None] * model.UU * deviation + variances.pixel * np.eye(6)
    K: Array = deviation[:, None] * inverse_or_pseudo_inverse(scaled) * deviation
    return K


def trend_basis(base_T_flange: Array) -> Array:
    """Regressors (n, 6) of the part of the robot's errors that follows its pose.

    Position and orientation about their mean, in units of their spread: geometric errors differ little between
    neighbouring poses.
    """
    places = base_T_flange[:, :3, 3] - base_T_flange[:, :3, 3].mean(axis=0)
    turns = vector_from_rotation(base_T_flange[0, :3, :3].T @ base_T_flange[:, :3, :3])
    turns = turns - turns.mean(axis=0)
    parts = [part / max(float(np.sqrt(np.mean(np.sum(part**2, axis=1)))), 1e-12) for part in (places, turns)]
    return np.concatenate(parts, axis=1)

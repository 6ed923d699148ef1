"""Maximum-likelihood iteration: linearise, estimate the noise, step, until the step is far below its uncertainty."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.camera import CameraModel
from calibration.kinematics.robot_accuracy import USUAL_BELIEF, NoiseBelief
from calibration.likelihood.chain import Chain
from calibration.likelihood.mixed_model import (
    MixedModel,
    Step,
    Variances,
    linearise_model,
    solve,
    trend_basis,
    with_trend,
)
from calibration.likelihood.noise_marginalisation import MAX_PRIOR_VIEWS, marginalise
from calibration.likelihood.nuisances import Nuisances
from calibration.likelihood.variance_components import estimate_variances
from calibration.linear_algebra import covariance_of, scaled_solve, squared_distances
from calibration.observations.observations import Observations
from calibration.observations.reprojection import PixelStatistics
from calibration.solution import ArmScale
from calibration.transforms import Array, inverse, vector_from_transform

MAX_ITERATIONS = 25
MAX_NOISE_ITERATIONS = 10
"""Iterations that update the noise levels; with few views levels and X may alternate, so the levels are fixed then."""

STEP_TOLERANCE_SIGMA = 1e-3
"""The iteration ends when the RMS step is below this many standard deviations of the estimate."""

MAX_AVERAGES = 6
AVERAGE_TOLERANCE_SIGMA = 0.02
"""The mean over priors and noise levels is taken about itself until it moves by less, in standard deviations (RMS)."""

SIGNIFICANT_SQUARES = {1: 9.0, 2: 11.83, 3: 14.16, 5: 18.21, 11: 28.51}
"""Chi-square exceeded with a probability of 0.27 %, as three standard deviations are, by degrees of freedom."""

PixelModel = Callable[[Array, Array], PixelStatistics]
"""Pixel statistics at poses (n, 4, 4) and deviations z (q,) of the nuisances."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Chain, nuisances z (q,) and noise at the optimum, with the model linearised there and its last step.

    `arm_scale`: what is known of the arm's lengths, None until it is averaged; `belief`: in the noise, after that.
    """

    chain: Chain
    nuisances: Nuisances | None
    z: Array
    variances: Variances
    model: MixedModel
    step: Step
    converged: bool
    arm_scale: ArmScale | None = None
    belief: NoiseBelief = USUAL_BELIEF

    @property
    def camera(self) -> CameraModel:
        """The camera with the deviations found."""
        assert self.nuisances is not None
        return self.nuisances.camera_at(self.z)

    @property
    def scale(self) -> float:
        """Of the target against the description, in the arm's millimetres."""
        return 1.0 if self.nuisances is None else self.nuisances.scale_at(self.z)

    def seen(self, observations: Observations) -> Observations:
        """The observations with the target as found."""
        return observations if self.nuisances is None else self.nuisances.seen_at(observations, self.z)

    def differs(self, places: Sequence[int]) -> bool:
        """Whether the nuisances at these places of z differ from the description; by chance in 0.3 % of sessions."""
        at = 12 + np.asarray(places)
        covariance = self.step.covariance[np.ix_(at, at)]
        return bool(squared_distances(self.z[at - 12], covariance) > SIGNIFICANT_SQUARES[len(at)])

    def shift_of_x(self, places: Sequence[int]) -> Array:
        """By how much X moves (6,) [rad, mm] from where it would be with these nuisances as described."""
        at = 12 + np.asarray(places)
        covariance = self.step.covariance
        moved: Array = covariance[:6, at] @ scaled_solve(covariance[np.ix_(at, at)], self.z[at - 12, None])[:, 0]
        return moved

    def trend_variances(self) -> Array:
        """Mean variances (2,) rad², mm² over the views of the part of the robot's errors that follows the pose."""
        levels = np.array([self.variances.trend_rotation, self.variances.trend_translation])
        in_the_mean: Array = levels * float(np.mean(np.sum(self.model.basis**2, axis=1)))
        return in_the_mean


def exact_pixels(seen: Observations, nuisances: Nuisances) -> PixelModel:
    """Statistics computed from the pixels at every call."""
    return lambda poses, z: nuisances.statistics(seen, poses, z)


def quadratic_pixels(statistics: PixelStatistics, camera_T_target: Array) -> PixelModel:
    """Statistics as a quadratic about the views' own poses (n, 4, 4), without nuisances: nearly exact, and quicker."""
    own = inverse(camera_T_target)

    def expand(poses: Array, z: Array) -> PixelStatistics:
        off = vector_from_transform(poses @ own)
        sums = statistics.sums.copy()
        sums[:, :, -1] += (sums[:, :, :-1] @ off[..., None])[..., 0]
        sums[:, -1, :] += (off[:, None] @ sums[:, :-1, :])[:, 0]
        return PixelStatistics(sums, statistics.count)

    return expand


def estimate(
    pixels: PixelModel,
    start: Chain,
    variances: Variances,
    nuisances: Nuisances | None = None,
    z: Array | None = None,
    *,
    trend: bool = False,
    fixed_noise: bool = False,
) -> Estimate:
    """Maximise the likelihood from a start whose corrections reproduce each view's own pose.

    `nuisances` with their start `z` (q,), none by default; their priors are taken as the widest of each mixture.
    `trend`: part of the robot's errors follows its pose; `fixed_noise`: keep the noise levels at `variances`.
    """
    z = np.zeros(0 if nuisances is None else len(nuisances)) if z is None else z
    chain, converged, coefficients = start, False, np.zeros(0)
    for iteration in range(MAX_ITERATIONS):
        model = linearise(pixels, chain, nuisances, z, trend=trend)
        if not fixed_noise and iteration < MAX_NOISE_ITERATIONS:
            variances = estimate_variances(model, variances)
        step = solve(model, variances)
        # Each step starts at the result of the last one, but for the trend's coefficients, which start at zero.
        change = step.b.copy()
        change[len(change) - len(coefficients) :] -= coefficients
        coefficients = step.b[len(step.b) - 6 * model.trend_terms :]
        small = change @ step.information @ change < STEP_TOLERANCE_SIGMA**2 * len(change)
        # The last step is far below its uncertainty, so no new linearisation is needed after it.
        chain, z = _apply_step(chain, z, model, step.b, step.K)
        if small:
            converged = True
            break
    return Estimate(chain, nuisances, z, variances, model, step, converged)


def average(pixels: PixelModel, best: Estimate, belief: NoiseBelief) -> Estimate:
    """The estimate with X averaged over the nuisances' priors and the robot's noise levels.

    With few views the levels are averaged as well. The mean may be far from the optimum under the widest priors, so
    the model is linearised again about it.
    """
    model, variances, trend = best.model, best.variances, bool(best.model.trend_terms)
    chain, z, off = best.chain, best.z, np.zeros(0)
    information = model.prior_information
    for _ in range(MAX_AVERAGES):
        model = linearise(pixels, chain, best.nuisances, z, trend=trend)
        model = replace(model, prior_information=information)
        mean = marginalise(model, best.variances, belief)
        information = mean.prior_information
        model = replace(model, prior_information=information)
        variances = mean.variances if len(model.count) <= MAX_PRIOR_VIEWS else best.variances
        step = solve(model, variances)
        chain, z = _apply_step(chain, z, model, mean.b, step.K)
        off = mean.b[: 12 + len(z)]
        small = off @ covariance_of(mean.covariance)[: len(off), : len(off)] @ off
        if small < AVERAGE_TOLERANCE_SIGMA**2 * len(off):
            break
    averages = replace(step, b=mean.b, covariance=mean.covariance)
    return replace(
        best,
        chain=chain,
        z=z,
        variances=variances,
        model=model,
        step=averages,
        arm_scale=mean.arm_scale,
        belief=mean.belief,
    )


def linearise(
    pixels: PixelModel, chain: Chain, nuisances: Nuisances | None, z: Array, *, trend: bool = False
) -> MixedModel:
    """The model around the present chain and deviations z (q,), with the nuisances' priors."""
    poses = chain.camera_T_target()
    model = linearise_model(pixels(poses, z), chain, poses)
    if nuisances is not None:
        known = 12 + nuisances.first_known
        information, offset = model.prior_information.copy(), model.prior_offset.copy()
        information[known:], offset[known:] = nuisances.prior.widest(), z[nuisances.first_known :]
        model = replace(
            model, prior_information=information, prior_offset=offset, mixture=nuisances.prior, mixture_at=known
        )
    return with_trend(model, trend_basis(chain.base_T_flange)) if trend else model


def _apply_step(chain: Chain, z: Array, model: MixedModel, b: Array, K: Array) -> tuple[Chain, Array]:
    return chain.apply_step(b[:12], model.corrections(K, b)), z + b[12 : 12 + len(z)]

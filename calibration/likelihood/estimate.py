"""Maximum-likelihood iteration: linearise, estimate the noise, step, until the step is far below its uncertainty."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.likelihood.chain import Chain
from calibration.likelihood.mixed_model import MixedModel, Step, Variances, linearise_model, solve
from calibration.likelihood.noise_marginalisation import MAX_PRIOR_VIEWS, marginalise
from calibration.likelihood.systematic_errors import NO_SYSTEMATIC_ERRORS, SystematicErrors
from calibration.likelihood.variance_components import estimate_variances
from calibration.observations.observations import Observations, scale_target
from calibration.observations.reprojection import INTRINSICS, PixelStatistics, pixel_statistics, with_intrinsics
from calibration.transforms import Array, inverse, vector_from_transform

MAX_ITERATIONS = 25
MAX_NOISE_ITERATIONS = 10
"""Iterations that update the noise levels; with few views levels and X may alternate, so the levels are fixed then."""

STEP_TOLERANCE_SIGMA = 1e-3
"""The iteration ends when the RMS step is below this many standard deviations of the estimate."""

PixelModel = Callable[[Array, CameraModel, float], PixelStatistics]
"""Pixel statistics at poses (n, 4, 4), a camera and a scale of the target."""

FreeMask = NDArray[np.bool_]
"""Which of fx fy cx cy k1 k2 p1 p2 k3 and the target's scale are unknown (10,)."""

ALL_FIXED = np.zeros(INTRINSICS + 1, bool)


@dataclass(frozen=True, eq=False)
class Estimate:
    """Chain, camera, target scale and noise at the optimum, with the model linearised there and its last step."""

    chain: Chain
    camera: CameraModel
    scale: float
    free: FreeMask
    variances: Variances
    model: MixedModel
    step: Step
    converged: bool

    def trend_variances(self) -> Array:
        """Mean variances (2,) rad², mm² over the views of the part of the robot's errors that follows the pose."""
        levels = np.array([self.variances.trend_rotation, self.variances.trend_translation])
        in_the_mean: Array = levels * float(np.mean(np.sum(self.model.basis**2, axis=1)))
        return in_the_mean


def exact_pixels(seen: Observations, free: FreeMask) -> PixelModel:
    """Statistics computed from the pixels at every call, with `free` (10,) among the unknowns."""
    intrinsics, sized = free[:INTRINSICS], bool(free[INTRINSICS])

    def at(poses: Array, camera: CameraModel, scale: float) -> PixelStatistics:
        return pixel_statistics(scale_target(seen, scale), camera, poses, free_intrinsics=intrinsics, free_scale=sized)

    return at


def quadratic_pixels(statistics: PixelStatistics, camera_T_target: Array) -> PixelModel:
    """Statistics as a quadratic about the views' own poses (n, 4, 4): nearly exact, and much quicker."""
    own = inverse(camera_T_target)

    def expand(poses: Array, camera: CameraModel, scale: float) -> PixelStatistics:
        off = vector_from_transform(poses @ own)
        sums = statistics.sums.copy()
        sums[:, :, -1] += (sums[:, :, :-1] @ off[..., None])[..., 0]
        sums[:, -1, :] += (off[:, None] @ sums[:, :-1, :])[:, 0]
        return PixelStatistics(sums, statistics.count)

    return expand


def estimate(
    pixels: PixelModel,
    camera: CameraModel,
    start: Chain,
    variances: Variances,
    free: FreeMask = ALL_FIXED,
    scale: float = 1.0,
    systematic_errors: SystematicErrors = NO_SYSTEMATIC_ERRORS,
    *,
    fixed_noise: bool = False,
) -> Estimate:
    """Maximise the likelihood from a start whose corrections reproduce each view's own pose.

    `free` (10,): the unknown intrinsics and scale; `fixed_noise`: keep the noise levels at `variances`.
    """
    chain, converged, coefficients = start, False, np.zeros(0)
    for iteration in range(MAX_ITERATIONS):
        model = systematic_errors.apply(linearise(pixels, chain, camera, scale), free, camera, chain.base_T_flange)
        if not fixed_noise and iteration < MAX_NOISE_ITERATIONS:
            variances = estimate_variances(model, variances)
        step = solve(model, variances)
        # Each step starts at the result of the last one, but for the trend's coefficients, which start at zero.
        change = step.b.copy()
        change[len(change) - len(coefficients) :] -= coefficients
        coefficients = step.b[len(step.b) - 6 * model.trend_terms :]
        small = change @ step.information @ change < STEP_TOLERANCE_SIGMA**2 * len(change)
        # The last step is far below its uncertainty, so no new linearisation is needed after it.
        corrections = model.corrections(step.K, step.b)
        chain, camera, scale = _apply_step(chain, camera, scale, free, step.b, corrections)
        if small:
            converged = True
            break
    return Estimate(chain, camera, scale, free, variances, model, step, converged)


def marginalise_noise(best: Estimate) -> Estimate:
    """The estimate with X averaged over the robot's noise levels; with few views the levels are averaged as well."""
    mean = marginalise(best.model, best.variances)
    few = len(best.model.count) <= MAX_PRIOR_VIEWS
    variances = mean.variances if few else best.variances
    step = solve(best.model, variances) if few else best.step
    off = mean.b - best.step.b  # the chain already contains the last step
    corrections = best.model.corrections(step.K, mean.b)
    chain, camera, scale = _apply_step(best.chain, best.camera, best.scale, best.free, off, corrections)
    averages = replace(step, b=mean.b, covariance=mean.covariance)
    return replace(best, chain=chain, camera=camera, scale=scale, variances=variances, step=averages)


def linearise(pixels: PixelModel, chain: Chain, camera: CameraModel, scale: float) -> MixedModel:
    """The model around the present chain, camera and scale."""
    poses = chain.camera_T_target()
    return linearise_model(pixels(poses, camera, scale), chain, poses)


def _apply_step(
    chain: Chain, camera: CameraModel, scale: float, free: FreeMask, b: Array, corrections: Array
) -> tuple[Chain, CameraModel, float]:
    moved = chain.apply_step(b[:12], corrections)
    change = np.zeros(INTRINSICS + 1)
    change[free] = b[12 : 12 + np.count_nonzero(free)]
    if np.any(free[:INTRINSICS]):
        camera = with_intrinsics(camera, change[:INTRINSICS])
    return moved, camera, scale * (1 + float(change[INTRINSICS]))

"""The maximum-likelihood loop: linearise, estimate the noise, step; until the step is far below its own deviation."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.likelihood.chain import Chain
from calibration.likelihood.mixed_model import MixedModel, Step, Variances, linearised, solve
from calibration.likelihood.noise_marginalisation import MOST_STATED_VIEWS, averaged
from calibration.likelihood.systematic_errors import NO_DOUBT, Doubt
from calibration.likelihood.variance_components import estimate_variances
from calibration.observations.observations import Observations, scaled
from calibration.observations.reprojection import INTRINSICS, PixelStatistics, pixel_statistics, with_intrinsics
from calibration.transforms import Array, inverse, vector_from_transform

MOST_ITERATIONS = 25
LEVELS_SETTLE_WITHIN = 10
"""So few views as three may lead noise levels and X round in circles; then the levels stay, and are averaged over."""

SMALL_STEP = 1e-3
"""In units of the estimate's own standard deviation."""

Pixels = Callable[[Array, CameraModel, float], PixelStatistics]
"""What the pixels say at poses (n, 4, 4) with a camera and a scale of the target."""

Free = NDArray[np.bool_]
"""Which of fx fy cx cy k1 k2 p1 p2 k3 and the target's scale are unknown (10,)."""

HELD = np.zeros(INTRINSICS + 1, bool)


@dataclass(frozen=True, eq=False)
class Estimate:
    """The chain at the optimum, camera, target scale and noise, and the model linearised there with its covariance."""

    chain: Chain
    camera: CameraModel
    scale: float
    free: Free
    variances: Variances
    model: MixedModel
    step: Step
    converged: bool

    def trend_variances(self) -> Array:
        """Of a rotation and of a translation component (2,), as far as they follow the pose, in the mean of views."""
        levels = np.array([self.variances.trend_rotation, self.variances.trend_translation])
        in_the_mean: Array = levels * float(np.mean(np.sum(self.model.basis**2, axis=1)))
        return in_the_mean


def measured(seen: Observations, free: Free) -> Pixels:
    """The pixels themselves, with the `free` (10,) among the unknowns."""
    intrinsics, sized = free[:INTRINSICS], bool(free[INTRINSICS])

    def at(poses: Array, camera: CameraModel, scale: float) -> PixelStatistics:
        return pixel_statistics(scaled(seen, scale), camera, poses, free_intrinsics=intrinsics, free_scale=sized)

    return at


def frozen(statistics: PixelStatistics, camera_T_target: Array) -> Pixels:
    """The pixels as a quadratic about the views' own poses: nearly exact, and no point is touched any more."""
    own = inverse(camera_T_target)

    def expand(poses: Array, camera: CameraModel, scale: float) -> PixelStatistics:
        off = vector_from_transform(poses @ own)
        sums = statistics.sums.copy()
        sums[:, :, -1] += (sums[:, :, :-1] @ off[..., None])[..., 0]
        sums[:, -1, :] += (off[:, None] @ sums[:, :-1, :])[:, 0]
        return PixelStatistics(sums, statistics.count)

    return expand


def estimate(
    pixels: Pixels,
    camera: CameraModel,
    start: Chain,
    variances: Variances,
    free: Free = HELD,
    scale: float = 1.0,
    doubt: Doubt = NO_DOUBT,
    *,
    levels_known: bool = False,
) -> Estimate:
    """From a start whose corrections reproduce each view's own pose, to the maximum of the likelihood.

    `levels_known`: the noise levels stay as they are.
    """
    chain, converged, coefficients = start, False, np.zeros(0)
    for iteration in range(MOST_ITERATIONS):
        model = doubt.applied(linearise(pixels, chain, camera, scale), free, camera, chain.base_T_flange)
        if not levels_known and iteration < LEVELS_SETTLE_WITHIN:
            variances = estimate_variances(model, variances)
        step = solve(model, variances)
        # Each step is from where the last one led, the trend's coefficients from nothing.
        change = step.b.copy()
        change[len(change) - len(coefficients) :] -= coefficients
        coefficients = step.b[len(step.b) - 6 * model.trend :]
        small = change @ step.information @ change < SMALL_STEP**2 * len(change)
        # The last step is far below its deviation: taking it needs no new linearisation.
        corrections = model.corrections(step.K, step.b)
        chain, camera, scale = _stepped(chain, camera, scale, free, step.b, corrections)
        if small:
            converged = True
            break
    return Estimate(chain, camera, scale, free, variances, model, step, converged)


def averaged_over_noise(best: Estimate) -> Estimate:
    """The estimate with X averaged over the robot's noise levels, and the levels too where the views are very few."""
    mean = averaged(best.model, best.variances)
    few = len(best.model.count) <= MOST_STATED_VIEWS
    variances = mean.variances if few else best.variances
    step = solve(best.model, variances) if few else best.step
    off = mean.b - best.step.b  # the chain already took the last step
    corrections = best.model.corrections(step.K, mean.b)
    chain, camera, scale = _stepped(best.chain, best.camera, best.scale, best.free, off, corrections)
    averages = replace(step, b=mean.b, covariance=mean.covariance)
    return replace(best, chain=chain, camera=camera, scale=scale, variances=variances, step=averages)


def linearise(pixels: Pixels, chain: Chain, camera: CameraModel, scale: float) -> MixedModel:
    """The model around the present chain, camera and scale."""
    poses = chain.camera_T_target()
    return linearised(pixels(poses, camera, scale), chain, poses)


def _stepped(
    chain: Chain, camera: CameraModel, scale: float, free: Free, b: Array, corrections: Array
) -> tuple[Chain, CameraModel, float]:
    moved = chain.moved(b[:12], corrections)
    change = np.zeros(INTRINSICS + 1)
    change[free] = b[12 : 12 + np.count_nonzero(free)]
    if np.any(free[:INTRINSICS]):
        camera = with_intrinsics(camera, change[:INTRINSICS])
    return moved, camera, scale * (1 + float(change[INTRINSICS]))

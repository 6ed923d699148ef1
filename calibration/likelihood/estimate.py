"""The maximum-likelihood loop: linearise, estimate the noise, step; until the step is far below its own deviation."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.likelihood.chain import Chain
from calibration.likelihood.mixed_model import MixedModel, Step, Variances, linearised, solve
from calibration.likelihood.pixels import INTRINSICS, PixelStatistics, pixel_statistics, with_intrinsics
from calibration.likelihood.variance_components import estimate_variances
from calibration.observations import Observations
from calibration.transforms import Array, inverse, vector_from_rotation

MOST_ITERATIONS = 25
SMALL_STEP = 1e-3
"""In units of the estimate's own standard deviation."""

Pixels = Callable[[Array, CameraModel], PixelStatistics]
"""What the pixels say at poses (n, 4, 4) with a camera."""

Free = NDArray[np.bool_]
HELD = np.zeros(INTRINSICS, bool)


@dataclass(frozen=True, eq=False)
class Estimate:
    """The chain at the optimum, the camera, the noise, and the model linearised there with its covariance."""

    chain: Chain
    camera: CameraModel
    free: Free
    variances: Variances
    model: MixedModel
    step: Step
    converged: bool


def measured(seen: Observations, free: Free) -> Pixels:
    """The pixels themselves, with the `free` (9,) intrinsics among the unknowns."""
    if not np.any(free):
        return lambda poses, camera: pixel_statistics(seen, camera, poses)
    return lambda poses, camera: _only(free, pixel_statistics(seen, camera, poses, free_intrinsics=True))


def _only(free: Free, statistics: PixelStatistics) -> PixelStatistics:
    keep = np.concatenate([np.ones(6, bool), free])
    return replace(statistics, normal=statistics.normal[:, keep][:, :, keep], gradient=statistics.gradient[:, keep])


def frozen(statistics: PixelStatistics, camera_T_target: Array) -> Pixels:
    """The pixels as a quadratic about the views' own poses: nearly exact, and no point is touched any more."""
    own = inverse(camera_T_target)

    def expand(poses: Array, camera: CameraModel) -> PixelStatistics:
        off = poses @ own
        off = np.concatenate([vector_from_rotation(off[:, :3, :3]), off[:, :3, 3]], axis=1)
        normal = statistics.normal[:, :6, :6]
        towards = (normal @ off[..., None])[..., 0]
        gradient = statistics.gradient[:, :6]
        square = statistics.square + np.sum((2 * gradient + towards) * off, axis=1)
        return PixelStatistics(normal, gradient + towards, square, statistics.count)

    return expand


def estimate(pixels: Pixels, camera: CameraModel, start: Chain, variances: Variances, free: Free = HELD) -> Estimate:
    """From a start whose corrections reproduce each view's own pose, to the maximum of the likelihood."""
    chain, converged = start, False
    for _ in range(MOST_ITERATIONS):
        model = _linearise(pixels, camera, chain)
        variances = estimate_variances(model, variances)
        step = solve(model, variances)
        if step.b @ step.information @ step.b < SMALL_STEP**2 * len(step.b):
            converged = True
            break
        chain, camera = _stepped(chain, camera, free, step)
    # The last step is far below its deviation: taking it needs no new linearisation.
    chain, camera = _stepped(chain, camera, free, step)
    return Estimate(chain, camera, free, variances, model, step, converged)


def _stepped(chain: Chain, camera: CameraModel, free: Free, step: Step) -> tuple[Chain, CameraModel]:
    moved = chain.moved(step.b[:12], step.corrections)
    if not np.any(free):
        return moved, camera
    change = np.zeros(INTRINSICS)
    change[free] = step.b[12:]
    return moved, with_intrinsics(camera, change)


def _linearise(pixels: Pixels, camera: CameraModel, chain: Chain) -> MixedModel:
    poses = chain.camera_T_target()
    return linearised(pixels(poses, camera), chain, poses)

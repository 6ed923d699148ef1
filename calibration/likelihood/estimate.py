"""The maximum-likelihood loop: linearise, estimate the noise, step; until the step is far below its own deviation."""

from dataclasses import dataclass

from calibration.camera import CameraModel
from calibration.likelihood.chain import Chain
from calibration.likelihood.mixed_model import MixedModel, Step, Variances, linearised, solve
from calibration.likelihood.pixels import pixel_statistics, with_intrinsics
from calibration.likelihood.variance_components import estimate_variances
from calibration.observations import Observations

MOST_ITERATIONS = 25
SMALL_STEP = 1e-4
"""In units of the estimate's own standard deviation."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """The chain at the optimum, the camera, the noise, and the model linearised there with its covariance."""

    chain: Chain
    camera: CameraModel
    variances: Variances
    model: MixedModel
    step: Step
    converged: bool


def estimate(
    seen: Observations, camera: CameraModel, start: Chain, variances: Variances, *, free_intrinsics: bool
) -> Estimate:
    """From a start whose corrections reproduce each view's own pose, to the maximum of the likelihood."""
    chain, converged = start, False
    for _ in range(MOST_ITERATIONS):
        model = _linearise(seen, camera, chain, free_intrinsics)
        variances = estimate_variances(model, variances)
        step = solve(model, variances)
        chain = chain.moved(step.b[:12], step.corrections)
        if free_intrinsics:
            camera = with_intrinsics(camera, step.b[12:])
        if step.b @ step.information @ step.b < SMALL_STEP**2 * len(step.b):
            converged = True
            break
    model = _linearise(seen, camera, chain, free_intrinsics)
    return Estimate(chain, camera, variances, model, solve(model, variances), converged)


def _linearise(seen: Observations, camera: CameraModel, chain: Chain, free_intrinsics: bool) -> MixedModel:
    poses = chain.camera_T_target()
    return linearised(pixel_statistics(seen, camera, poses, free_intrinsics=free_intrinsics), chain, poses)

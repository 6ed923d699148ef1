"""How well the solution predicts a view it has not seen.

For each view the solution without it is one Newton step away: the view's part is taken out of the normal equations.
The error of the left-out view is then between where its target points are seen and where the rest says they are:

- base error: the target points through the view's own camera_T_target (from its pixels alone), X of the rest and the
  robot's pose as reported, against the target's pose of the rest; RMS distance in the anchor (base or flange), mm;
- reprojection: the target of the rest, through the robot's pose as reported and X of the rest, in px.
"""

import numpy as np

from calibration.likelihood.chain import Chain
from calibration.likelihood.estimate import Estimate
from calibration.likelihood.mixed_model import covariance_of
from calibration.likelihood.pixels import pixel_residuals, with_intrinsics
from calibration.observations import Observations
from calibration.solution import HoldOut
from calibration.transforms import Array, inverse, map_points
from calibration.view_poses import refined_poses

FEWEST_VIEWS = 4
"""Three views without one are two, which determine nothing."""


def hold_out(seen: Observations, best: Estimate, camera_T_target: Array) -> HoldOut | None:
    """RMS over all points of all views, each predicted by the others; None below four views."""
    if len(seen) < FEWEST_VIEWS:
        return None
    distances, pixels, counts = 0.0, 0.0, 0.0
    for row in range(len(seen)):
        chain, camera = _without(best, row)
        view = seen.take(np.array([row]))
        pose = camera_T_target[[row]] if camera is best.camera else refined_poses(view, camera, camera_T_target[[row]])
        weights = view.weights[0]
        errors = base_errors(view, chain, pose)[0]
        residuals = pixel_residuals(view, camera, chain.camera_T_target())[0]
        distances += float(weights @ np.sum(errors**2, axis=-1))
        pixels += float(weights @ np.sum(residuals**2, axis=-1))
        counts += float(weights.sum())
    return HoldOut(float(np.sqrt(distances / counts)), float(np.sqrt(pixels / counts)))


def base_errors(seen: Observations, chain: Chain, camera_T_target: Array) -> Array:
    """Where the target's points are seen minus where the chain has them, in the anchor (n, m, 3), mm."""
    base_T_flange = chain.corrected_base_T_flange()
    anchor_T_mount = base_T_flange if chain.setup == "eye-in-hand" else inverse(base_T_flange)
    by_view = map_points(anchor_T_mount @ chain.mount_T_camera @ camera_T_target, seen.points_mm)
    errors: Array = by_view - map_points(chain.anchor_T_target, seen.points_mm)
    return errors


def _without(best: Estimate, row: int):  # type: ignore[no-untyped-def]
    step = best.step
    left = covariance_of(step.information - step.view_information[row])
    b = -left @ (step.view_gradient.sum(axis=0) - step.view_gradient[row])
    chain = best.chain.moved(b[:12], np.zeros((1, 6)))
    chain = Chain(
        chain.setup, chain.base_T_flange[[row]], chain.mount_T_camera, chain.anchor_T_target, np.zeros((1, 6))
    )
    camera = with_intrinsics(best.camera, b[12:]) if len(b) > 12 else best.camera
    return chain, camera

"""Do the given intrinsics fit the pixels? Compared with the ones that these views would choose, no robot involved."""

from dataclasses import dataclass

import numpy as np
import scipy

from calibration.camera import CameraModel
from calibration.diagnosis.evidence import pixel_deviation
from calibration.intrinsics.bundle_adjustment import adjust
from calibration.linear_algebra import scaled_pseudo_inverse, scaled_solve
from calibration.observations.observations import Observations
from calibration.observations.reprojection import INTRINSICS, pixel_statistics
from calibration.observations.view_poses import refined_poses
from calibration.transforms import Array

MOST_VIEWS = 40
"""More tell little more about whether a lens fits."""

FEWEST_VIEWS = 5
WORTH_SAYING = 5e-4
"""Of the target's distance: the least by which better intrinsics must move it. A camera that has been calibrated
anew, a degree warmer, differs by less."""

WORSE = 1.1
"""Pixels that fit this much worse than they could are worth saying, too."""

AS_GOOD = 1.02
"""Nine numbers of a lens that leave this much more than hundreds of a target's shape are the simpler explanation."""


@dataclass(frozen=True, eq=False)
class LensMisfit:
    """The intrinsics that fit, the views' poses with them (n, 4, 4), the pixels' deviation before and after.

    `share`: by how much of its distance the target moves in the median view; `matters`: worth saying by itself.
    """

    camera: CameraModel
    camera_T_target: Array
    before_px: float
    after_px: float
    share: float
    matters: bool


def lens_misfit(
    seen: Observations, camera: CameraModel, camera_T_target: Array, chance: float, otherwise_px: float = np.inf
) -> LensMisfit | None:
    """None unless other intrinsics fit the target as drawn better than `chance` would make them in a clean session.

    `otherwise_px`: what another explanation leaves, the target's own shape; the better one is believed.
    """
    if len(seen) < FEWEST_VIEWS:
        return None
    rows = np.unique(np.linspace(0, len(seen) - 1, MOST_VIEWS).astype(np.intp))
    few, poses = seen.take(rows), camera_T_target[rows]
    if _chance_of_a_step(few, camera, poses) > chance:
        return None
    found = adjust(few, camera, poses, np.ones(INTRINSICS, bool))
    before = pixel_deviation(pixel_statistics(few, camera, poses))
    after = pixel_deviation(pixel_statistics(few, found.camera, found.poses))
    by_chance = _chance(few, before**2, after**2)
    moved = refined_poses(seen, found.camera, camera_T_target)
    shift = np.linalg.norm(moved[:, :3, 3] - camera_T_target[:, :3, 3], axis=1)
    share = float(np.median(shift / np.linalg.norm(camera_T_target[:, :3, 3], axis=1)))
    if by_chance > chance or after > AS_GOOD * otherwise_px:
        return None
    # The shift along the axis is known as well as the focal length is.
    doubt = float(np.sqrt(found.covariance[0, 0]) / found.camera.matrix[0, 0])
    matters = share > max(WORTH_SAYING, doubt) or before > WORSE * after
    return LensMisfit(found.camera, moved, before, after, share, matters)


def _chance_of_a_step(seen: Observations, camera: CameraModel, poses: Array) -> float:
    """A score test: what one linear step of the intrinsics promises, for the price of one look at the pixels."""
    sums = pixel_statistics(seen, camera, poses, free_intrinsics=True)
    coupling, gradient = sums.normal[:, :6, 6:], sums.gradient[:, :6, None]
    solved = scaled_solve(sums.normal[:, :6, :6], np.concatenate([coupling, gradient], axis=2))
    across = np.swapaxes(coupling, 1, 2) @ solved
    information = (sums.normal[:, 6:, 6:] - across[:, :, :-1]).sum(axis=0)
    score = (sums.gradient[:, 6:] - across[:, :, -1]).sum(axis=0)
    promised = score @ scaled_pseudo_inverse(information, 1e-10) @ score
    before = pixel_deviation(sums) ** 2
    redundancy = max(float(sums.count.sum()) - 6 * len(seen), 1.0)
    left = max(1 - float(promised) / (before * redundancy), 1e-6)
    return _chance(seen, before, before * left)


def _chance(seen: Observations, before: float, after: float) -> float:
    """That nine more unknowns lower the pixels' variance so far in a session without a fault (Fisher's F)."""
    numbers = 2 * int(np.count_nonzero(seen.weights)) - 6 * len(seen)
    left = max(numbers - INTRINSICS, 1)
    return float(scipy.stats.f.sf((before / after - 1) * left / INTRINSICS, INTRINSICS, left))

"""How well the robot's poses agree with the images when they are read inverted, by the poses alone.

Read inverted, the motion A of a view from the first becomes its inverse, in another frame. A half turn about a line
that crosses the axes of all these motions at right angles makes A^-1 of A, so that inverted poses fit every image with
another X, decimetres away. Two motions always have such a line; so have views that are all tilted about the target,
from a first one that looks straight at it, without a turn about the line of sight.
"""

import numpy as np

from calibration.transforms import Array, inverse, rotation_angle_rad

ALWAYS_AGREEING = 3
"""Views that agree with inverted poses whatever they are."""


def misfit_of_inverted_poses(base_T_flange: Array) -> tuple[float, float]:
    """Standard deviations (mm, rad) of a robot by which its poses (n, 4, 4) and their inverses fit the same images."""
    n = len(base_T_flange)
    if n <= ALWAYS_AGREEING:
        return 0.0, 0.0
    motions = inverse(base_T_flange[:1]) @ base_T_flange[1:]
    rotations, translations = motions[:, :3, :3], motions[:, :3, 3, None]
    skew = (rotations - np.swapaxes(rotations, 1, 2)) / 2
    across = np.linalg.svd(np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1))[2]
    half_turn = 2 * np.outer(across[2], across[2]) - np.eye(3)
    reversed_twice = half_turn @ rotations @ half_turn @ rotations
    # With the half turn x -> H x + q the motion x -> R x + t is reversed where (H R + 1) (H t + q) = 0; q is across.
    both = (half_turn @ rotations + np.eye(3)) / 2
    by_q, without_q = (both @ across[:2].T).reshape(-1, 2), (both @ half_turn @ translations).ravel()
    left = without_q + by_q @ np.linalg.lstsq(by_q, -without_q, rcond=None)[0]
    # A motion has the errors of two poses.
    free = 2 * (n - ALWAYS_AGREEING)
    return (
        float(np.sqrt(left @ left / free)),
        float(np.sqrt(np.sum((rotation_angle_rad(reversed_twice) / 2) ** 2) / free)),
    )

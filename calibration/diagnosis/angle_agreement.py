"""Agreement of robot and images in the angles between views, which no constant transform on either side changes.

The angle of R_i^T R_j is the same for the robot's and the images' rotations when both are right, whatever X and the
target's pose are (Tsai and Lenz, IEEE Trans. Robotics and Automation 5(3), 1989, lemma 3). It costs no fit, so
hundreds of readings of the robot's orientations can be compared.
"""

import numpy as np
from numpy.typing import NDArray

from calibration.transforms import Array, rotation_angle_rad

UNWRAPPING_STARTS, UNWRAPPING_ROUNDS = 8, 3
AGREEMENT_TOLERANCE_RAD = float(np.radians(0.5))
"""Mean mismatch below which the search ends."""


def angles_between(rotations: Array) -> Array:
    """(n, n) rad: the angle of the rotation from each of (n, 3, 3) to each other."""
    angles: Array = rotation_angle_rad(np.swapaxes(rotations[:, None], 2, 3) @ rotations[None])
    return angles


def angles_between_images(camera_T_target: Array) -> Array:
    """(n, n) rad: the angle by which the camera turned against the target between each two of (n, 4, 4)."""
    return angles_between(np.swapaxes(camera_T_target[:, :3, :3], 1, 2))


def mean_mismatch_rad(angles: Array, seen: Array) -> float:
    """Mean over all pairs of views of the difference between the angles (n, n) and those `seen` (n, n)."""
    n = len(seen)
    return float(np.abs(angles - seen).sum() / max(n * (n - 1), 1))


def choose_candidates(rotations: Array, seen: Array) -> NDArray[np.intp]:
    """The index (n,) of each view's candidate (n, c, 3, 3) for which angles between views agree with `seen` (n, n).

    Several candidates may agree with one view, few with all, so the search starts from each candidate of the first.
    """
    first = np.broadcast_to(seen[:, :1], (len(seen), rotations.shape[1]))
    from_first = np.moveaxis(_mismatches(rotations, rotations[0], first), 2, 0)  # (c, n, c)
    starts = from_first.argmin(axis=2)
    starts[:, 0] = np.arange(len(starts))
    best_total, best = np.inf, starts[0]
    for start in starts[np.argsort(from_first[:, 1:].min(axis=2).sum(axis=1))[:UNWRAPPING_STARTS]]:
        total, chosen = _refine_choice(rotations, seen, start)
        if total < best_total:
            best_total, best = total, chosen
        if best_total < seen.size * AGREEMENT_TOLERANCE_RAD:
            break
    return np.asarray(best, np.intp)


def _refine_choice(rotations: Array, seen: Array, chosen: NDArray[np.intp]) -> tuple[float, NDArray[np.intp]]:
    """The total mismatch and each view's candidate (n,), after rounds of choosing the best against the present ones."""
    total = np.inf
    for _ in range(UNWRAPPING_ROUNDS):
        present = rotations[np.arange(len(chosen)), chosen]
        misses = _mismatches(rotations, present, seen).sum(axis=2)
        chosen, total = misses.argmin(axis=1), float(misses.min(axis=1).sum())
    return total, chosen


def _mismatches(rotations: Array, others: Array, seen: Array) -> Array:
    """|angle - seen| (n, c, m) rad of each candidate (n, c, 3, 3) to each of `others` (m, 3, 3); `seen` is (n, m)."""
    n, c = rotations.shape[:2]
    traces = (rotations.reshape(n * c, 9) @ others.reshape(-1, 9).T).reshape(n, c, -1)
    mismatches: Array = np.abs(np.arccos(np.clip((traces - 1) / 2, -1, 1)) - seen[:, None])
    return mismatches

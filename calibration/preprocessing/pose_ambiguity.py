"""Resolution of ambiguous target poses: a plane's second pose, and a symmetric board read in another orientation.

Screw congruence decides before anything is solved: between any two views the mount and the camera turn by the same
angle, whatever X is (H. Chen, "A screw motion approach to uniqueness analysis of head-eye geometry", CVPR 1991). A
board read in a wrong orientation is off by tens of degrees, correct views by tenths of a degree.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.observations.observations import Observations
from calibration.transforms import Array, inverse, map_points, transform

MAX_REFERENCES = 60
"""Most views that each view is compared with, so that the cost is linear in the number of views."""

SUSPECT_RAD = np.radians(1.5)
SUSPECT_RATIO = 6.0
"""A view is suspect when its median mismatch exceeds the first, and the second times that of the median view."""

MAX_REMAINING_SHARE = 0.3
"""Another reading is accepted only when it reduces a view's mismatches to less than this share."""

MAX_MISS_RAD = np.radians(10.0)
"""A mismatch counts at most this much, since the other view of the pair may be the wrong one."""

MAX_AMBIGUOUS_RATIO = 3.0
"""The plane's second pose is considered while its RMS error is less than this many times the first's."""


@dataclass(frozen=True, eq=False)
class ResolvedPoses:
    """The observations with corrected ids, the poses (n, 4, 4), and `board_turned` (n,), where ids were corrected."""

    seen: Observations
    camera_T_target: Array
    board_turned: NDArray[np.bool_]


def rotation_mismatches(anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """Difference (n, r) rad between the mount's and the camera's rotation angle, from each view to r of the views."""
    references = _references(len(anchor_T_mount))
    return np.abs(
        _turns(anchor_T_mount[:, :3, :3], anchor_T_mount[references, :3, :3])
        - _turns(camera_T_target[:, :3, :3], camera_T_target[references, :3, :3])
    )


def resolve_pose_ambiguity(
    seen: Observations, anchor_T_mount: Array, candidates: Array, errors: Array, points_mm: Array
) -> ResolvedPoses:
    """The choice among candidate poses (n, 2, 4, 4), the better first, with RMS errors (n, 2), and board symmetries.

    `points_mm` (k, 3): all points of the target.
    """
    camera_T_target = candidates[:, 0].copy()
    unchanged = ResolvedPoses(seen, camera_T_target, np.zeros(len(seen), bool))
    if len(seen) < 3 or not len(_suspects(rotation_mismatches(anchor_T_mount, camera_T_target))):
        return unchanged
    symmetries = board_symmetries(points_mm)
    # (n, 2 s, 4, 4): camera_T_target @ symmetry; reading 0 is the present one.
    readings = (candidates[:, :, None] @ symmetries).reshape(len(seen), -1, 4, 4)
    allowed = np.repeat(errors < MAX_AMBIGUOUS_RATIO * errors[:, :1], len(symmetries), axis=1)
    allowed[:, : len(symmetries)] = True
    chosen = _choose_readings(anchor_T_mount, readings, allowed)
    if not np.any(chosen):
        return unchanged
    turned = chosen % len(symmetries) > 0
    # Z p = (Z S) (S^-1 p): with the corners relabelled by S^-1 the pose Z S has the same residuals.
    relabel = inverse(symmetries[chosen % len(symmetries)])
    points = map_points(relabel, points_mm)
    permuted = np.argmin(np.linalg.norm(points[:, :, None] - points_mm, axis=-1), axis=2)  # (n, k)
    ids = np.take_along_axis(permuted, seen.ids, axis=1)
    return ResolvedPoses(
        replace(seen, ids=ids, points_mm=points_mm[ids]), readings[np.arange(len(seen)), chosen], turned
    )


def board_symmetries(points_mm: Array) -> Array:
    """Rotations (s, 4, 4) of the board about its middle that map its points (n, 3) onto each other; identity first."""
    low, high = points_mm.min(axis=0), points_mm.max(axis=0)
    centre, size = (low + high) / 2, float(np.linalg.norm(high - low))
    found = []
    for quarter in range(4):
        cosine, sine = np.cos(quarter * np.pi / 2).round(), np.sin(quarter * np.pi / 2).round()
        turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1.0]])
        symmetry = transform(turn, centre - turn @ centre)
        apart = np.linalg.norm(map_points(symmetry, points_mm)[:, None, :2] - points_mm[None, :, :2], axis=-1)
        if np.all(apart.min(axis=1) < 1e-6 * size):
            found.append(symmetry)
    return np.array(found)


def _references(n: int) -> NDArray[np.intp]:
    return np.unique(np.linspace(0, n - 1, min(n, MAX_REFERENCES)).astype(np.intp))


def _turns(rotations: Array, references: Array) -> Array:
    """Angles (n, r) rad of R_i' R_j (or R_i R_j'): both have the trace sum(R_i * R_j)."""
    traces = rotations.reshape(-1, 9) @ references.reshape(-1, 9).T
    angles: Array = np.arccos(np.clip((traces - 1) / 2, -1.0, 1.0))
    return angles


def _suspects(misses: Array) -> NDArray[np.intp]:
    scores = np.median(misses, axis=1)
    if len(misses) < 5:  # too few for a median
        scores = misses.max(axis=1)
        return np.flatnonzero(scores > SUSPECT_RAD)
    return np.flatnonzero(scores > max(SUSPECT_RAD, SUSPECT_RATIO * float(np.median(scores))))


def _choose_readings(anchor_T_mount: Array, readings: Array, allowed: NDArray[np.bool_]) -> NDArray[np.intp]:
    """The index of each view's reading (n,), changed one by one, the largest gain first, until no gain is large."""
    n, k = allowed.shape
    rows, references = np.arange(n), _references(n)
    mount = _turns(anchor_T_mount[:, :3, :3], anchor_T_mount[references, :3, :3])
    others = rows[:, None] != references[None]
    chosen = np.zeros(n, np.intp)
    for _ in range(n):
        present = readings[references, chosen[references], :3, :3]
        camera = _turns(readings[:, :, :3, :3].reshape(-1, 3, 3), present).reshape(n, k, -1)
        misses = np.minimum(np.abs(mount[:, None] - camera), MAX_MISS_RAD) * others[:, None]
        costs = np.where(allowed, misses.sum(axis=-1), np.inf)
        now, best = costs[rows, chosen], costs.min(axis=1)
        gain = np.where(best < MAX_REMAINING_SHARE * now, now - best, 0.0)
        view = int(np.argmax(gain))
        if gain[view] < SUSPECT_RAD:
            break
        chosen[view] = int(np.argmin(costs[view]))
    # With a majority of changed views it is not known which half is right: leave all as they are.
    return chosen if np.count_nonzero(chosen) <= n // 2 else np.zeros(n, np.intp)

"""How else an image could be read: the plane's second pose, and the board turned onto itself.

Screw congruence decides between the readings before anything is solved: between any two views the mount and the
camera turn by the same angle, whatever X is (H. Chen, "A screw motion approach to uniqueness analysis of head-eye
geometry", CVPR 1991). A board read the wrong way round is tens of degrees off, against tenths for the rest.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.observations.observations import Observations
from calibration.transforms import Array, inverse, map_points, transform

MOST_REFERENCES = 60
"""Each view is compared with this many others, so that the cost stays linear in the views."""

SUSPECT_RAD = np.radians(1.5)
SUSPECT_RATIO = 6.0
"""A view is looked at again when its angles miss by this much, absolutely and against the median view."""

CONVINCING = 0.3
"""Another reading must bring the view's misses down to this share."""

CAP_RAD = np.radians(10.0)
"""A miss counts at most this much: the other view of the pair may be the wrong one."""

AMBIGUOUS = 3.0
"""The plane's second pose is considered while its error is less than this many times the first's."""


@dataclass(frozen=True, eq=False)
class Readings:
    """The observations and poses as they are best read; `turned` (n,): the board was read the wrong way round."""

    seen: Observations
    camera_T_target: Array
    turned: NDArray[np.bool_]


def turn_misses(anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """By how much the mount's and the camera's turn between two views differ, (n, r) in rad, against r of the views."""
    references = _references(len(anchor_T_mount))
    return np.abs(
        _turns(anchor_T_mount[:, :3, :3], anchor_T_mount[references, :3, :3])
        - _turns(camera_T_target[:, :3, :3], camera_T_target[references, :3, :3])
    )


def best_readings(
    seen: Observations, anchor_T_mount: Array, candidates: Array, errors: Array, points_mm: Array
) -> Readings:
    """Choose among candidates (n, 2, 4, 4), better fit first with RMS errors (n, 2), and the board's symmetries."""
    camera_T_target = candidates[:, 0].copy()
    unchanged = Readings(seen, camera_T_target, np.zeros(len(seen), bool))
    if len(seen) < 3 or not len(_suspects(turn_misses(anchor_T_mount, camera_T_target))):
        return unchanged
    symmetries = symmetries_of(points_mm)
    # (n, 2 s, 4, 4): camera_T_target @ symmetry; reading 0 is the present one.
    readings = (candidates[:, :, None] @ symmetries).reshape(len(seen), -1, 4, 4)
    allowed = np.repeat(errors < AMBIGUOUS * errors[:, :1], len(symmetries), axis=1)
    allowed[:, : len(symmetries)] = True
    chosen = _chosen(anchor_T_mount, readings, allowed)
    if not np.any(chosen):
        return unchanged
    turned = chosen % len(symmetries) > 0
    # Z p = (Z S) (S^-1 p): with the corners relabelled by S^-1 the pose Z S has the same residuals.
    relabel = inverse(symmetries[chosen % len(symmetries)])
    points = map_points(relabel, points_mm)
    permuted = np.argmin(np.linalg.norm(points[:, :, None] - points_mm, axis=-1), axis=2)  # (n, k)
    ids = np.take_along_axis(permuted, seen.ids, axis=1)
    return Readings(replace(seen, ids=ids, points_mm=points_mm[ids]), readings[np.arange(len(seen)), chosen], turned)


def symmetries_of(points_mm: Array) -> Array:
    """Turns of the board about its own middle (s, 4, 4) that put its points (n, 3) onto each other, the first none."""
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
    return np.unique(np.linspace(0, n - 1, min(n, MOST_REFERENCES)).astype(np.intp))


def _turns(rotations: Array, references: Array) -> Array:
    """Angles (n, r) of R_i' R_j (or R_i R_j'): both have the trace sum(R_i * R_j)."""
    traces = rotations.reshape(-1, 9) @ references.reshape(-1, 9).T
    angles: Array = np.arccos(np.clip((traces - 1) / 2, -1.0, 1.0))
    return angles


def _suspects(misses: Array) -> NDArray[np.intp]:
    scores = np.median(misses, axis=1)
    if len(misses) < 5:  # The median over so few others says nothing: any large miss is worth a look.
        scores = misses.max(axis=1)
        return np.flatnonzero(scores > SUSPECT_RAD)
    return np.flatnonzero(scores > max(SUSPECT_RAD, SUSPECT_RATIO * float(np.median(scores))))


def _chosen(anchor_T_mount: Array, readings: Array, allowed: NDArray[np.bool_]) -> NDArray[np.intp]:
    """The reading (n,) of each view: change the one that helps most, until none helps convincingly."""
    n, k = allowed.shape
    rows, references = np.arange(n), _references(n)
    mount = _turns(anchor_T_mount[:, :3, :3], anchor_T_mount[references, :3, :3])
    others = rows[:, None] != references[None]
    chosen = np.zeros(n, np.intp)
    for _ in range(n):
        present = readings[references, chosen[references], :3, :3]
        camera = _turns(readings[:, :, :3, :3].reshape(-1, 3, 3), present).reshape(n, k, -1)
        misses = np.minimum(np.abs(mount[:, None] - camera), CAP_RAD) * others[:, None]
        costs = np.where(allowed, misses.sum(axis=-1), np.inf)
        now, best = costs[rows, chosen], costs.min(axis=1)
        gain = np.where(best < CONVINCING * now, now - best, 0.0)
        view = int(np.argmax(gain))
        if gain[view] < SUSPECT_RAD:
            break
        chosen[view] = int(np.argmin(costs[view]))
    # A majority of changed views means that nothing is known about which half is right.
    return chosen if np.count_nonzero(chosen) <= n // 2 else np.zeros(n, np.intp)

"""Orientations written in degrees and read as radians: which turns were lost, found by means of the positions.

360 degrees read as radians are 57 turns, so every angle is known up to a multiple of 2 pi degrees only. Positions are
not affected. With F_i the pose of what the flange carries against what stands still, from the images, and constant B
and C, base_T_flange_i = B F_i C. The positions alone give B and the translation of C, linearly; the rotation of C
then follows from the turns of one view, and the other views show which turns those are.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.hypothesis import Hypothesis
from calibration.kinematics.conventions import ORDERS, euler_angles, euler_numbers, rotation_from_euler
from calibration.sentences.sentence import Sentence
from calibration.transforms import (
    Array,
    inverse,
    nearest_rotation,
    rotation_angle_rad,
    rotation_from_vector,
    skew,
    transform,
    vector_from_rotation,
)

MIN_VIEWS = 6
"""Least views: 15 unknowns of the positions, three equations a view."""

MAX_MISFIT_MM = 30.0
"""RMS misfit of the positions above which they are wrong as well."""

POSITION_STEPS = 10
KEPT = (8000, 800, 80)
"""Candidates kept after the second, third and fourth view."""

MAX_MISMATCH_RAD = 0.8
"""Mean mismatch, as read, of a choice of turns that is worth a fit; by chance it is 1.3."""

ROUNDS = 3
TURN = 2 * np.pi


@dataclass(frozen=True, eq=False)
class _Unwrapped:
    """Rotations (n, 3, 3) of the views `rows` (n,), and how far the numbers are from those predicted, on average."""

    rows: NDArray[np.intp]
    rotations: Array
    mismatch_rad: float


def wrapped_hypotheses(evidence: Evidence) -> Iterator[Hypothesis]:
    """The likely readings of orientations in degrees that were taken for radians; none when positions contradict."""
    turned = _base_R_carried(evidence)
    if turned is None:
        return
    given = evidence.base_T_flange[:, :3, :3]
    found = [
        (Sentence("euler-degrees-read-as-radians", read=order), _unwrap_euler(given, turned, order)) for order in ORDERS
    ]
    found.append((Sentence("degrees-read-as-radians"), _unwrap_vectors(given, turned)))
    for message, unwrapped in found:
        if unwrapped is None or unwrapped.mismatch_rad > MAX_MISMATCH_RAD:
            continue
        baseline = evidence if len(unwrapped.rows) == len(evidence) else evidence.take(unwrapped.rows)
        corrected = transform(unwrapped.rotations, baseline.base_T_flange[:, :3, 3])
        yield Hypothesis(
            "degrees-read-as-radians",
            (),
            baseline.with_robot_poses(corrected),
            baseline,
            message,
            Sentence("undo-angles-read-as-radians"),
            alternatives=len(found),
            whole_session=True,
        )


def _base_R_carried(evidence: Evidence) -> Array | None:
    """B F_i without C (n, 3, 3), from the positions; None when they do not fit or are too few."""
    camera_T_target = evidence.camera_T_target
    fixed_T_carried = inverse(camera_T_target) if evidence.setup == "eye-in-hand" else camera_T_target
    turn, place, given = fixed_T_carried[:, :3, :3], fixed_T_carried[:, :3, 3], evidence.base_T_flange[:, :3, 3]
    n = len(evidence)
    if n < MIN_VIEWS:
        return None
    given = given - given.mean(axis=0)
    # M p + d - turn c = place, with M the rotation of B transposed.
    rows = np.concatenate([np.kron(np.eye(3), given).reshape(3, n, 9).swapaxes(0, 1), _eyes(n), -turn], axis=2)
    M = np.linalg.lstsq(rows.reshape(-1, 15), place.ravel(), rcond=None)[0][:9].reshape(3, 3)
    M, _ = nearest_rotation(M)
    for _ in range(POSITION_STEPS):
        moved = given @ M.T
        slopes = np.concatenate([-skew(moved), _eyes(n), -turn], axis=2).reshape(-1, 9)
        step, *_ = np.linalg.lstsq(slopes, (place - moved).ravel(), rcond=None)
        M = rotation_from_vector(step[:3]) @ M
    left = (place - given @ M.T).ravel() - slopes[:, 3:] @ step[3:]
    return M.T @ turn if float(np.sqrt(np.mean(left**2))) < MAX_MISFIT_MM else None


def _eyes(n: int) -> Array:
    return np.broadcast_to(np.eye(3), (n, 3, 3))


def _unwrap_euler(given: Array, turned: Array, order: str) -> _Unwrapped | None:
    numbers, determined = euler_numbers(given, order)
    rows = np.flatnonzero(determined)
    if len(rows) < MIN_VIEWS:
        return None
    numbers, turned = numbers[rows], turned[rows]
    first = np.concatenate([_first_rotations(triple, order) for triple in numbers[0]])
    kept = turned[0].T @ first  # the rotation of C
    mismatch = np.zeros(len(kept))
    for view, most in zip(range(1, len(rows)), (*KEPT, *[KEPT[-1]] * len(rows)), strict=False):
        mismatch += _mismatches(np.degrees(euler_angles(turned[view] @ kept, order)), numbers[view])[0]
        best = np.argpartition(mismatch, min(most, len(kept)) - 1)[:most]
        kept, mismatch = kept[best], mismatch[best]
    C = kept[int(np.argmin(mismatch))]
    for _ in range(ROUNDS):
        predicted = np.degrees(euler_angles(turned @ C, order))
        off = np.stack([_mismatches(one[None], two) for one, two in zip(predicted, numbers, strict=True)])[:, :, 0]
        chosen = numbers[np.arange(len(rows)), off[:, 1].astype(np.intp)]
        nearest = chosen + TURN * np.round((predicted - chosen) / TURN)
        rotations = rotation_from_euler(np.radians(nearest), order)
        C, _ = nearest_rotation((np.swapaxes(turned, 1, 2) @ rotations).mean(axis=0))
    return _Unwrapped(rows, rotations, float(off[:, 0].mean()))


def _first_rotations(numbers: Array, order: str) -> Array:
    """Every rotation (k, 3, 3) whose angles in degrees are these numbers (3,) and some turns of 2 pi."""
    low, high = (0.0, 180.0) if order[0] == order[2] else (-90.0, 90.0)
    first, middle, last = (
        number + TURN * np.arange(np.ceil((least - number) / TURN), np.floor((most - number) / TURN) + 1)
        for number, least, most in zip(numbers, (-180.0, low, -180.0), (180.0, high, 180.0), strict=True)
    )
    one, two, three = (
        rotation_from_euler(np.radians(angles)[:, None] * np.eye(3)[at], order)
        for at, angles in enumerate((first, middle, last))
    )
    pairs = (one[:, None] @ two[None]).reshape(-1, 1, 3, 3)
    rotations: Array = (pairs @ three[None]).reshape(-1, 3, 3)
    return rotations


def _mismatches(predicted: Array, numbers: Array) -> tuple[Array, Array]:
    """Mean mismatch (k,) of numbers (k, 3), up to whole turns, with the nearer of two triples (2, 3), and which."""
    off = (predicted[:, None] - numbers) / TURN
    each = np.abs(off - np.round(off)) @ np.full(3, TURN / 3)
    return each.min(axis=1), each.argmin(axis=1)


def _unwrap_vectors(given: Array, turned: Array) -> _Unwrapped:
    vectors = vector_from_rotation(given)
    angles = np.linalg.norm(vectors, axis=1)
    axes = vectors / np.maximum(angles, 1e-12)[:, None]
    turns = TURN * np.arange(-29, 30)
    lengths = angles[:, None] + turns
    lengths = np.where(np.abs(lengths) <= 180.0, lengths, lengths - TURN * np.sign(lengths))
    rotations = rotation_from_vector((np.radians(lengths)[..., None] * axes[:, None]).reshape(-1, 3))
    rotations = rotations.reshape(len(given), -1, 3, 3)
    best: tuple[float, Array] = (np.inf, rotations[:, 0])
    for first in rotations[0]:
        predicted = turned @ (turned[0].T @ first)
        off = rotation_angle_rad(np.swapaxes(rotations, 2, 3) @ predicted[:, None])
        # As read, an angle is off by 180/pi times as much.
        mismatch = float(np.degrees(off.min(axis=1)).mean())
        if mismatch < best[0]:
            best = mismatch, rotations[np.arange(len(given)), off.argmin(axis=1)]
    return _Unwrapped(np.arange(len(given)), best[1], best[0])

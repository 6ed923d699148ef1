"""Wrong readings of the robot's orientations: three numbers taken in another Euler order, or as a rotation vector.

A controller shows three numbers. Read in one convention they give the rotation in the session; a reading undoes
that: back to the three numbers, then by another convention. An extrinsic order is the reversed intrinsic order of the
reversed numbers (Diebel, "Representing Attitude", 2006, 2.3), so 12 intrinsic orders, direct and reversed, are all 24.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.diagnosis.angle_agreement import angles_between, choose_candidates, mean_mismatch_rad
from calibration.kinematics.conventions import ORDERS, euler_numbers, rotation_from_euler
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, rotation_from_vector, vector_from_rotation

MIN_SMALL_LOCK_SINE = 0.002
"""MIN_LOCK_SINE where radians were read as degrees, and angles are small: 6 decimals of a quaternion are 0.8° then."""

MAX_SCREENED_VIEWS = 12
"""Views by whose angles the readings are compared first."""

MAX_READINGS = 150
"""Readings fitted in full. Orders that differ by the axes' names alone agree equally in the angles: up to 144."""

MIN_MISMATCH_RAD = float(np.radians(1.0))
"""Mean mismatch of the angles between views that a reading may leave in any case: poor robots do."""

MAX_MISMATCH_SHARE = 0.5
"""Share of the mismatch as given that a reading may leave."""

READINGS = 12 * 23 + 24 + 24 + 12 + 1
"""Readings that are compared."""


@dataclass(frozen=True, eq=False)
class Reading:
    """One wrong reading and what it would make of the session's rotations.

    candidates : (n, c, 3, 3), what each view's rotation may have been.
    determined : (n,) whether the numbers of a view are determined.
    """

    code: str
    message: str
    fix: str
    candidates: Array
    determined: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class LikelyReading:
    """A reading with the rotations (n, 3, 3) that it gives to the views `rows` (n,), and the mismatch they leave."""

    reading: Reading
    rows: NDArray[np.intp]
    rotations: Array
    mismatch_rad: float


def likely_readings(rotations: Array, seen: Array) -> list[LikelyReading]:
    """The readings of rotations (n, 3, 3) that agree best with the angles `seen` (n, n) between images, best first."""
    limit = max(MAX_MISMATCH_SHARE * mean_mismatch_rad(angles_between(rotations), seen), MIN_MISMATCH_RAD)
    few = np.unique(np.linspace(0, len(rotations) - 1, min(len(rotations), MAX_SCREENED_VIEWS)).astype(np.intp))
    screened = {
        position: left
        for position, reading in enumerate(readings_of(rotations[few]))
        if (left := _apply(reading, seen[np.ix_(few, few)])) is not None
    }
    best = dict(sorted(screened.items(), key=lambda item: item[1].mismatch_rad)[:MAX_READINGS])
    if len(few) == len(rotations):
        applied = list(best.values())
    else:
        chosen = [reading for position, reading in enumerate(readings_of(rotations)) if position in best]
        applied = [left for reading in chosen if (left := _apply(reading, seen)) is not None]
    likely = [left for left in applied if left.mismatch_rad < limit]
    return sorted(likely, key=lambda left: left.mismatch_rad)


def _apply(reading: Reading, seen: Array) -> LikelyReading | None:
    rows = np.flatnonzero(reading.determined)
    if len(rows) < 3:
        return None
    candidates, seen = reading.candidates[rows], seen[np.ix_(rows, rows)]
    chosen = choose_candidates(candidates, seen)
    rotations = candidates[np.arange(len(rows)), chosen]
    return LikelyReading(reading, rows, rotations, mean_mismatch_rad(angles_between(rotations), seen))


def readings_of(rotations: Array) -> Iterator[Reading]:
    """Every reading of the rotations (n, 3, 3)."""
    everywhere = np.ones(len(rotations), bool)
    for read in ORDERS:
        numbers, determined = euler_numbers(rotations, read)
        orders = [(f"intrinsic {true}", rotation_from_euler(numbers, true)) for true in ORDERS if true != read]
        for true in ORDERS:  # extrinsic is the reversed order of the reversed numbers
            orders.append((f"extrinsic {true}", rotation_from_euler(numbers[..., ::-1], true[::-1])))
        for named, turned in orders:
            message = Sentence("euler-order", read=f"intrinsic {read}", true=named)
            fix = Sentence("convert-intrinsic" if named.startswith("i") else "convert-extrinsic", true=named)
            yield Reading("euler-order", message, fix, turned, determined)
        for named, written in ((f"intrinsic {read}", numbers), (f"extrinsic {read[::-1]}", numbers[..., ::-1])):
            turned = rotation_from_vector(written.reshape(-1, 3)).reshape(*written.shape[:2], 3, 3)
            message, fix = Sentence("vector-read-as-euler", read=named), Sentence("convert-as-vector")
            yield Reading("vector-read-as-euler", message, fix, turned, determined)
        yield Reading(
            "radians-read-as-degrees",
            Sentence("euler-radians-read-as-degrees", read=read),
            Sentence("undo-euler-radians-read-as-degrees"),
            rotation_from_euler(np.degrees(numbers[:, :1]), read),
            euler_numbers(rotations, read, MIN_SMALL_LOCK_SINE)[1],
        )
    vectors = _both_vectors(rotations)
    for true in ORDERS:
        for named, turned in (
            (f"intrinsic {true}", rotation_from_euler(vectors, true)),
            (f"extrinsic {true}", rotation_from_euler(vectors[..., ::-1], true[::-1])),
        ):
            message, fix = Sentence("euler-read-as-vector", true=named), Sentence("convert-as-euler", true=named)
            yield Reading("euler-read-as-vector", message, fix, turned, everywhere)
    yield Reading(
        "rotation-transposed",
        Sentence("rotation-transposed"),
        Sentence("undo-rotation-transposed"),
        np.swapaxes(rotations, 1, 2)[:, None],
        everywhere,
    )


def _both_vectors(rotations: Array) -> Array:
    """The rotation vector (n, 2, 3) of each rotation, and the longer one in the opposite direction."""
    vectors = vector_from_rotation(rotations).reshape(-1, 3)
    turns = np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
    return np.stack([vectors, vectors * (1 - 2 * np.pi / turns)], axis=1)

"""Hypotheses about all robot poses: another convention, another unit, another order; and the target's size."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from calibration.closed_forms.kronecker import kronecker
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, fit
from calibration.diagnosis.hypothesis import Hypothesis
from calibration.diagnosis.significance import NoisePosterior
from calibration.solver.target_scale_check import MIN_SCALE_ERROR
from calibration.transforms import (
    Array,
    inverse,
    quaternion_from_rotation,
    rotation_angle_rad,
    rotation_from_quaternion,
    rotation_from_vector,
    transform,
    vector_from_rotation,
)


@dataclass(frozen=True)
class Convention:
    """A wrong convention; `undo` corrects robot poses (n, 4, 4), given also the images' poses (n, 4, 4)."""

    code: str
    message: str
    fix: str
    undo: Callable[[Array, Array], Array]


def _w_last(base_T_flange: Array, _: Array) -> Array:
    w_first = np.roll(quaternion_from_rotation(base_T_flange[:, :3, :3]), 1, axis=1)
    return transform(rotation_from_quaternion(w_first), base_T_flange[:, :3, 3])


def _invert(base_T_flange: Array, _: Array) -> Array:
    return inverse(base_T_flange)


def _scale_translations(factor: float) -> Callable[[Array, Array], Array]:
    def undo(base_T_flange: Array, _: Array) -> Array:
        return transform(base_T_flange[:, :3, :3], factor * base_T_flange[:, :3, 3])

    return undo


def _radians_read_as_degrees(base_T_flange: Array, _: Array) -> Array:
    vectors = np.degrees(vector_from_rotation(base_T_flange[:, :3, :3]))
    return transform(rotation_from_vector(vectors), base_T_flange[:, :3, 3])


def _degrees_read_as_radians(base_T_flange: Array, camera_T_target: Array) -> Array:
    """Rotation vectors up to 180 (degrees) taken as radians wrap up to 28 times; the images determine how often."""
    vectors = vector_from_rotation(base_T_flange[:, :3, :3])
    wrapped = np.linalg.norm(vectors, axis=1)
    axes = vectors / np.maximum(wrapped, 1e-12)[:, None]
    turns = 2 * np.pi * np.arange(29)
    degrees = np.concatenate([wrapped[:, None] + turns, wrapped[:, None] - turns[1:]], axis=1)  # (n, 57)
    rotations = rotation_from_vector((np.radians(degrees)[..., None] * axes[:, None]).reshape(-1, 3))
    rotations = rotations.reshape(len(vectors), -1, 3, 3)
    seen = rotation_angle_rad(camera_T_target[:, None, :3, :3] @ np.swapaxes(camera_T_target[None, :, :3, :3], 2, 3))
    chosen = _turns_that_agree(rotations, seen)
    return transform(rotations[np.arange(len(vectors)), chosen], base_T_flange[:, :3, 3])


def _turns_that_agree(rotations: Array, seen: Array) -> NDArray[np.intp]:
    """The index (n,) of each view's reading (n, c, 3, 3) for which angles between views agree with `seen` (n, n).

    Several readings may agree with one view, few with all, so the search starts from each reading of the first view.
    """
    from_first = np.array([_misses(rotations, first, seen[:, 0]) for first in rotations[0]])  # (c, n, c)
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
    """The total mismatch and each view's reading (n,), after rounds of choosing the best against the present ones."""
    total = np.inf
    for _ in range(UNWRAPPING_ROUNDS):
        present = rotations[np.arange(len(chosen)), chosen]
        misses = np.sum([_misses(rotations, one, seen[:, row]) for row, one in enumerate(present)], axis=0)
        chosen, total = misses.argmin(axis=1), float(misses.min(axis=1).sum())
    return total, chosen


def _misses(rotations: Array, other: Array, seen: Array) -> Array:
    """Mismatch (n, c) rad between the angle from another view (3, 3) to each reading (n, c, 3, 3) and `seen` (n,)."""
    traces = rotations.reshape(*rotations.shape[:2], 9) @ other.ravel()
    misses: Array = np.abs(np.arccos(np.clip((traces - 1) / 2, -1, 1)) - seen[:, None])
    return misses


MAX_CELL_MM = 20_000.0
"""Largest distance of a flange from its base; no arm reaches further, so a larger one means a wrong unit."""

PITCH_FACTORS = (0.2, 5.0)
"""Bounds of the target's scale; beyond them a unit is wrong, not the target."""

SCALE_ROUNDS = 2
"""Newton steps of the scale; the first uses noise levels that are still too large."""

UNWRAPPING_STARTS, UNWRAPPING_ROUNDS = 8, 3
AGREEMENT_TOLERANCE_RAD = float(np.radians(0.5))
"""Mean mismatch below which the search ends."""

MIN_NEIGHBOURS, MAX_NEIGHBOURS = 4, 40
"""Bounds of the number of pairs of successive views on which a shift of the poses by one is tested."""

CONVENTIONS = (
    Convention(
        "quaternion-w-last",
        "the quaternions are written x, y, z, w; here the scalar comes first",
        "write every quaternion as w, x, y, z",
        _w_last,
    ),
    Convention(
        "poses-inverted",
        "the poses are inverted: they map base coordinates to the flange (flange_T_base)",
        "give base_T_flange: the flange's position and orientation in the base",
        _invert,
    ),
    Convention(
        "poses-in-metres",
        "the robot's translations are in metres",
        "multiply every translation by 1000: translation_mm is in millimetres",
        _scale_translations(1000.0),
    ),
    Convention(
        "poses-in-micrometres",
        "the robot's translations are 1000 times too large",
        "divide every translation by 1000: translation_mm is in millimetres",
        _scale_translations(0.001),
    ),
    Convention(
        "poses-in-inches",
        "the robot's translations are in inches",
        "multiply every translation by 25.4: translation_mm is in millimetres",
        _scale_translations(25.4),
    ),
    Convention(
        "radians-read-as-degrees",
        "the rotation vectors were in radians and were read as degrees: all orientations are 57 times too alike",
        "convert the rotation vectors without the factor pi/180",
        _radians_read_as_degrees,
    ),
    Convention(
        "degrees-read-as-radians",
        "the rotation vectors were in degrees and were read as radians",
        "convert the rotation vectors to radians first (times pi/180)",
        _degrees_read_as_radians,
    ),
)


def convention_hypotheses(evidence: Evidence) -> Iterator[Hypothesis]:
    """One hypothesis for each convention, and one for the target's size if it differs by MIN_SCALE_ERROR."""
    yield from reading_hypotheses(evidence)
    factor = likeliest_scale(evidence)
    if abs(factor - 1) > MIN_SCALE_ERROR:
        yield _pitch(evidence, factor)


def reading_hypotheses(evidence: Evidence, alternatives: int = len(CONVENTIONS)) -> Iterator[Hypothesis]:
    """One hypothesis for each convention that gives poses within MAX_CELL_MM."""
    for convention in CONVENTIONS:
        corrected = evidence.with_robot_poses(convention.undo(evidence.base_T_flange, evidence.camera_T_target))
        if np.median(np.linalg.norm(corrected.base_T_flange[:, :3, 3], axis=1)) > MAX_CELL_MM:
            continue
        yield Hypothesis(
            convention.code, (), corrected, evidence, convention.message, convention.fix, alternatives=alternatives
        )


def off_by_one_hypotheses(evidence: Evidence) -> Iterator[Hypothesis]:
    """Two hypotheses: every image has the pose of the view after it, or before it."""
    next_to = np.flatnonzero(np.diff(evidence.indices) == 1)
    if len(next_to) < MIN_NEIGHBOURS:
        return
    next_to = next_to[np.unique(np.linspace(0, len(next_to) - 1, MAX_NEIGHBOURS).astype(np.intp))]
    for images, poses, message in (
        (next_to, next_to + 1, "image k was taken at pose k + 1"),
        (next_to + 1, next_to, "image k was taken at pose k - 1"),
    ):
        baseline = evidence.take(images)
        yield Hypothesis(
            "poses-off-by-one",
            (),
            baseline.with_robot_poses(evidence.base_T_flange[poses]),
            baseline,
            f"the poses are off by one: {message}",
            "pair every image with the pose it was taken at; a missing or doubled first row is the usual cause",
            alternatives=2,
        )


def _pitch(evidence: Evidence, factor: float) -> Hypothesis:
    return Hypothesis(
        "wrong-pitch",
        (),
        evidence.scale_target(factor),
        evidence,
        f"the target is {factor:.4f} times as large as it was said to be",
        f"measure the printed target with a ruler; multiply its pitch (and tag or square size) by {factor:.4f}",
        unknowns=1,
        bonus=3 * len(evidence) * float(np.log(factor)),
        size=factor,
        test=partial(_size_p_value, factor=factor),
    )


def _size_p_value(scaled: Evidence, fitted: Fit, factor: float) -> float:
    """Probability that a target of the described size appears as much larger or smaller."""
    background = NoisePosterior.of(_with_size(scaled, fitted))
    return background.p_value_of(np.log([factor]), np.eye(background.steps.shape[1])[-1:])


def _with_size(scaled: Evidence, fitted: Fit) -> Fit:
    """The fit with the logarithm of the target's size as a further shared unknown, the last."""
    slope = np.zeros((len(scaled), 6, 1))
    slope[:, 3:, 0] = -scaled.camera_T_target[:, :3, 3]
    return replace(fitted, by_shared=np.concatenate([fitted.by_shared, slope], axis=2))


def likeliest_scale(evidence: Evidence) -> float:
    """The scale of the target at which the views are most likely.

    Refines `target_scale`, whose unweighted least squares may be off by tens of standard deviations where the images
    determine directions much better than distances.
    """
    size = np.log(target_scale(evidence))
    for _ in range(SCALE_ROUNDS):
        scaled = evidence.scale_target(float(np.exp(size)))
        size = np.clip(size + _with_size(scaled, fit(scaled)).step()[-1], *np.log(PITCH_FACTORS))
    return float(np.exp(size))


def target_scale(evidence: Evidence) -> float:
    """The scale of the target at which the camera's motions match the robot's, by least squares.

    R_i t + s R_i R u_i + t_i is the target's origin in the anchor for every view: linear in (t, s, origin).
    """
    anchor_T_mount = evidence.anchor_T_mount()
    rotation = kronecker(anchor_T_mount, evidence.camera_T_target)[:3, :3]
    turned = anchor_T_mount[:, :3, :3]
    seen = turned @ rotation @ evidence.camera_T_target[:, :3, 3:]
    rows = np.concatenate([turned, seen, -np.broadcast_to(np.eye(3), turned.shape)], axis=2).reshape(-1, 7)
    solution = np.linalg.lstsq(rows, -anchor_T_mount[:, :3, 3].reshape(-1), rcond=None)[0]
    return float(np.clip(solution[3], *PITCH_FACTORS))

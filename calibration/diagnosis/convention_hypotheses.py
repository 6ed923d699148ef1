"""Hypotheses about all robot poses: another convention, another unit, another order; and the target's size."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from calibration.closed_forms.kronecker import kronecker
from calibration.diagnosis.angle_agreement import angles_between_images, choose_candidates
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, fit
from calibration.diagnosis.hypothesis import Hypothesis
from calibration.diagnosis.orientation_readings import READINGS, likely_readings
from calibration.diagnosis.pose_errors import p_value_beside_all_errors
from calibration.kinematics.conventions import MM
from calibration.problem import Setup
from calibration.sentences.sentence import Sentence
from calibration.transforms import (
    Array,
    inverse,
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
    transform,
    vector_from_rotation,
)

MIN_SCALE_ERROR = 2e-4
"""Scale errors below it are ignored; paper changes by as much with humidity."""


@dataclass(frozen=True)
class Convention:
    """A wrong convention by the code of its sentence; `undo` corrects robot poses (n, 4, 4), given the images' poses.

    `shrinks`: the factor by which it makes translations smaller, 1 when it does not. The robot's errors shrink with
    them, which is no evidence: views of one point from one distance fit translations of any size, each with another X.
    """

    code: str
    undo: Callable[[Array, Array], Array]
    shrinks: float = 1.0


def change_quaternion_order(poses: Array, by: int = 1) -> Array:
    """Poses (n, 4, 4) with quaternions that were read as w, x, y, z, read as x, y, z, w; `by` -1: the reverse."""
    moved = np.roll(quaternion_from_rotation(poses[:, :3, :3]), by, axis=1)
    return transform(rotation_from_quaternion(moved), poses[:, :3, 3])


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
    chosen = choose_candidates(rotations, angles_between_images(camera_T_target))
    return transform(rotations[np.arange(len(vectors)), chosen], base_T_flange[:, :3, 3])


MAX_CELL_MM = 20_000.0
"""Largest distance of a flange from its base; no arm reaches further, so a larger one means a wrong unit."""

PITCH_FACTORS = (0.2, 5.0)
"""Bounds of the target's scale; beyond them a unit is wrong, not the target."""

MIN_SETUP_RATIO = 1.5
"""Least ratio of the longer unknown transform to the shorter that decides between inverted poses and another setup."""

SCALE_ROUNDS = 2
"""Newton steps of the scale; the first uses noise levels that are still too large."""

MIN_NEIGHBOURS, MAX_NEIGHBOURS = 4, 40
"""Bounds of the number of pairs of successive views on which a shift of the poses by one is tested."""

CONVENTIONS = (
    Convention("quaternion-w-last", lambda base_T_flange, _: change_quaternion_order(base_T_flange)),
    Convention("quaternion-w-first", lambda base_T_flange, _: change_quaternion_order(base_T_flange, -1)),
    Convention("poses-inverted", lambda base_T_flange, _: inverse(base_T_flange)),
    Convention("poses-in-metres", _scale_translations(MM["m"])),
    Convention("poses-in-micrometres", _scale_translations(MM["um"]), shrinks=MM["um"]),
    Convention("poses-in-inches", _scale_translations(MM["inches"])),
    Convention("radians-read-as-degrees", _radians_read_as_degrees),
    Convention("degrees-read-as-radians", _degrees_read_as_radians),
)


def convention_hypotheses(evidence: Evidence) -> Iterator[Hypothesis]:
    """One hypothesis for each convention, and one for the target's size if it differs by MIN_SCALE_ERROR."""
    yield from reading_hypotheses(evidence)
    factor = likeliest_scale(evidence)
    if abs(factor - 1) > MIN_SCALE_ERROR:
        yield _pitch(evidence, factor)


def reading_hypotheses(evidence: Evidence) -> Iterator[Hypothesis]:
    """One hypothesis for each convention that gives poses within MAX_CELL_MM."""
    for convention in CONVENTIONS:
        corrected = evidence.with_robot_poses(convention.undo(evidence.base_T_flange, evidence.camera_T_target))
        if np.median(np.linalg.norm(corrected.base_T_flange[:, :3, 3], axis=1)) > MAX_CELL_MM:
            continue
        yield Hypothesis(
            convention.code, (), corrected, evidence, Sentence(convention.code), Sentence(f"undo-{convention.code}"),
            alternatives=len(CONVENTIONS), whole_session=True,
            bonus=3 * len(corrected) * float(np.log(convention.shrinks)),
        )  # fmt: skip


def orientation_hypotheses(evidence: Evidence) -> Iterator[Hypothesis]:
    """One hypothesis for each likely reading of the three numbers of an orientation."""
    seen = angles_between_images(evidence.camera_T_target)
    for likely in likely_readings(evidence.base_T_flange[:, :3, :3], seen):
        reading, whole = likely.reading, len(likely.rows) == len(evidence)
        baseline = evidence if whole else evidence.take(likely.rows)
        corrected = baseline.with_robot_poses(transform(likely.rotations, baseline.base_T_flange[:, :3, 3]))
        yield Hypothesis(
            reading.code, (), corrected, baseline, reading.message, reading.fix,
            alternatives=READINGS, whole_session=True,
        )  # fmt: skip


def inverted_or_other_setup(inverted: Hypothesis) -> Hypothesis:
    """The hypothesis of inverted poses, or that of the other setup, whose equations are the same.

    What is on the flange is near it, and the base is further from what stands in the cell: the shorter of the two
    unknown transforms belongs to the flange.
    """
    fitted = fit(inverted.evidence)
    setup = inverted.evidence.setup
    camera_mm, target_mm = (
        float(np.linalg.norm(pose[0, :3, 3])) for pose in (fitted.mount_T_camera, fitted.anchor_T_target)
    )
    on_flange_mm, in_cell_mm = (camera_mm, target_mm) if setup == "eye-in-hand" else (target_mm, camera_mm)
    other: Setup = "eye-to-hand" if setup == "eye-in-hand" else "eye-in-hand"
    carried, standing = ("target", "camera") if setup == "eye-in-hand" else ("camera", "target")
    swapped = Sentence("setup-swapped", carried=carried, standing=standing, right=other, given=setup)
    change = Sentence("set-setup", right=other)
    if on_flange_mm > MIN_SETUP_RATIO * in_cell_mm:
        return replace(inverted, code="setup-swapped", message=swapped, fix=change)
    if in_cell_mm > MIN_SETUP_RATIO * on_flange_mm:
        return inverted
    if on_flange_mm > in_cell_mm:
        message, fix = either(swapped, inverted.message), either(change, inverted.fix)
        return replace(inverted, code="setup-swapped", message=message, fix=fix)
    return replace(inverted, message=either(inverted.message, swapped), fix=either(inverted.fix, change))


def either(likelier: str, other: str) -> Sentence:
    """Two sentences of which one is right."""
    return Sentence("either", first=likelier, second=other)


def off_by_one_hypotheses(evidence: Evidence) -> Iterator[Hypothesis]:
    """Two hypotheses: every image has the pose of the view after it, or before it."""
    next_to = np.flatnonzero(np.diff(evidence.indices) == 1)
    if len(next_to) < MIN_NEIGHBOURS:
        return
    next_to = next_to[np.unique(np.linspace(0, len(next_to) - 1, MAX_NEIGHBOURS).astype(np.intp))]
    for images, poses, shift in ((next_to, next_to + 1, 1), (next_to + 1, next_to, -1)):
        baseline = evidence.take(images)
        yield Hypothesis(
            "poses-off-by-one",
            (),
            baseline.with_robot_poses(evidence.base_T_flange[poses]),
            baseline,
            Sentence("poses-off-by-one", shift=shift),
            Sentence("pair-images-first-row"),
            alternatives=2,
            whole_session=True,
        )


def _pitch(evidence: Evidence, factor: float) -> Hypothesis:
    return Hypothesis(
        "wrong-pitch",
        (),
        evidence.scale_target(factor),
        evidence,
        Sentence("wrong-pitch", factor=factor),
        Sentence("multiply-pitch", factor=factor),
        unknowns=1,
        bonus=3 * len(evidence) * float(np.log(factor)),
        size=factor,
        test=partial(_size_p_value, factor=factor),
    )


def _size_p_value(scaled: Evidence, fitted: Fit, factor: float) -> float:
    """Probability that a target of the described size appears as much larger or smaller.

    An arm with longer links than drawn travels further than it reports, as beside a smaller target, so a part of its
    errors that follow the pose counts as such a share of its travel.
    """
    with_size = _with_size(scaled, fitted)
    size = np.eye(with_size.by_shared.shape[2])[-1:]
    return p_value_beside_all_errors(scaled, with_size, np.log([factor]), size, is_size=True)


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

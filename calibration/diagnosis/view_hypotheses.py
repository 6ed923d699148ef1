"""Hypotheses about one view, two views, or every view from one on."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, fit, fits
from calibration.diagnosis.hypothesis import Hypothesis
from calibration.diagnosis.pose_errors import p_value_beside_all_errors
from calibration.kinematics.robot_accuracy import postures_can_differ_by
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, inverse, map_points, rotation_angle_rad, transform, vector_from_transform

MAX_SUSPECTS = 10
"""Views that fit worst, among which mistyped and swapped poses are searched."""

MAX_SWAPS = 6
"""Pairs of suspects for which an exchange of their poses is tested."""

MIN_VIEWS_TO_RANK = 10
"""Least views of which `find_suspects` leaves out two or more in its half."""

STARTS = 8
CONCENTRATION_ITERATIONS = 4
"""Iterations of a fit during concentration, where it need not be exact."""

MIN_VIEWS_PER_SIDE = 2
"""Least views before and after a change."""

MIN_VIEWS_FOR_CHANGE = 6
"""Least views for the 18 unknowns of a change."""


@dataclass(frozen=True, eq=False)
class Suspects:
    """Rows of the views that fit worst, and the fit to the half that agrees best."""

    rows: list[int]
    half: Fit


def find_suspects(evidence: Evidence, few: NDArray[np.intp], fitted: Fit) -> Suspects:
    """The views that fit worst under a fit to the `few` rows, and under one to the half of them that agrees best.

    The half is found by concentration from several starts (Rousseeuw & Van Driessen, Technometrics 41(3), 1999), since
    a gross error biases the fit to all.
    """
    sample = evidence.take(few)
    n = len(sample)
    half = max(4, (n + 7) // 2)
    if n < half + 1:
        return Suspects(list(range(n)), fitted)
    rng = np.random.default_rng(0)
    fours = [sample.take(rng.choice(n, 4, replace=False)) for _ in range(STARTS)]
    candidates = [fitted, *fits(fours, iterations=CONCENTRATION_ITERATIONS)]
    for _ in range(3):
        off = [np.argsort(_distances(sample, candidate))[:half] for candidate in candidates]
        candidates = fits([sample.take(np.sort(rows)) for rows in off], iterations=CONCENTRATION_ITERATIONS)
    spread = [np.sort(_distances(sample, candidate))[:half].sum() for candidate in candidates]
    best = candidates[int(np.argmin(spread))]
    robust = _distances(evidence, best)
    worst = np.concatenate([np.argsort(-robust)[:MAX_SUSPECTS], few[np.argsort(-fitted.distances())[:MAX_SUSPECTS]]])
    return Suspects([int(row) for row in dict.fromkeys(worst.tolist())][: MAX_SUSPECTS + 4], best)


def _distances(evidence: Evidence, fitted: Fit) -> Array:
    """Unweighted distance (n,) of every view from a fit: shift over the target's median distance, plus rotation."""
    anchor_T_mount = evidence.anchor_T_mount()
    off = anchor_T_mount @ fitted.mount_T_camera[0] @ evidence.camera_T_target
    shift = np.linalg.norm(off[:, :3, 3] - fitted.anchor_T_target[0][:3, 3], axis=1)
    turn = np.linalg.norm(off[:, :3, :3] - fitted.anchor_T_target[0][:3, :3], axis=(1, 2))
    distance = np.linalg.norm(evidence.camera_T_target[:, :3, 3], axis=1)
    result: Array = shift / np.median(distance) + turn
    return result


def pose_swap_hypotheses(evidence: Evidence, suspects: Sequence[int], half: Fit) -> Iterator[Hypothesis]:
    """Two views whose poses were exchanged: the pairs that then fit best to the `half` that agrees."""
    pairs = np.array(list(combinations(sorted(suspects), 2)))
    if not len(pairs):
        return
    exchanged = evidence.take(pairs.ravel()).with_robot_poses(evidence.base_T_flange[pairs[:, ::-1].ravel()])
    left = _distances(exchanged, half).reshape(-1, 2).sum(axis=1)
    # With fewer views no half excludes the two.
    tried = MAX_SWAPS if len(evidence) >= MIN_VIEWS_TO_RANK else len(pairs)
    for i, j in pairs[np.argsort(left)[:tried]].tolist():
        poses = evidence.base_T_flange.copy()
        poses[[i, j]] = poses[[j, i]]
        where = int(evidence.indices[i]), int(evidence.indices[j])
        yield Hypothesis(
            "poses-swapped",
            where,
            evidence.with_robot_poses(poses),
            evidence,
            Sentence("poses-swapped", first=where[0], second=where[1]),
            Sentence("exchange-poses"),
            alternatives=len(evidence) * (len(evidence) - 1) // 2,
        )


def board_turn_hypotheses(evidence: Evidence, suspects: Sequence[int], centre_mm: Array) -> Iterator[Hypothesis]:
    """The board turned by 180 degrees in one view."""
    turn = np.diag([-1.0, -1.0, 1.0])
    half_turn = transform(turn, centre_mm - turn @ centre_mm)
    for row in suspects:
        seen = evidence.camera_T_target.copy()
        seen[row] = seen[row] @ half_turn
        where = int(evidence.indices[row])
        yield Hypothesis(
            "board-turned",
            (where,),
            evidence.with_camera_poses(seen),
            evidence,
            Sentence("board-turned-in-view", view=where),
            Sentence("leave-view-out"),
            alternatives=len(evidence),
        )


def change_points(n: int) -> range:
    """Rows at which a change is tested."""
    return range(MIN_VIEWS_PER_SIDE, n - MIN_VIEWS_PER_SIDE + 1) if n >= MIN_VIEWS_FOR_CHANGE else range(0)


@dataclass(frozen=True)
class Change:
    """The cause of a change of X (`of_x`) or of the target's pose at some view; `code` is its sentence's id, too."""

    code: str
    of_x: bool
    fix: Sentence


CHANGES = {
    "eye-in-hand": (
        Change("board-moved", False, Sentence("fasten-board")),
        Change("camera-or-tool-changed", True, Sentence("fasten-camera-tool0")),
    ),
    "eye-to-hand": (
        Change("board-or-tool-changed", False, Sentence("fasten-board-tool0")),
        Change("camera-moved", True, Sentence("fasten-camera")),
    ),
}

CHANGE_CODES = frozenset(change.code for changes in CHANGES.values() for change in changes)


def change_hypotheses(evidence: Evidence, points: Sequence[int]) -> Iterator[Hypothesis]:
    """Hypotheses that X or the target's pose changes at each of the `points`."""
    for point in points:
        labels = (np.arange(len(evidence)) >= point).astype(np.intp)
        where = int(evidence.indices[point])
        for change in CHANGES[evidence.setup]:
            yield Hypothesis(
                change.code,
                (where,),
                evidence,
                evidence,
                change_message(change, [where]),
                change.fix,
                x_labels=labels if change.of_x else None,
                y_labels=None if change.of_x else labels,
                unknowns=6,
                alternatives=2 * len(evidence),
                test=partial(change_p_value, of_x=change.of_x),
            )


def change_message(change: Change, views: Sequence[int]) -> Sentence:
    """The message of a change; `views`: where it may have happened, the most likely first."""
    others = sorted(views[1:])
    view = Sentence("view-or", view=views[0], others=others) if others else views[0]
    return Sentence(change.code, view=view)


def or_another_posture(change: Hypothesis) -> Hypothesis:
    """The change, its message naming another posture of the arm as well where it is no larger than postures differ by.

    Where the joints are known, its p value is the one beside errors that follow the posture, and nothing is added.
    """
    if change.evidence.joints_rad is not None:
        return change
    of_target, fitted = change.x_labels is None, fit(change.evidence, change.x_labels, change.y_labels)
    before, after = fitted.anchor_T_target if of_target else fitted.mount_T_camera
    by = after @ inverse(before)  # of the base for what stands in the cell, of the flange for what it carries
    in_cell = of_target == (change.evidence.setup == "eye-in-hand")
    flange_mm = change.evidence.base_T_flange[:, :3, 3].mean(axis=0) if in_cell else np.zeros(3)
    off_mm = float(np.linalg.norm(map_points(by, flange_mm[None]) - flange_mm))
    if not postures_can_differ_by(off_mm, float(rotation_angle_rad(by[:3, :3]))):
        return change
    message, fix = Sentence("change-or-posture", change=change.message), Sentence("fix-or-joints", fix=change.fix)
    return replace(change, message=message, fix=fix)


def change_p_value(evidence: Evidence, fitted: Fit, *, of_x: bool) -> float:
    """Probability that a constant X (`of_x`), or a constant target's pose, appears as different before and after."""
    (before, after), first = (fitted.mount_T_camera, 0) if of_x else (fitted.anchor_T_target, 6)
    by_unknowns = np.zeros((6, fitted.by_shared.shape[2]))
    by_unknowns[:, first : first + 6], by_unknowns[:, first + 6 : first + 12] = -np.eye(6), np.eye(6)
    return p_value_beside_all_errors(evidence, fitted, vector_from_transform(inverse(before) @ after), by_unknowns)

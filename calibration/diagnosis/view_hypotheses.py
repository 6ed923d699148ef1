"""Causes that touch one view, two views, or every view from one on."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, fits
from calibration.diagnosis.hypothesis import Trial
from calibration.diagnosis.significance import Background
from calibration.transforms import Array, inverse, transform, vector_from_transform

SUSPECTS = 10
"""Views that fit worst, among which mistyped and swapped ones are sought."""

SWAPS = 6
"""Pairs of suspects of which it is tried whether their poses were exchanged."""

FEWEST_TO_RANK = 10
"""Views of which `suspects_of` leaves out two or more."""

STARTS = 8
CONCENTRATING = 4
"""Iterations while the half that agrees is sought: it need not be exact."""

STRETCH = 2
"""Fewest views before and after a change."""

FEWEST_TO_CHANGE = 6
"""Fewer views cannot carry the 18 unknowns of a change."""


@dataclass(frozen=True, eq=False)
class Suspects:
    """Rows of the views that fit worst, and the fit to the half that agrees best."""

    rows: list[int]
    half: Fit


def suspects_of(evidence: Evidence, few: NDArray[np.intp], fitted: Fit) -> Suspects:
    """Under a fit to the `few` rows, and under one to the half of them that agrees best.

    The half is found by concentration from several starts (Rousseeuw & Van Driessen, Technometrics 41(3), 1999),
    for a gross error spoils the fit to all.
    """
    sample = evidence.take(few)
    n = len(sample)
    half = max(4, (n + 7) // 2)
    if n < half + 1:
        return Suspects(list(range(n)), fitted)
    rng = np.random.default_rng(0)
    fours = [sample.take(rng.choice(n, 4, replace=False)) for _ in range(STARTS)]
    candidates = [fitted, *fits(fours, iterations=CONCENTRATING)]
    for _ in range(3):
        off = [np.argsort(_distances(sample, candidate))[:half] for candidate in candidates]
        candidates = fits([sample.take(np.sort(rows)) for rows in off], iterations=CONCENTRATING)
    spread = [np.sort(_distances(sample, candidate))[:half].sum() for candidate in candidates]
    best = candidates[int(np.argmin(spread))]
    robust = _distances(evidence, best)
    worst = np.concatenate([np.argsort(-robust)[:SUSPECTS], few[np.argsort(-fitted.distances())[:SUSPECTS]]])
    return Suspects([int(row) for row in dict.fromkeys(worst.tolist())][: SUSPECTS + 4], best)


def _distances(evidence: Evidence, fitted: Fit) -> Array:
    """How far every view (n,) is off under a fit to some: millimetres over the target's distance, plain and robust."""
    anchor_T_mount = evidence.anchor_T_mount()
    off = anchor_T_mount @ fitted.mount_T_camera[0] @ evidence.camera_T_target
    shift = np.linalg.norm(off[:, :3, 3] - fitted.anchor_T_target[0][:3, 3], axis=1)
    turn = np.linalg.norm(off[:, :3, :3] - fitted.anchor_T_target[0][:3, :3], axis=(1, 2))
    distance = np.linalg.norm(evidence.camera_T_target[:, :3, 3], axis=1)
    result: Array = shift / np.median(distance) + turn
    return result


def swapped_trials(evidence: Evidence, suspects: Sequence[int], half: Fit) -> Iterator[Trial]:
    """Two views whose poses were exchanged: the pairs that would fit best to the `half` that agrees."""
    pairs = np.array(list(combinations(sorted(suspects), 2)))
    if not len(pairs):
        return
    exchanged = evidence.take(pairs.ravel()).with_robot_poses(evidence.base_T_flange[pairs[:, ::-1].ravel()])
    left = _distances(exchanged, half).reshape(-1, 2).sum(axis=1)
    # In fewer views there is no half without the two.
    tried = SWAPS if len(evidence) >= FEWEST_TO_RANK else len(pairs)
    for i, j in pairs[np.argsort(left)[:tried]].tolist():
        poses = evidence.base_T_flange.copy()
        poses[[i, j]] = poses[[j, i]]
        where = int(evidence.indices[i]), int(evidence.indices[j])
        yield Trial(
            "poses-swapped",
            where,
            evidence.with_robot_poses(poses),
            evidence,
            f"the poses of views {where[0]} and {where[1]} are swapped",
            "exchange the two poses",
            alternatives=len(evidence) * (len(evidence) - 1) // 2,
        )


def turned_trials(evidence: Evidence, suspects: Sequence[int], centre_mm: Array) -> Iterator[Trial]:
    """The board turned by 180 degrees in one view."""
    turn = np.diag([-1.0, -1.0, 1.0])
    half_turn = transform(turn, centre_mm - turn @ centre_mm)
    for row in suspects:
        seen = evidence.camera_T_target.copy()
        seen[row] = seen[row] @ half_turn
        where = int(evidence.indices[row])
        yield Trial(
            "board-turned",
            (where,),
            evidence.with_camera_poses(seen),
            evidence,
            f"the board stands turned by 180 degrees in view {where}",
            "leave that view out; do not touch the board during a run",
            alternatives=len(evidence),
        )


def change_points(n: int) -> range:
    """Rows at which a change may be."""
    return range(STRETCH, n - STRETCH + 1) if n >= FEWEST_TO_CHANGE else range(0)


@dataclass(frozen=True)
class Change:
    """What it means that X, or the target's pose, is another one from some view on."""

    code: str
    of_x: bool
    message: str
    fix: str


CHANGED = {
    "eye-in-hand": (
        Change("board-moved", False, "the board moved before view {}", "fasten the board and take the views again"),
        Change(
            "camera-or-tool-changed",
            True,
            "from view {} on the camera sits elsewhere on the flange, or another tool was active",
            "fasten the camera, make tool0 active in every view, and take the views again",
        ),
    ),
    "eye-to-hand": (
        Change(
            "board-or-tool-changed",
            False,
            "from view {} on the board sits elsewhere on the flange, or another tool was active",
            "fasten the board, make tool0 active in every view, and take the views again",
        ),
        Change("camera-moved", True, "the camera moved before view {}", "fasten the camera and take the views again"),
    ),
}

CHANGE_CODES = frozenset(change.code for changes in CHANGED.values() for change in changes)


def moved_trials(evidence: Evidence, points: Sequence[int]) -> Iterator[Trial]:
    """The target, or the camera (or the active tool), is elsewhere from some view on."""
    for point in points:
        labels = (np.arange(len(evidence)) >= point).astype(np.intp)
        where = int(evidence.indices[point])
        for change in CHANGED[evidence.setup]:
            yield Trial(
                change.code,
                (where,),
                evidence,
                evidence,
                moved_message(change, [where]),
                change.fix + ", or keep only the views on one side",
                x_labels=labels if change.of_x else None,
                y_labels=None if change.of_x else labels,
                unknowns=6,
                alternatives=2 * len(evidence),
                test=x_changed if change.of_x else y_changed,
            )


def moved_message(change: Change, views: Sequence[int]) -> str:
    """`views`: where it may have happened, the likeliest first."""
    others = f" (or {', '.join(map(str, sorted(views[1:])))})" if len(views) > 1 else ""
    return change.message.format(f"{views[0]}{others}") + ": the views before and after it agree among themselves"


def x_changed(_: Evidence, fitted: Fit) -> float:
    """By chance, how often would X seem as different from some view on?"""
    return _changed(fitted, fitted.mount_T_camera, 0)


def y_changed(_: Evidence, fitted: Fit) -> float:
    """By chance, how often would the target's pose seem as different from some view on?"""
    return _changed(fitted, fitted.anchor_T_target, 6)


def _changed(fitted: Fit, poses: Array, first: int) -> float:
    """`poses` (2, 4, 4) before and after; `first`: where among the shared unknowns theirs begin."""
    before, after = poses
    between = inverse(before) @ after
    step = vector_from_transform(between)
    by_unknowns = np.zeros((6, fitted.by_shared.shape[2]))
    by_unknowns[:, first : first + 6], by_unknowns[:, first + 6 : first + 12] = -np.eye(6), np.eye(6)
    return Background.of(fitted).chance_of(step, by_unknowns)

"""One view whose robot pose is wrong, and, where it can be told, which of its seven numbers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import SMALLEST_INFORMATION, Fit, fits, inverted, predicted_base_T_flange, residuals_of
from calibration.diagnosis.trial import Outcome, Trial, few_views_factor, price_of
from calibration.transforms import Array, quaternion_from_rotation, rotation_from_quaternion, transform

FREE_POSE = 6
NUMBERS = ("x", "y", "z", "q1 (w)", "q2 (x)", "q3 (y)", "q4 (z)")
PLAUSIBLE = 22.5
"""A view that is in order has a smaller squared distance in 999 of 1000 cases (chi², 6 degrees of freedom)."""

TOLD_APART = 6.0
"""Squared distances differ by this much where one number explains the view and another does not."""

LARGEST_SLIP = 0.1
"""In a quaternion element: a larger one breaks the norm, and the pose is refused where it is read."""

STEPS = np.array([1e-2] * 3 + [1e-5] * 4)
"""For differences in mm and in quaternion elements."""


@dataclass(frozen=True, eq=False)
class Rest:
    """What the other views say of one: their fit, the view's residual (6,) and its information (6, 6)."""

    view: Evidence
    fitted: Fit
    residual: Array
    information: Array
    log_determinant: float


def mistyped_outcomes(evidence: Evidence, suspects: Sequence[int], baseline: float) -> Iterator[Outcome]:
    """For each suspect the better of: its pose is wrong somehow, one of its numbers is wrong."""
    others = [evidence.take(np.delete(np.arange(len(evidence)), row)) for row in suspects]
    for row, fitted in zip(suspects, fits(others), strict=True):
        view = evidence.take(np.array([row]))
        residual, covariance = residuals_of(view, fitted)
        log_determinant = float(np.linalg.slogdet(covariance[0])[1])
        rest = Rest(view, fitted, residual[0], inverted(covariance[0]), log_determinant)
        n = len(evidence)
        best = _best(_whole_pose(rest, n), [*_numbers(rest, n), *_signs(rest, n)])
        raw = fitted.log_likelihood - 0.5 * (log_determinant + best.misfit) - baseline
        gain = few_views_factor(n, best.unknowns) * raw - price_of(n, best.unknowns, best.alternatives)
        trial = Trial("pose-mistyped", (int(view.indices[0]),), view, view, best.message, FIX)
        yield Outcome(trial, gain, fitted.robot_translation_mm, fitted.robot_rotation_rad)


FIX = "read that pose on the controller again; if it is right, the arm had not settled, or the image is bad"


@dataclass(frozen=True)
class _Candidate:
    misfit: float
    unknowns: int
    alternatives: int
    message: str


def _best(whole: _Candidate, numbers: list[_Candidate]) -> _Candidate:
    """The one number that explains the view, if there is one and no other does as well; else the pose as a whole."""
    first, second = sorted(numbers, key=lambda candidate: candidate.misfit + 2 * price_of(1, candidate.unknowns, 1))[:2]
    told = first.misfit < PLAUSIBLE and second.misfit > first.misfit + TOLD_APART
    return first if told else whole


def _whole_pose(rest: Rest, n: int) -> _Candidate:
    where = int(rest.view.indices[0])
    expected = predicted_base_T_flange(rest.view, rest.fitted, 0)
    off = expected[:3, 3] - rest.view.base_T_flange[0, :3, 3]
    turn = np.degrees(
        np.arccos(np.clip((np.trace(expected[:3, :3].T @ rest.view.base_T_flange[0, :3, :3]) - 1) / 2, -1, 1))
    )
    message = f"the pose of view {where} disagrees with all others by {np.linalg.norm(off):.2f} mm and {turn:.2f} deg"
    return _Candidate(0.0, FREE_POSE, n, message)


def _numbers(rest: Rest, n: int) -> Iterator[_Candidate]:
    """One of the seven numbers off by what fits best, to first order: a larger slip in a quaternion breaks its norm."""
    given = _printed(rest.view.base_T_flange[0])
    stepped = _residuals(rest, np.concatenate([given[None], given + np.diag(STEPS)]))
    slopes = (stepped[1:] - stepped[0]) / STEPS[:, None]
    information = np.einsum("ki,ij,kj->k", slopes, rest.information, slopes)
    changes = -(slopes @ rest.information @ rest.residual) / np.maximum(information, SMALLEST_INFORMATION)
    told = (np.arange(7) < 3) | (np.abs(changes) < LARGEST_SLIP)
    right = given + np.diag(np.where(told, changes, 0.0))
    misfits = _misfits(rest, right)
    for index in np.flatnonzero(told).tolist():
        yield _Candidate(misfits[index], 1, 7 * n, _message(rest, given, right[index], index))


def _signs(rest: Rest, n: int) -> Iterator[_Candidate]:
    """A sign lost in one of the quaternion's elements."""
    given = _printed(rest.view.base_T_flange[0])
    right = given * (1 - 2 * np.eye(7)[3:])
    for index, misfit in enumerate(_misfits(rest, right)):
        yield _Candidate(misfit, 0, 7 * n, _message(rest, given, right[index], 3 + index))


def _message(rest: Rest, given: Array, right: Array, index: int) -> str:
    digits = 2 if index < 3 else 5
    return (
        f"the pose of view {int(rest.view.indices[0])} has a wrong number: "
        f"{NUMBERS[index]} is {given[index]:.{digits}f} and should be about {right[index]:.{digits}f}"
    )


def _printed(base_T_flange: Array) -> Array:
    """The seven numbers of a pose: x y z w x y z."""
    return np.concatenate([base_T_flange[:3, 3], quaternion_from_rotation(base_T_flange[:3, :3])])


def _misfits(rest: Rest, numbers: Array) -> list[float]:
    residuals = _residuals(rest, numbers)
    return [float(misfit) for misfit in np.einsum("ki,ij,kj->k", residuals, rest.information, residuals)]


def _residuals(rest: Rest, numbers: Array) -> Array:
    """The view's residual (k, 6) if its pose were what these numbers (k, 7) say."""
    quaternions = numbers[:, 3:] / np.linalg.norm(numbers[:, 3:], axis=1, keepdims=True)
    poses = transform(rotation_from_quaternion(quaternions), numbers[:, :3])
    copies = rest.view.take(np.zeros(len(numbers), np.intp)).with_robot_poses(poses)
    residuals: Array = residuals_of(copies, rest.fitted)[0]
    return residuals

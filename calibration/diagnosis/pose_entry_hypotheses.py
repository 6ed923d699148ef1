"""One view whose robot pose is wrong, and, where it can be told, which of its seven numbers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, applied, fits, predicted_base_T_flange
from calibration.diagnosis.hypothesis import Outcome, Trial, few_views_factor, price_of
from calibration.diagnosis.significance import Background, Outsider
from calibration.transforms import Array, quaternion_from_rotation, rotation_from_quaternion, transform

FREE_POSE = 6
NUMBERS = ("x", "y", "z", "q1 (w)", "q2 (x)", "q3 (y)", "q4 (z)")
IMPLAUSIBLE = 1e-3
"""A view that is in order is off by more this often."""

TOLD_APART = 6.0
"""Squared distances differ by this much where one number explains the view and another does not."""

LARGEST_SLIP = 0.1
"""In a quaternion element: a larger one breaks the norm, and the pose is refused where it is read."""

STEPS = np.array([1e-2] * 3 + [1e-5] * 4)
"""For differences in mm and in quaternion elements."""


LIKELIEST = 4
"""Suspects that are looked at closely: those without which the others agree best."""


@dataclass(frozen=True, eq=False)
class Rest:
    """What the other views say of one: their fit, and where it lies against them; `views`: how many there are."""

    view: Evidence
    fitted: Fit
    outsider: Outsider
    views: int


@dataclass(frozen=True)
class _Candidate:
    """`misfit`: squared distance that this explanation leaves, of which `plausible` is true or not; `slope`: see
    `Outsider.chance_along`, None where the explanation is no small change of one `number`."""

    misfit: float
    plausible: bool
    unknowns: int
    alternatives: int
    message: str
    number: int | None = None
    slope: Array | None = None


def mistyped_outcomes(evidence: Evidence, suspects: Sequence[int], baseline: float) -> Iterator[Outcome]:
    """For the likeliest suspects the better of: its pose is wrong somehow, one of its numbers is wrong."""
    n = len(evidence)
    others = fits([evidence.take(np.delete(np.arange(n), row)) for row in suspects])
    views = [evidence.take(np.array([row])) for row in suspects]
    # The log-likelihood without a view's residual.
    without = [fitted.log_likelihood - 0.5 * _own(view, fitted) for view, fitted in zip(views, others, strict=True)]
    for suspect in np.argsort(without)[::-1][:LIKELIEST]:
        if few_views_factor(n, 0) * (without[suspect] - baseline) < price_of(n, 0, 7 * n):
            return  # Nothing that is wrong with it could be worth its price, nor with the next.
        view, fitted = views[suspect], others[suspect]
        rest = Rest(view, fitted, Background.of(fitted).of_outsider(applied(view, fitted)), n)
        numbers = [*_numbers(rest), *_signs(rest)]
        best = _best(_whole_pose(rest), numbers)
        raw = without[suspect] - 0.5 * best.misfit - baseline
        gain = few_views_factor(n, best.unknowns) * raw - price_of(n, best.unknowns, best.alternatives)
        trial = Trial("pose-mistyped", (int(view.indices[0]),), view, view, best.message, FIX)
        slopes = np.array([number.slope for number in numbers if number.slope is not None])
        chance = partial(_chance, rest, slopes)
        yield Outcome(trial, gain, fitted.robot_translation_mm, fitted.robot_rotation_rad, chance)


FIX = "read that pose on the controller again; if it is right, the arm had not settled, or the image is bad"


def _own(view: Evidence, fitted: Fit) -> float:
    return float(np.linalg.slogdet(applied(view, fitted).covariance[0])[1])


def _chance(rest: Rest, slopes: Array) -> float:
    """Two questions were asked of each view: is it off, and is one of its numbers."""
    by_number = 7 * rest.views * float(rest.outsider.chance_along(slopes).min())
    return min(2 * by_number, 2 * rest.views * rest.outsider.chance_off(), 1.0)


def _best(whole: _Candidate, numbers: list[_Candidate]) -> _Candidate:
    """The one number that explains the view, if there is one and no other does as well; else the pose as a whole."""
    by_price = sorted(numbers, key=lambda candidate: candidate.misfit + 2 * price_of(1, candidate.unknowns, 1))
    first = by_price[0]
    # A lost sign and a slip of the same element are one number.
    second = next(candidate for candidate in by_price if candidate.number != first.number)
    return first if first.plausible and second.misfit > first.misfit + TOLD_APART else whole


def _whole_pose(rest: Rest) -> _Candidate:
    where = int(rest.view.indices[0])
    expected = predicted_base_T_flange(rest.view, rest.fitted, 0)
    off = expected[:3, 3] - rest.view.base_T_flange[0, :3, 3]
    turn = np.degrees(
        np.arccos(np.clip((np.trace(expected[:3, :3].T @ rest.view.base_T_flange[0, :3, :3]) - 1) / 2, -1, 1))
    )
    message = f"the pose of view {where} disagrees with all others by {np.linalg.norm(off):.2f} mm and {turn:.2f} deg"
    return _Candidate(0.0, True, FREE_POSE, rest.views, message)


def _numbers(rest: Rest) -> Iterator[_Candidate]:
    """One of the seven numbers off by what fits best, to first order: a larger slip in a quaternion breaks its norm."""
    given = _printed(rest.view.base_T_flange[0])
    stepped = _residuals(rest, np.concatenate([given[None], given + np.diag(STEPS)]))
    slopes = (stepped[1:] - stepped[0]) / STEPS[:, None]
    changes = rest.outsider.fitting(slopes)
    told = (np.arange(7) < 3) | (np.abs(changes) < LARGEST_SLIP)
    right = given + np.diag(np.where(told, changes, 0.0))
    misfits, plausible = _left_by(rest, right)
    for index in np.flatnonzero(told).tolist():
        message = _message(rest, given, right[index], index)
        yield _Candidate(misfits[index], plausible[index], 1, 7 * rest.views, message, index, slopes[index])


def _signs(rest: Rest) -> Iterator[_Candidate]:
    """A sign lost in one of the quaternion's elements."""
    given = _printed(rest.view.base_T_flange[0])
    right = given * (1 - 2 * np.eye(7)[3:])
    for index, (misfit, plausible) in enumerate(zip(*_left_by(rest, right), strict=True)):
        message = _message(rest, given, right[index], 3 + index)
        yield _Candidate(misfit, plausible, 0, 7 * rest.views, message, 3 + index)


def _left_by(rest: Rest, numbers: Array) -> tuple[list[float], list[bool]]:
    """Of poses that say these numbers (k, 7): the squared distances left, and whether chance would leave as much."""
    residuals = _residuals(rest, numbers)
    chances = [rest.outsider.chance_of(residual) for residual in residuals]
    return rest.outsider.squares(residuals).tolist(), [chance > IMPLAUSIBLE for chance in chances]


def _message(rest: Rest, given: Array, right: Array, index: int) -> str:
    digits = 2 if index < 3 else 5
    return (
        f"the pose of view {int(rest.view.indices[0])} has a wrong number: "
        f"{NUMBERS[index]} is {given[index]:.{digits}f} and should be about {right[index]:.{digits}f}"
    )


def _printed(base_T_flange: Array) -> Array:
    """The seven numbers of a pose: x y z w x y z."""
    return np.concatenate([base_T_flange[:3, 3], quaternion_from_rotation(base_T_flange[:3, :3])])


def _residuals(rest: Rest, numbers: Array) -> Array:
    """The view's residual (k, 6) if its pose were what these numbers (k, 7) say."""
    quaternions = numbers[:, 3:] / np.linalg.norm(numbers[:, 3:], axis=1, keepdims=True)
    poses = transform(rotation_from_quaternion(quaternions), numbers[:, :3])
    copies = rest.view.take(np.zeros(len(numbers), np.intp)).with_robot_poses(poses)
    return applied(copies, rest.fitted).residuals

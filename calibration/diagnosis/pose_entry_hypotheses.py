"""Hypotheses about a single wrong robot pose: the pose as a whole, or one of its seven numbers."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, apply_fit, fits, predict_base_T_flange
from calibration.diagnosis.hypothesis import Hypothesis, HypothesisResult, few_views_factor, price_of
from calibration.diagnosis.pose_errors import MAX_SMALL_CHANCE, p_value_of_view
from calibration.diagnosis.significance import NoisePosterior, OutsideView
from calibration.kinematics.robot_accuracy import postures_can_differ_by
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, quaternion_from_rotation, rotation_from_quaternion, transform

FREE_POSE = 6
NUMBERS = ("x", "y", "z", "q1 (w)", "q2 (x)", "q3 (y)", "q4 (z)")
MIN_PLAUSIBLE_P_VALUE = 1e-3
"""Least p value of a view for an explanation of it to be plausible."""

MIN_DISTANCE_GAP = 6.0
"""Least difference of squared distances by which one number explains the view and another does not."""

MAX_LEFT_SHARE = 0.5
"""Largest share of a view's squared distance that a lost sign leaves when most of it is said to be the sign's."""

MAX_ELEMENT_ERROR = 0.1
"""Largest error of a quaternion element; a larger one breaks the norm, and the pose is refused on reading."""

MIN_OTHER_POSTURE_RAD = float(np.radians(45.0))
"""Least difference of one of the axes 1 to 3 in another posture."""

STEPS = np.array([1e-2] * 3 + [1e-5] * 4)
"""Steps of the numeric derivatives, in mm and in quaternion elements."""


MAX_SUSPECTS = 4
"""Suspects that are examined: those without which the other views agree best."""


@dataclass(frozen=True, eq=False)
class HeldOutView:
    """One view against the fit of the others; `views`: the number of all views; `alone`: whether no other one has its
    posture, None where the joints are not known."""

    view: Evidence
    fitted: Fit
    outsider: OutsideView
    views: int
    alone: bool | None


@dataclass(frozen=True)
class _Candidate:
    """`misfit`: squared distance left by this explanation; `plausible`: whether noise explains that; `slope`: see
    `OutsideView.p_values_along`, None when the explanation is not a small change of one `number`."""

    misfit: float
    plausible: bool
    unknowns: int
    alternatives: int
    message: Sentence
    number: int | None = None
    slope: Array | None = None


def pose_entry_results(evidence: Evidence, suspects: Sequence[int], baseline: float) -> Iterator[HypothesisResult]:
    """Results for the most likely suspects: a wrong pose, or one wrong number if that explains the view."""
    n = len(evidence)
    remaining = [evidence.take(np.delete(np.arange(n), row)) for row in suspects]
    others = fits(remaining)
    views = [evidence.take(np.array([row])) for row in suspects]
    # The log-likelihood without a view's residual.
    without = [fitted.log_likelihood - 0.5 * _own(view, fitted) for view, fitted in zip(views, others, strict=True)]
    for suspect in np.argsort(without)[::-1][:MAX_SUSPECTS]:
        if few_views_factor(n, 0) * (without[suspect] - baseline) < price_of(n, 0, 7 * n):
            return  # no explanation of it could exceed its penalty, nor of the following ones
        view, fitted = views[suspect], others[suspect]
        posterior = NoisePosterior.of(fitted, remaining[suspect].by_camera)
        outsider = posterior.outside_view(apply_fit(view, fitted), view.by_camera)
        rest = HeldOutView(view, fitted, outsider, n, _is_alone(view, remaining[suspect]))
        numbers = [*_numbers(rest), *_signs(rest)]
        best = _best(rest, numbers)
        raw = without[suspect] - 0.5 * best.misfit - baseline
        gain = few_views_factor(n, best.unknowns) * raw - price_of(n, best.unknowns, best.alternatives)
        hypothesis = Hypothesis("pose-mistyped", (int(view.indices[0]),), view, view, best.message, FIX)
        slopes = np.array([number.slope for number in numbers if number.slope is not None])
        chance = partial(_p_value, rest, slopes, partial(p_value_of_view, evidence, fitted, suspects[suspect]))
        yield HypothesisResult(hypothesis, gain, fitted.robot_noise, chance)


FIX = Sentence("read-pose-again")


def _own(view: Evidence, fitted: Fit) -> float:
    return float(np.linalg.slogdet(apply_fit(view, fitted).covariance[0])[1])


def _p_value(rest: HeldOutView, slopes: Array, beside_posture: Callable[[], float]) -> float:
    """p value of the view, corrected for two tests (any change, one number) of every view.

    Where the joints are known and it is small, the larger one of that and of the p value beside errors that follow the
    posture: a view in a posture of its own is off by them. Poses do not show the posture.
    """
    by_number = 7 * rest.views * float(rest.outsider.p_values_along(slopes).min())
    off = rest.outsider.p_value_of(rest.outsider.residual)
    chance = min(2 * by_number, 2 * rest.views * off, 1.0)
    if chance > MAX_SMALL_CHANCE or rest.view.joints_rad is None:
        return chance
    return max(chance, min(2 * rest.views * beside_posture(), 1.0))


def _best(rest: HeldOutView, numbers: list[_Candidate]) -> _Candidate:
    """The one number that explains the view, if no other number does as well; else the pose as a whole."""
    by_price = sorted(numbers, key=lambda candidate: candidate.misfit + 2 * price_of(1, candidate.unknowns, 1))
    first = by_price[0]
    # A lost sign and a small error of the same element concern one number.
    second = next(candidate for candidate in by_price if candidate.number != first.number)
    alone = second.misfit > first.misfit + MIN_DISTANCE_GAP
    if alone and first.plausible:
        return first
    whole = _whole_pose(rest)
    is_sign = alone and first.unknowns == 0
    return _with_sign(rest, whole, first) if is_sign else whole


def _with_sign(rest: HeldOutView, whole: _Candidate, sign: _Candidate) -> _Candidate:
    """The pose as a whole, its message naming a lost sign that explains most of it: the view is off besides."""
    (as_given,) = rest.outsider.squares(rest.outsider.residual[None])
    if sign.misfit > MAX_LEFT_SHARE * as_given:
        return whole
    return replace(whole, message=Sentence("pose-mistyped-by-sign", **sign.message.params | {"pose": whole.message}))


def _whole_pose(rest: HeldOutView) -> _Candidate:
    where = int(rest.view.indices[0])
    expected = predict_base_T_flange(rest.view, rest.fitted, 0)
    off = expected[:3, 3] - rest.view.base_T_flange[0, :3, 3]
    turn = np.degrees(
        np.arccos(np.clip((np.trace(expected[:3, :3].T @ rest.view.base_T_flange[0, :3, :3]) - 1) / 2, -1, 1))
    )
    by_posture = postures_can_differ_by(float(np.linalg.norm(off)), np.radians(turn))
    sentence_id = BY_POSTURE[rest.alone] if by_posture else "pose-mistyped"
    message = Sentence(sentence_id, view=where, off_mm=np.linalg.norm(off), off_deg=turn)
    return _Candidate(0.0, True, FREE_POSE, rest.views, message)


BY_POSTURE = {None: "pose-mistyped-or-posture", True: "pose-mistyped-or-geometry", False: "pose-mistyped"}
"""What is said of a pose that is off by what postures differ by, by whether no other view has its posture."""


def _is_alone(view: Evidence, others: Evidence) -> bool | None:
    """Whether each other view has one of the axes 1 to 3 far from the view's; None where the joints are not known."""
    if view.joints_rad is None or others.joints_rad is None:
        return None
    apart = np.abs(view.joints_rad[:, :3] - others.joints_rad[:, :3]).max(axis=1)
    return bool(apart.min() > MIN_OTHER_POSTURE_RAD)


def _numbers(rest: HeldOutView) -> Iterator[_Candidate]:
    """Candidates in which one of the seven numbers is changed by what fits best, to first order."""
    given = _pose_numbers(rest.view.base_T_flange[0])
    stepped = _residuals(rest, np.concatenate([given[None], given + np.diag(STEPS)]))
    slopes = (stepped[1:] - stepped[0]) / STEPS[:, None]
    changes = rest.outsider.best_multiples(slopes)
    credible = (np.arange(7) < 3) | (np.abs(changes) < MAX_ELEMENT_ERROR)
    right = given + np.diag(np.where(credible, changes, 0.0))
    misfits, plausible = _remaining_misfits(rest, right)
    for index in np.flatnonzero(credible).tolist():
        message = _message(rest, given, right[index], index)
        yield _Candidate(misfits[index], plausible[index], 1, 7 * rest.views, message, index, slopes[index])


def _signs(rest: HeldOutView) -> Iterator[_Candidate]:
    """Candidates in which one of the quaternion's elements lost its sign."""
    given = _pose_numbers(rest.view.base_T_flange[0])
    right = given * (1 - 2 * np.eye(7)[3:])
    for index, (misfit, plausible) in enumerate(zip(*_remaining_misfits(rest, right), strict=True)):
        message = _message(rest, given, right[index], 3 + index)
        yield _Candidate(misfit, plausible, 0, 7 * rest.views, message, 3 + index)


def _remaining_misfits(rest: HeldOutView, numbers: Array) -> tuple[list[float], list[bool]]:
    """Squared distances of the view with these numbers (k, 7) as its pose, and whether each is plausible."""
    residuals = _residuals(rest, numbers)
    chances = [rest.outsider.p_value_of(residual) for residual in residuals]
    return rest.outsider.squares(residuals).tolist(), [chance > MIN_PLAUSIBLE_P_VALUE for chance in chances]


def _message(rest: HeldOutView, given: Array, right: Array, index: int) -> Sentence:
    return Sentence(
        "pose-length-mistyped" if index < 3 else "pose-element-mistyped",
        view=int(rest.view.indices[0]),
        name=NUMBERS[index],
        given=given[index],
        right=right[index],
    )


def _pose_numbers(base_T_flange: Array) -> Array:
    """The seven numbers of a pose: x y z w x y z."""
    return np.concatenate([base_T_flange[:3, 3], quaternion_from_rotation(base_T_flange[:3, :3])])


def _residuals(rest: HeldOutView, numbers: Array) -> Array:
    """The view's residuals (k, 6) with these numbers (k, 7) as its pose."""
    quaternions = numbers[:, 3:] / np.linalg.norm(numbers[:, 3:], axis=1, keepdims=True)
    poses = transform(rotation_from_quaternion(quaternions), numbers[:, :3])
    copies = rest.view.take(np.zeros(len(numbers), np.intp)).with_robot_poses(poses)
    return apply_fit(copies, rest.fitted).residuals

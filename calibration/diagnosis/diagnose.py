"""Test of all known causes of an inconsistent session, and choice of the one that explains it."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.closed_forms.observability import require_observable
from calibration.diagnosis.convention_hypotheses import (
    convention_hypotheses,
    inverted_or_other_setup,
    off_by_one_hypotheses,
    orientation_hypotheses,
    reading_hypotheses,
)
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, fit, likeliest_fit
from calibration.diagnosis.group_hypotheses import group_hypotheses
from calibration.diagnosis.hypothesis import Hypothesis, HypothesisResult, evaluate
from calibration.diagnosis.pairing_hypotheses import pairing_hypotheses
from calibration.diagnosis.picture_hypotheses import mirrored_hypothesis, turned_hypotheses, turned_instead
from calibration.diagnosis.pose_entry_hypotheses import pose_entry_results
from calibration.diagnosis.screening import is_unusual
from calibration.diagnosis.view_hypotheses import (
    CHANGE_CODES,
    CHANGES,
    MIN_VIEWS_PER_SIDE,
    board_turn_hypotheses,
    change_hypotheses,
    change_message,
    change_points,
    find_suspects,
    or_another_posture,
    pose_swap_hypotheses,
)
from calibration.diagnosis.wrapped_angles import wrapped_hypotheses
from calibration.errors import UndeterminedError
from calibration.kinematics.robot_accuracy import MAX_POSSIBLE_NOISE, RobotNoise
from calibration.transforms import Array

MIN_VIEWS = 5
"""Least views; with fewer, every view could be the wrong one."""

MAX_VIEWS = 50
"""More views are thinned to this many, keeping those that fit worst."""

REFINEMENT_STEPS = 10
"""Steps of each round of the search for the view of a change."""

MIN_LOG_LIKELIHOOD_GAIN = 8.0
"""Least gain of log-likelihood, after the penalty for alternatives, of a hypothesis without a p value.

In a clean session a likelihood ratio exceeds e^g with a probability below e^-g, whatever the alternative (Markov's
inequality: its mean is 1).
"""

MIN_LIKELIHOOD_RATIO = 10.0
"""The view of a change is named alone when it is this many times as likely as any other."""

FALSE_ALARM_PROBABILITY = 5e-4
"""Probability of naming a fault in a clean session, for each of four kinds (one pose, X changed, the target's pose
changed, the target's size) with all its alternatives. With the lens, a quarter of a percent of clean sessions."""

SINGLE_VIEW_CODES = frozenset({"pose-mistyped", "poses-swapped", "board-turned"})
"""Causes of one or two views, of which there may be several in a session."""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The best explanation and the runner-up with their gains, and the robot noise without and with it."""

    cause: Hypothesis
    gain: float
    runner_up: Hypothesis | None
    runner_up_gain: float
    before: RobotNoise
    after: RobotNoise


FurtherHypotheses = Callable[[Evidence], Iterable[Hypothesis]]


def diagnose(
    evidence: Evidence, target_centre_mm: Array, views: int, further: FurtherHypotheses = lambda _: ()
) -> Diagnosis | None:
    """The cause of the inconsistency; None when no known cause is significant.

    `target_centre_mm` (3,): the middle of the target, about which a board may have been turned; `views`: number of
    the session's rows, with those in which the target was not found; `further`: hypotheses besides those of all
    sessions.
    """
    if len(evidence) < MIN_VIEWS:
        return None
    # Wrong hypotheses may overflow; their likelihood is then too low to be chosen.
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        if _is_observable(evidence.base_T_flange):
            return _best_explanation(evidence, target_centre_mm, views, further)
        return _diagnose_convention(evidence, further)


def _diagnose_convention(evidence: Evidence, further: FurtherHypotheses) -> Diagnosis | None:
    """The diagnosis of motions that do not determine X: only another convention can be found."""
    sample = evidence.take(evenly_spaced(len(evidence), MAX_VIEWS))
    hypotheses = [
        hypothesis
        for hypothesis in (*reading_hypotheses(sample), *orientation_hypotheses(sample), *further(sample))
        if _is_observable(hypothesis.evidence.base_T_flange)
    ]
    uncorrected = likeliest_fit(sample)
    results = evaluate(hypotheses, sample, uncorrected)
    possible = [result for result in results if _is_possible(result, uncorrected, False)]
    return _diagnosis(uncorrected, [result for result in _best_of_each(possible) if _is_significant(result, 1, 1)])


def _best_explanation(
    evidence: Evidence, target_centre_mm: Array, views: int, further: FurtherHypotheses
) -> Diagnosis | None:
    few = evenly_spaced(len(evidence), MAX_VIEWS)
    suspects = find_suspects(evidence, few, fit(evidence.take(few)))
    rows = few if len(few) == len(evidence) else np.union1d(few, suspects.rows)
    sample = evidence.take(rows)
    uncorrected = fit(sample)
    among = np.searchsorted(rows, suspects.rows).tolist()
    hypotheses = [
        *convention_hypotheses(sample),
        *off_by_one_hypotheses(evidence),
        *pose_swap_hypotheses(sample, among, suspects.half),
        *board_turn_hypotheses(sample, among, target_centre_mm),
        *change_hypotheses(sample, change_points(len(sample))),
        *further(sample),
    ]
    if is_unusual(uncorrected):
        hypotheses += [
            *orientation_hypotheses(sample),
            *pairing_hypotheses(evidence, views),
            *group_hypotheses(evidence, sample),
            mirrored_hypothesis(sample),
            *turned_hypotheses(sample, change_points(len(sample))),
        ]
    results = [
        *evaluate(hypotheses, sample, uncorrected),
        *pose_entry_results(sample, among, uncorrected.log_likelihood),
    ]
    majority = suspects.half.robot_noise.is_within(MAX_POSSIBLE_NOISE)
    possible = [result for result in results if _is_possible(result, uncorrected, majority)]
    # The views left out of the sample count as alternatives.
    found = [result for result in _best_of_each(possible) if _is_significant(result, len(evidence), len(sample))]
    if not found and not uncorrected.robot_noise.is_within(MAX_POSSIBLE_NOISE):
        results = evaluate(list(wrapped_hypotheses(sample)), sample, uncorrected)
        possible = [result for result in results if _is_possible(result, uncorrected, False)]
        found = [result for result in _best_of_each(possible) if _is_significant(result, len(evidence), len(sample))]
    if found and (hypotheses_at := LOCATED.get(found[0].hypothesis.code)) is not None:
        if len(sample) < len(evidence):
            found[0], results = _locate(evidence, found[0], hypotheses_at)
        if found[0].hypothesis.code in CHANGE_CODES:
            found[0] = _with_alternative_views(found[0], results)
            found[0] = replace(found[0], hypothesis=turned_instead(found[0].hypothesis))
        if found[0].hypothesis.code in CHANGE_CODES:
            found[0] = replace(found[0], hypothesis=or_another_posture(found[0].hypothesis))
            found[1:] = [result for result in found[1:] if result.hypothesis.code != found[0].hypothesis.code]
    return _diagnosis(uncorrected, found)


def _is_observable(base_T_flange: Array) -> bool:
    """Whether the motions between these poses (n, 4, 4) determine X."""
    try:
        require_observable(base_T_flange)
    except UndeterminedError:
        return False
    return True


def _diagnosis(uncorrected: Fit, found: Sequence[HypothesisResult]) -> Diagnosis | None:
    """The diagnosis from results in descending order of their gain; the second is the runner-up."""
    if not found:
        return None
    best, *others = found
    if best.hypothesis.code == "poses-inverted":
        best = replace(best, hypothesis=inverted_or_other_setup(best.hypothesis))
    second, its_gain = (others[0].hypothesis, others[0].gain) if others else (None, -np.inf)
    return Diagnosis(best.hypothesis, best.gain, second, its_gain, uncorrected.robot_noise, best.robot_noise)


def _best_of_each(results: list[HypothesisResult]) -> list[HypothesisResult]:
    """The result with the largest gain for each code, in descending order."""
    best: dict[str, HypothesisResult] = {}
    for result in sorted((o for o in results if np.isfinite(o.gain)), key=lambda result: -result.gain):
        best.setdefault(result.hypothesis.code, result)
    return list(best.values())


def _is_significant(result: HypothesisResult, views: int, tried: int) -> bool:
    """Whether a result is significant, with the `views` that were not `tried` counted as alternatives."""
    left_out = views / tried
    gain = result.gain - np.log(left_out)
    if result.p_value is None:
        return bool(gain >= MIN_LOG_LIKELIHOOD_GAIN)
    return bool(gain > 0) and result.p_value() * left_out < FALSE_ALARM_PROBABILITY


def _is_possible(result: HypothesisResult, uncorrected: Fit, majority: bool) -> bool:
    """Whether the explanation lessens the disagreement, and leaves no more than a robot can err by.

    A wrong explanation, such as translations shrunk to nothing, may fit garbage better than the garbage fits. One of
    one or two views may leave more when a `majority` of the views agrees: others are then wrong as well.
    """
    left, given = result.robot_noise, uncorrected.robot_noise
    if left.translation_mm >= given.translation_mm and left.rotation_rad >= given.rotation_rad:
        return False
    return left.is_within(MAX_POSSIBLE_NOISE) or (majority and result.hypothesis.code in SINGLE_VIEW_CODES)


HypothesesAt = Callable[[Evidence, Sequence[int]], Iterable[Hypothesis]]

LOCATED: dict[str, HypothesesAt] = dict.fromkeys(CHANGE_CODES, change_hypotheses)
LOCATED |= {"pictures-turned": turned_hypotheses}
"""Hypotheses of a change at the given rows, by its code."""


def _locate(
    evidence: Evidence, found: HypothesisResult, hypotheses_at: HypothesesAt
) -> tuple[HypothesisResult, list[HypothesisResult]]:
    """The same change, located among all views by a search around the best one with a decreasing step, and the results
    of the last step."""
    n = len(evidence)
    row = int(np.flatnonzero(evidence.indices == found.hypothesis.where[0])[0])
    results = [found]
    gap = -(-n // MAX_VIEWS)
    while gap >= 1:
        step = max(1, gap // REFINEMENT_STEPS)
        near = np.arange(row - gap, row + gap + 1, step)
        near = near[(near >= MIN_VIEWS_PER_SIDE) & (near <= n - MIN_VIEWS_PER_SIDE)]
        rows = np.union1d(evenly_spaced(n, MAX_VIEWS), near)
        sample = evidence.take(rows)
        hypotheses = hypotheses_at(sample, np.searchsorted(rows, near).tolist())
        results = evaluate(
            [hypothesis for hypothesis in hypotheses if hypothesis.code == found.hypothesis.code], sample, fit(sample)
        )
        found = max(results, key=lambda result: result.gain)
        row = int(np.flatnonzero(evidence.indices == found.hypothesis.where[0])[0])
        gap = step if step > 1 else 0
    return found, results


def _with_alternative_views(best: HypothesisResult, results: Sequence[HypothesisResult]) -> HypothesisResult:
    """The same change, its message naming all views before which it may have happened."""
    hypothesis, limit = best.hypothesis, best.gain - np.log(MIN_LIKELIHOOD_RATIO)
    alike = {o.hypothesis.where[0] for o in results if o.hypothesis.code == hypothesis.code and o.gain > limit} - {
        hypothesis.where[0]
    }
    (change,) = (change for change in CHANGES[hypothesis.evidence.setup] if change.code == hypothesis.code)
    return replace(best, hypothesis=replace(hypothesis, message=change_message(change, [hypothesis.where[0], *alike])))


def evenly_spaced(n: int, most: int) -> NDArray[np.intp]:
    """At most `most` of n rows, evenly spaced."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).astype(np.intp))

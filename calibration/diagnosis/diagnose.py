"""Try the known causes one at a time, and name the one that explains an inconsistent session."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.diagnosis.convention_hypotheses import convention_trials, off_by_one_trials, reading_trials
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, fit, likeliest_fit
from calibration.diagnosis.hypothesis import Outcome, Trial, outcomes_of
from calibration.diagnosis.pose_entry_hypotheses import mistyped_outcomes
from calibration.diagnosis.view_hypotheses import (
    CHANGE_CODES,
    CHANGED,
    STRETCH,
    change_points,
    moved_message,
    moved_trials,
    suspects_of,
    swapped_trials,
    turned_trials,
)
from calibration.errors import UndeterminedError
from calibration.observability import require_observable
from calibration.transforms import Array

FEWEST_VIEWS = 5
"""With fewer, any one view can be blamed on the others."""

MOST_VIEWS = 50
"""More are thinned to this many, with the worst kept: what is wrong with all of them shows in these."""

AT_ONCE = 10
"""Steps in which the view of a change is closed in on."""

GAIN = 8.0
"""Log-likelihood, after paying for alternatives, that another reading of the same numbers must bring.

Under a clean session a likelihood ratio exceeds e^g with a chance below e^-g, whatever the alternative (Markov's
inequality: its mean is 1). Between different readings the chance is far smaller still.
"""

AS_LIKELY = 10.0
"""A view of a change is told alone when it is so many times likelier than any other."""

CHANCE = 5e-4
"""How often each of four kinds of fault (one pose, X changed, the target's pose changed, the target's size) may be
named in a clean session, all its alternatives together. With the lens's, a quarter of a percent of clean sessions."""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The best explanation, how consistent the session is without and with it, and the runner-up's gain."""

    cause: Trial
    gain: float
    runner_up: Trial | None
    runner_up_gain: float
    before_mm: float
    after_mm: float
    before_rad: float
    after_rad: float


def diagnose(evidence: Evidence, target_centre_mm: Array) -> Diagnosis | None:
    """What is wrong with the evidence; None when nothing known explains more than chance would."""
    if len(evidence) < FEWEST_VIEWS:
        return None
    # Wrong assumptions lead anywhere; what becomes of them is no number that could win.
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        if _determined(evidence.base_T_flange):
            return _best_explanation(evidence, target_centre_mm)
        return _another_reading(evidence)


def _another_reading(evidence: Evidence) -> Diagnosis | None:
    """Motions that determine nothing contradict nothing: what they can be is motions read in another convention."""
    sample = evidence.take(evenly(len(evidence), MOST_VIEWS))
    trials = [trial for trial in reading_trials(sample) if _determined(trial.evidence.base_T_flange)]
    as_it_came = likeliest_fit(sample)
    outcomes = _best_of_each(outcomes_of(trials, sample, as_it_came))
    return _diagnosis(as_it_came, [outcome for outcome in outcomes if outcome.gain >= GAIN])


def _best_explanation(evidence: Evidence, target_centre_mm: Array) -> Diagnosis | None:
    few = evenly(len(evidence), MOST_VIEWS)
    suspects = suspects_of(evidence, few, fit(evidence.take(few)))
    rows = few if len(few) == len(evidence) else np.union1d(few, suspects.rows)
    sample = evidence.take(rows)
    as_it_came = fit(sample)
    among = np.searchsorted(rows, suspects.rows).tolist()
    trials = [
        *convention_trials(sample),
        *off_by_one_trials(evidence),
        *swapped_trials(sample, among, suspects.half),
        *turned_trials(sample, among, target_centre_mm),
        *moved_trials(sample, change_points(len(sample))),
    ]
    outcomes = [
        *outcomes_of(trials, sample, as_it_came),
        *mistyped_outcomes(sample, among, as_it_came.log_likelihood),
    ]
    # The views that were left out are alternatives too.
    best_of_each = _best_of_each(outcomes)
    found = [outcome for outcome in best_of_each if _convinces(outcome, len(evidence), len(sample))]
    if found and found[0].trial.code in CHANGE_CODES:
        found[0] = _located(evidence, found[0]) if len(sample) < len(evidence) else _among(found[0], outcomes)
    return _diagnosis(as_it_came, found)


def _determined(base_T_flange: Array) -> bool:
    """Could X be found from the motions between these poses (n, 4, 4)?"""
    try:
        require_observable(base_T_flange)
    except UndeterminedError:
        return False
    return True


def _diagnosis(as_it_came: Fit, found: Sequence[Outcome]) -> Diagnosis | None:
    """The first outcome explains, the second is the runner-up."""
    if not found:
        return None
    best, *others = found
    return Diagnosis(
        best.trial,
        best.gain,
        others[0].trial if others else None,
        others[0].gain if others else -np.inf,
        as_it_came.robot_translation_mm,
        best.robot_translation_mm,
        as_it_came.robot_rotation_rad,
        best.robot_rotation_rad,
    )


def _best_of_each(outcomes: list[Outcome]) -> list[Outcome]:
    """Of each code the outcome that gains most; the best code first."""
    best: dict[str, Outcome] = {}
    for outcome in sorted((o for o in outcomes if np.isfinite(o.gain)), key=lambda outcome: -outcome.gain):
        best.setdefault(outcome.trial.code, outcome)
    return list(best.values())


def _convinces(outcome: Outcome, views: int, tried: int) -> bool:
    """Likelier than not, and beyond chance, with as many more alternatives as there are `views` not `tried`."""
    left_out = views / tried
    gain = outcome.gain - np.log(left_out)
    if outcome.chance is None:
        return bool(gain >= GAIN)
    return bool(gain > 0) and outcome.chance() * left_out < CHANCE


def _located(evidence: Evidence, found: Outcome) -> Outcome:
    """The same change, sought among the views that a sample had left out: around the best, ever finer."""
    n = len(evidence)
    row = int(np.flatnonzero(evidence.indices == found.trial.where[0])[0])
    gap = -(-n // MOST_VIEWS)
    while gap >= 1:
        step = max(1, gap // AT_ONCE)
        near = np.arange(row - gap, row + gap + 1, step)
        near = near[(near >= STRETCH) & (near <= n - STRETCH)]
        rows = np.union1d(evenly(n, MOST_VIEWS), near)
        sample = evidence.take(rows)
        trials = moved_trials(sample, np.searchsorted(rows, near).tolist())
        outcomes = outcomes_of([trial for trial in trials if trial.code == found.trial.code], sample, fit(sample))
        found = _among(max(outcomes, key=lambda outcome: outcome.gain), outcomes)
        row = int(np.flatnonzero(evidence.indices == found.trial.where[0])[0])
        gap = step if step > 1 else 0
    return found


def _among(best: Outcome, outcomes: Sequence[Outcome]) -> Outcome:
    """The same change, told with all the views before which it may have been nearly as well."""
    trial, limit = best.trial, best.gain - np.log(AS_LIKELY)
    alike = {o.trial.where[0] for o in outcomes if o.trial.code == trial.code and o.gain > limit} - {trial.where[0]}
    (change,) = (change for change in CHANGED[trial.evidence.setup] if change.code == trial.code)
    return replace(best, trial=replace(trial, message=moved_message(change, [trial.where[0], *alike])))


def evenly(n: int, most: int) -> NDArray[np.intp]:
    """At most so many of n rows, evenly spaced."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).astype(np.intp))

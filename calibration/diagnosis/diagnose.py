"""Try the known causes one at a time, and name the one that explains an inconsistent session."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calibration.diagnosis.conventions import convention_trials
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, fit
from calibration.diagnosis.mistyped import mistyped_outcomes
from calibration.diagnosis.trial import Outcome, Trial, outcome_of
from calibration.diagnosis.views import change_points, moved_trials, suspects_of, swapped_trials, turned_trials
from calibration.transforms import Array

FEWEST_VIEWS = 5
"""With fewer, any one view can be blamed on the others."""

GAIN = 12.0
"""Log-likelihood, after paying for unknowns and alternatives, that a cause must bring: odds of e^12."""


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
    as_it_came = fit(evidence)
    outcomes = sorted(_outcomes(evidence, as_it_came, target_centre_mm), key=lambda outcome: -outcome.gain)
    best = outcomes[0]
    if best.gain < GAIN:
        return None
    others = [outcome for outcome in outcomes if outcome.trial.code != best.trial.code]
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


def _outcomes(evidence: Evidence, as_it_came: Fit, target_centre_mm: Array) -> Iterator[Outcome]:
    for trial in convention_trials(evidence):
        same = trial.baseline is evidence
        baseline = as_it_came if same else fit(trial.baseline)
        yield outcome_of(trial, baseline.log_likelihood)
    suspects = suspects_of(evidence, as_it_came)
    before = as_it_came.log_likelihood
    for trial in swapped_trials(evidence, suspects):
        yield outcome_of(trial, before)
    for trial in turned_trials(evidence, suspects, target_centre_mm):
        yield outcome_of(trial, before)
    yield from _changes(evidence, before)
    yield from mistyped_outcomes(evidence, suspects, before)


def _changes(evidence: Evidence, before: float) -> Iterator[Outcome]:
    points = change_points(len(evidence))
    found = [outcome_of(trial, before) for trial in moved_trials(evidence, points)]
    yield from found
    if found and len(points) > 1 and (step := points[1] - points[0]) > 1:
        best = max(range(len(found)), key=lambda index: found[index].gain)
        middle = points[best // 2]
        near = [k for k in range(middle - step + 1, middle + step) if points[0] <= k <= points[-1] and k != middle]
        yield from (outcome_of(trial, before) for trial in moved_trials(evidence, near))

"""Try the known causes one at a time, and name the one that explains an inconsistent session."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calibration.diagnosis.conventions import convention_trials
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, fit
from calibration.diagnosis.mistyped import mistyped_outcomes
from calibration.diagnosis.trial import Outcome, Trial, outcomes_of
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
    suspects = suspects_of(evidence, as_it_came)
    points = change_points(len(evidence))
    trials = [
        *convention_trials(evidence),
        *swapped_trials(evidence, suspects),
        *turned_trials(evidence, suspects, target_centre_mm),
        *moved_trials(evidence, points),
    ]
    yield from outcomes_of(trials, evidence, as_it_came)
    yield from mistyped_outcomes(evidence, suspects, as_it_came.log_likelihood)

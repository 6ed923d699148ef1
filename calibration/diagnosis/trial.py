"""One suspected cause, applied to the evidence: what would have to be true, and what a person should do about it."""

from dataclasses import dataclass

import numpy as np

from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Labels, fit


@dataclass(frozen=True, eq=False)
class Trial:
    """The evidence as it would be without the fault, to be compared with `baseline`, the same images as they came.

    code, where : the cause, and the views (positions in the problem) it names.
    unknowns : free numbers the cause brings; alternatives : how many such trials there are. Both cost likelihood.
    bonus : log-likelihood the cause brings beside the fit (a change of measure).
    """

    code: str
    where: tuple[int, ...]
    evidence: Evidence
    baseline: Evidence
    message: str
    fix: str
    x_labels: Labels | None = None
    y_labels: Labels | None = None
    unknowns: int = 0
    alternatives: int = 1
    bonus: float = 0.0


@dataclass(frozen=True, eq=False)
class Outcome:
    """`gain` in log-likelihood after paying for unknowns and alternatives, and the robot noise that is left."""

    trial: Trial
    gain: float
    robot_translation_mm: float
    robot_rotation_rad: float


def outcome_of(trial: Trial, baseline_log_likelihood: float) -> Outcome:
    """Fit the trial and compare."""
    fitted = fit(trial.evidence, trial.x_labels, trial.y_labels)
    price = 0.5 * trial.unknowns * np.log(6 * len(trial.evidence)) + np.log(trial.alternatives)
    gain = fitted.log_likelihood + trial.bonus - baseline_log_likelihood - price
    return Outcome(trial, float(gain), fitted.robot_translation_mm, fitted.robot_rotation_rad)

"""One suspected cause, applied to the evidence: what would have to be true, and what a person should do about it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, Labels, fit, fits

TOGETHER = 2000
"""Views fitted at once: enough to make numpy's overhead small, few enough for the cache."""

SHARED = 12
"""Unknowns of every fit: X and the target's pose."""


@dataclass(frozen=True, eq=False)
class Trial:
    """The evidence as it would be without the fault, to be compared with `baseline`, the same images as they came.

    code, where : the cause, and the views (positions in the problem) it names.
    unknowns : free numbers the cause brings; alternatives : how many such trials there are. Both cost likelihood.
    bonus : log-likelihood the cause brings beside the fit (a change of measure).
    size : how large the target is under this cause, against what was said.
    test : from the evidence as it would be and the fit to it, how often chance does the same; None where the cause is
    another reading of the same numbers, which no chance turns into the other.
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
    size: float = 1.0
    test: Callable[[Evidence, Fit], float] | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """`gain` in log-likelihood after paying for unknowns and alternatives, and the robot noise that is left.

    `chance()`: how often a session without the fault would look as guilty of it; None as for the trial's test.
    """

    trial: Trial
    gain: float
    robot_translation_mm: float
    robot_rotation_rad: float
    chance: Callable[[], float] | None


def outcomes_of(trials: Sequence[Trial], evidence: Evidence, as_it_came: Fit) -> list[Outcome]:
    """Fit the trials, those of one shape together, and compare each with its baseline.

    `as_it_came` is the fit to the `evidence` that most trials start from; another baseline is fitted here.
    """
    fitted: dict[int, Fit] = {}
    for group in _groups(trials):
        chosen = [trials[index] for index in group]
        after = fits(
            [trial.evidence for trial in chosen],
            [trial.x_labels for trial in chosen],
            [trial.y_labels for trial in chosen],
        )
        fitted |= dict(zip(group, after, strict=True))
    each = as_it_came.log_likelihood / len(evidence)
    outcomes = []
    for index, trial in enumerate(trials):
        before = as_it_came.log_likelihood
        if trial.baseline is not evidence:
            # What is wrong with every view may keep this fit from settling where the other did.
            before = max(fit(trial.baseline).log_likelihood, each * len(trial.baseline))
        outcomes.append(_outcome(trial, fitted[index], before))
    return outcomes


def _outcome(trial: Trial, fitted: Fit, before: float) -> Outcome:
    n = len(trial.evidence)
    raw = fitted.log_likelihood + trial.bonus - before
    gain = few_views_factor(n, trial.unknowns) * raw - price_of(n, trial.unknowns, trial.alternatives)
    chance = None if trial.test is None else partial(_chance, trial.test, trial, fitted)
    return Outcome(trial, gain, fitted.robot_translation_mm, fitted.robot_rotation_rad, chance)


def _chance(test: Callable[[Evidence, Fit], float], trial: Trial, fitted: Fit) -> float:
    return min(trial.alternatives * test(trial.evidence, fitted), 1.0)


def price_of(n: int, unknowns: int, alternatives: int) -> float:
    """What free numbers cost (Schwarz, Annals of Statistics 6(2) 1978), and what having had a choice costs."""
    return float(0.5 * unknowns * np.log(6 * n) + np.log(alternatives))


def few_views_factor(n: int, unknowns: int) -> float:
    """By how much a likelihood ratio from n views exaggerates, because the noise is estimated from them too.

    Bartlett's correction of N log(1 + k F / D), with N = 6 n residuals of which X and the target's pose took 12
    (T. W. Anderson, An Introduction to Multivariate Statistical Analysis, 8.5).
    """
    return max(6 * n - SHARED - 1 - unknowns / 2, 1.0) / (6 * n)


def _groups(trials: Sequence[Trial]) -> list[list[int]]:
    """Trials with the same number of views and of labels, at most `TOGETHER` views in one."""
    by_shape: dict[tuple[int, bool, bool], list[int]] = {}
    for index, trial in enumerate(trials):
        shape = len(trial.evidence), trial.x_labels is None, trial.y_labels is None
        by_shape.setdefault(shape, []).append(index)
    groups = []
    for (views, _, _), members in by_shape.items():
        size = max(1, TOGETHER // views)
        groups += [members[start : start + size] for start in range(0, len(members), size)]
    return groups

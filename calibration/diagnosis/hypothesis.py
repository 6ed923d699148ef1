"""Hypotheses about the cause of an inconsistency, and their comparison with the evidence as it is."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, Labels, fit, fits

BATCH_VIEWS = 2000
"""Views fitted in one batch: enough to make numpy's overhead small, few enough for the cache."""

SHARED_UNKNOWNS = 12
"""Unknowns of every fit: X and the target's pose."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """The evidence corrected for a suspected cause, to be compared with `baseline`, the same images uncorrected.

    code, where : the cause, and the views (positions in the problem) it names.
    unknowns, alternatives : free parameters of the cause, and the number of such hypotheses; both are penalised.
    bonus : log-likelihood of the cause besides the fit (a change of measure).
    size : scale of the target under this cause.
    test : p value from the corrected evidence and the fit to it; None for another reading of the same numbers, which
        noise cannot imitate.
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
class HypothesisResult:
    """`gain` in log-likelihood less the penalties for unknowns and alternatives, and the robot noise that is left.

    `p_value()`: probability that a session without the fault appears as faulty; None without a test.
    """

    hypothesis: Hypothesis
    gain: float
    robot_translation_mm: float
    robot_rotation_rad: float
    p_value: Callable[[], float] | None


def evaluate(trials: Sequence[Hypothesis], evidence: Evidence, as_it_came: Fit) -> list[HypothesisResult]:
    """Fit the hypotheses, those of one shape together, and compare each with its baseline.

    `as_it_came`: the fit to `evidence`, the baseline of most hypotheses; other baselines are fitted here.
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
            # A fault of every view may keep this fit from reaching the other's optimum.
            before = max(fit(trial.baseline).log_likelihood, each * len(trial.baseline))
        outcomes.append(_result(trial, fitted[index], before))
    return outcomes


def _result(trial: Hypothesis, fitted: Fit, before: float) -> HypothesisResult:
    n = len(trial.evidence)
    raw = fitted.log_likelihood + trial.bonus - before
    gain = few_views_factor(n, trial.unknowns) * raw - price_of(n, trial.unknowns, trial.alternatives)
    chance = None if trial.test is None else partial(_p_value, trial.test, trial, fitted)
    return HypothesisResult(trial, gain, fitted.robot_translation_mm, fitted.robot_rotation_rad, chance)


def _p_value(test: Callable[[Evidence, Fit], float], trial: Hypothesis, fitted: Fit) -> float:
    return min(trial.alternatives * test(trial.evidence, fitted), 1.0)


def price_of(n: int, unknowns: int, alternatives: int) -> float:
    """Penalty for free parameters (Schwarz, Annals of Statistics 6(2) 1978) and for the number of alternatives."""
    return float(0.5 * unknowns * np.log(6 * n) + np.log(alternatives))


def few_views_factor(n: int, unknowns: int) -> float:
    """Factor that corrects a log-likelihood ratio from n views, from which the noise is estimated too.

    Bartlett's correction of N log(1 + k F / D), with N = 6 n residuals, 12 of them spent on X and the target's pose
    (T. W. Anderson, An Introduction to Multivariate Statistical Analysis, 8.5).
    """
    return max(6 * n - SHARED_UNKNOWNS - 1 - unknowns / 2, 1.0) / (6 * n)


def _groups(trials: Sequence[Hypothesis]) -> list[list[int]]:
    """Groups of indices of hypotheses with the same numbers of views and labels, at most BATCH_VIEWS views each."""
    by_shape: dict[tuple[int, bool, bool], list[int]] = {}
    for index, trial in enumerate(trials):
        shape = len(trial.evidence), trial.x_labels is None, trial.y_labels is None
        by_shape.setdefault(shape, []).append(index)
    groups = []
    for (views, _, _), members in by_shape.items():
        size = max(1, BATCH_VIEWS // views)
        groups += [members[start : start + size] for start in range(0, len(members), size)]
    return groups

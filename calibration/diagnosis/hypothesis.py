"""Hypotheses about the cause of an inconsistency, and their comparison with the evidence as it is."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import log

from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, Labels, fit, fits
from calibration.kinematics.robot_accuracy import RobotNoise

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
    whole_session : whether the cause changes all poses, by another reading or another order of them.
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
    whole_session: bool = False
    test: Callable[[Evidence, Fit], float] | None = None


@dataclass(frozen=True, eq=False)
class HypothesisResult:
    """`gain` in log-likelihood less the penalties for unknowns and alternatives, and the robot noise that is left.

    `p_value()`: probability that a session without the fault appears as faulty; None without a test.
    """

    hypothesis: Hypothesis
    gain: float
    robot_noise: RobotNoise
    p_value: Callable[[], float] | None


def evaluate(hypotheses: Sequence[Hypothesis], evidence: Evidence, uncorrected: Fit) -> list[HypothesisResult]:
    """Fit the hypotheses, those of one shape together, and compare each with its baseline.

    `uncorrected`: the fit to `evidence`, the baseline of most hypotheses; other baselines are fitted here.
    """
    fitted: dict[int, Fit] = {}
    for group in _groups(hypotheses):
        chosen = [hypotheses[index] for index in group]
        after = fits(
            [hypothesis.evidence for hypothesis in chosen],
            [hypothesis.x_labels for hypothesis in chosen],
            [hypothesis.y_labels for hypothesis in chosen],
        )
        fitted |= dict(zip(group, after, strict=True))
    each = uncorrected.log_likelihood / len(evidence)
    results = []
    for index, hypothesis in enumerate(hypotheses):
        before = uncorrected.log_likelihood
        if hypothesis.baseline is not evidence:
            # A fault of every view may keep this fit from reaching the other's optimum.
            before = max(fit(hypothesis.baseline).log_likelihood, each * len(hypothesis.baseline))
        results.append(_result(hypothesis, fitted[index], before))
    return results


def _result(hypothesis: Hypothesis, fitted: Fit, before: float) -> HypothesisResult:
    n = len(hypothesis.evidence)
    raw = fitted.log_likelihood + hypothesis.bonus - before
    gain = few_views_factor(n, hypothesis.unknowns) * raw - price_of(n, hypothesis.unknowns, hypothesis.alternatives)
    chance = None if hypothesis.test is None else partial(_p_value, hypothesis.test, hypothesis, fitted)
    return HypothesisResult(hypothesis, gain, fitted.robot_noise, chance)


def _p_value(test: Callable[[Evidence, Fit], float], hypothesis: Hypothesis, fitted: Fit) -> float:
    return min(hypothesis.alternatives * test(hypothesis.evidence, fitted), 1.0)


def price_of(n: int, unknowns: int, alternatives: int) -> float:
    """Penalty for free parameters (Schwarz, Annals of Statistics 6(2) 1978) and for the number of alternatives."""
    return 0.5 * unknowns * log(6 * n) + log(alternatives)


def few_views_factor(n: int, unknowns: int) -> float:
    """Factor that corrects a log-likelihood ratio from n views, from which the noise is estimated too.

    Bartlett's correction of N log(1 + k F / D), with N = 6 n residuals, 12 of them spent on X and the target's pose
    (T. W. Anderson, An Introduction to Multivariate Statistical Analysis, 8.5).
    """
    return max(6 * n - SHARED_UNKNOWNS - 1 - unknowns / 2, 1.0) / (6 * n)


def _groups(hypotheses: Sequence[Hypothesis]) -> list[list[int]]:
    """Groups of indices of hypotheses with the same numbers of views and labels, at most BATCH_VIEWS views each."""
    by_shape: dict[tuple[int, bool, bool], list[int]] = {}
    for index, hypothesis in enumerate(hypotheses):
        shape = len(hypothesis.evidence), hypothesis.x_labels is None, hypothesis.y_labels is None
        by_shape.setdefault(shape, []).append(index)
    groups = []
    for (views, _, _), members in by_shape.items():
        size = max(1, BATCH_VIEWS // views)
        groups += [members[start : start + size] for start in range(0, len(members), size)]
    return groups

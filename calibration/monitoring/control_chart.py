"""Control chart of a fixed target's centre in the base, for detecting drift of the cell since its calibration.

The chart is Lowry, Woodall, Champ and Rigdon's multivariate exponentially weighted moving average ("A Multivariate
Exponentially Weighted Moving Average Control Chart", Technometrics 34, 1992) of the centre, less its mean over the
first verifications. With weight w, after k points, noise s per axis and m points to learn from:

    z_k = w d_k + (1 - w) z_(k-1)                                                            their Eq. (2)
    var z_k = s² ( w / (2 - w) (1 - (1 - w)^2k) + (1 - (1 - w)^k)² / m )                     their Eq. (3), and the m
    alarm when |z_k| > allowed + sqrt(3 F var z_k),     F the quantile of F(3, dof) at 1 - p

False alarms of an average come in groups of about 1 / w, so p = 1 / (w runs_between_false_alarms).

s is not known beforehand: the scatter of a verification over its positions is an upper bound (it contains the error of
X as well), and the differences of successive verifications estimate it better the more there are. The newest
difference is left out, since it would contain the step to be detected.

A verification out of tolerance is learnt from nowhere: it enters neither reference nor average nor noise.

Apart from the chart, a verification disagrees with its calibration when the target scatters over the positions by more
than the calibration's uncertainty and the robot's noise explain.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Literal

import numpy as np
import scipy

from calibration.transforms import Array, nearest_rotation

PRIOR_DOF = 6.0
"""Degrees of freedom that the scatter counts for in the estimate of s; those of a few verifications."""

DOF_PER_DIFFERENCE = 2.0
"""Degrees of freedom of one difference: three axes, of which overlapping differences keep two thirds."""


@dataclass(frozen=True)
class DriftRules:
    """Parameters of the chart.

    weight : of the newest point in the moving average.
    learn : number of first verifications whose mean is the reference.
    allowed_mm : shift that is tolerated.
    runs_between_false_alarms : mean number of verifications of a steady cell between two, at least.
    """

    weight: float = 0.2
    learn: int = 5
    allowed_mm: float = 0.0
    runs_between_false_alarms: float = 1000.0

    @property
    def false_alarm_probability(self) -> float:
        """Probability that a point of a steady cell lies beyond the limit."""
        return min(0.5, 1.0 / (self.weight * self.runs_between_false_alarms))


@dataclass(frozen=True, eq=False)
class ChartSample:
    """One verification: the target's mean centre (3,) in the base, and its scatter.

    `scatter_mm`: standard deviation of the centre per axis, over `positions` positions.
    """

    centre_mm: Array
    scatter_mm: float
    positions: int
    within_tolerance: bool = True


DriftStanding = Literal["learning", "steady", "drifting", "out-of-tolerance"]
"""State of the chart: still learning its reference, within its limit, or beyond it; or a verification that says nothing
of drift, as it is out of tolerance."""


@dataclass(frozen=True, eq=False)
class ChartPoint:
    """One point of the chart: a verification's shift (3,), the moving average (3,), and the limit of its length."""

    standing: DriftStanding
    shift_mm: Array
    average_mm: Array
    limit_mm: float

    @property
    def drift_mm(self) -> float:
        """Length of the moving average: the estimated movement of the target."""
        return float(np.linalg.norm(self.average_mm))


def sample_of(points_anchor_mm: Array, points_target_mm: Array, middle_mm: Array) -> ChartSample:
    """The sample of points (positions, points, 3) in base or flange that lie at (points, 3) on the target.

    `middle_mm` (3,) on the target is the charted centre; it does not depend on which points were seen.
    """
    flat = points_target_mm - points_target_mm.mean(axis=0)
    centres = []
    for seen in points_anchor_mm:
        mean = seen.mean(axis=0)
        # Kabsch: the rotation nearest to the product of both; for a flat target, too.
        rotation, _ = nearest_rotation((seen - mean).T @ flat)
        centres.append(mean + rotation @ (middle_mm - points_target_mm.mean(axis=0)))
    spread = np.asarray(centres)
    scatter = float(np.sqrt(np.mean(np.var(spread, axis=0, ddof=1)))) if len(spread) > 1 else 0.0
    return ChartSample(spread.mean(axis=0), scatter, len(spread))


def chart(samples: Sequence[ChartSample], rules: DriftRules) -> list[ChartPoint]:
    """Every point of the chart; `samples` begin with the first verification after the calibration was activated.

    One that is out of tolerance has the average and the limit of the point before.
    """
    if not samples:
        return []
    learnt = [sample for sample in samples if sample.within_tolerance]
    reference = np.mean([sample.centre_mm for sample in (learnt or samples)[: rules.learn]], axis=0)
    last, drawn = ChartPoint("learning", np.zeros(3), np.zeros(3), float("inf")), _draw(learnt, rules)
    points = []
    for sample in samples:
        if sample.within_tolerance:
            last = next(drawn)
            points.append(last)
        else:
            shift = sample.centre_mm - reference
            points.append(ChartPoint("out-of-tolerance", shift, last.average_mm, last.limit_mm))
    return points


def _draw(samples: Sequence[ChartSample], rules: DriftRules) -> Iterator[ChartPoint]:
    """The points of samples within tolerance."""
    if not samples:
        return
    centres = np.array([sample.centre_mm for sample in samples])
    shifts = centres - centres[: rules.learn].mean(axis=0)
    variances, dofs = _noise(samples, centres)
    for shift in shifts[: rules.learn]:
        yield ChartPoint("learning", shift, np.zeros(3), float("inf"))
    average = np.zeros(3)
    for number in range(rules.learn, len(samples)):
        average = rules.weight * shifts[number] + (1 - rules.weight) * average
        limit = _limit_mm(number + 1 - rules.learn, float(variances[number]), float(dofs[number]), rules)
        standing: DriftStanding = "drifting" if float(np.linalg.norm(average)) > limit else "steady"
        yield ChartPoint(standing, shifts[number], average, limit)


def _limit_mm(since: int, variance: float, dof: float, rules: DriftRules) -> float:
    """Limit of the average's length, `since` verifications after the last of the reference."""
    forgotten = 1 - (1 - rules.weight) ** since
    of_average = rules.weight / (2 - rules.weight) * (1 - (1 - rules.weight) ** (2 * since))
    of_reference = forgotten**2 / rules.learn
    height = 3.0 * float(scipy.special.fdtri(3.0, dof, 1 - rules.false_alarm_probability))
    return rules.allowed_mm + sqrt(height * (of_average + of_reference) * variance)


def _noise(samples: Sequence[ChartSample], centres: Array) -> tuple[Array, Array]:
    """Variance (n,) of a verification's centre per axis and its degrees of freedom (n,), from those before each."""
    count = np.arange(len(samples))
    scatter = np.cumsum([0.0, *(s.scatter_mm**2 / max(s.positions, 1) for s in samples[:-1])])
    prior = scatter / np.maximum(count, 1)
    differences = np.cumsum([0.0, 0.0, *np.sum(np.diff(centres[:-1], axis=0) ** 2, axis=1)])[: len(samples)]
    known = np.maximum(count - 1, 0)
    from_differences = differences / (6 * np.maximum(known, 1))
    dof = DOF_PER_DIFFERENCE * known
    return (PRIOR_DOF * prior + dof * from_differences) / (PRIOR_DOF + dof), PRIOR_DOF + dof


def scatter_limit_mm(point_mm: float, robot_mm: float, positions: int, false_alarm_probability: float) -> float:
    """Largest scatter per axis that is explained by the calibration and the robot's noise at the target.

    `point_mm`: uncertainty of a measured point, `robot_mm`: the robot's noise, both over three axes together.
    """
    dof = 3.0 * (positions - 1)
    return sqrt((point_mm**2 + robot_mm**2) / 3 * float(scipy.special.chdtri(dof, false_alarm_probability)) / dof)

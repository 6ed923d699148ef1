"""Has the cell drifted since it was calibrated? A control chart of where a fixed target is seen.

The chart is Lowry, Woodall, Champ and Rigdon's multivariate exponentially weighted moving average ("A Multivariate
Exponentially Weighted Moving Average Control Chart", Technometrics 34, 1992) of the target's centre, less where it was
in the first verifications. With weight w, after k points, of noise s in each axis and m points to learn from:

    z_k = w d_k + (1 - w) z_(k-1)                                                            their Eq. (2)
    var z_k = s² ( w / (2 - w) (1 - (1 - w)^2k) + (1 - (1 - w)^k)² / m )                     their Eq. (3), and the m
    alarm when |z_k| > allowed + sqrt(3 F var z_k),     F the quantile of F(3, dof) at 1 - chance

False alarms of an average come in clumps of about 1 / w: chance = 1 / (w runs_between_false_alarms).

s is not known beforehand: the scatter of one verification over its positions bounds it from above (it holds X's own
error, too), the differences of successive verifications tell it better the more there are. The newest difference is
left out: a step must not hide itself.

Apart from the chart, one verification disagrees with its calibration when the target scatters over the positions by
more than the calibration's own uncertainty and the robot's noise explain.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from math import sqrt

import numpy as np
from scipy.special import chdtri, fdtri

from calibration.transforms import Array, nearest_rotation

PRIOR_DOF = 6.0
"""How many degrees of freedom the scatter counts for: as much as a few verifications."""

DOF_A_DIFFERENCE = 2.0
"""Three axes, of which overlapping differences keep two thirds."""


@dataclass(frozen=True)
class DriftRules:
    """How the chart is drawn; `runs_between_false_alarms` of a steady cell, at least."""

    weight: float = 0.2
    learn: int = 5
    allowed_mm: float = 0.0
    runs_between_false_alarms: float = 1000.0

    @property
    def chance(self) -> float:
        """Of a point of a steady cell to lie outside; such points come 1 / weight at a time."""
        return min(0.5, 1.0 / (self.weight * self.runs_between_false_alarms))


@dataclass(frozen=True, eq=False)
class Sample:
    """One verification: the target's centre (3,) in base as seen on average, and how it scatters over the positions.

    `scatter_mm`: standard deviation in one axis, over `positions` positions.
    """

    centre_mm: Array
    scatter_mm: float
    positions: int


class DriftStanding(Enum):
    """What the chart says."""

    LEARNING = "learning"
    STEADY = "steady"
    DRIFTING = "drifting"


@dataclass(frozen=True, eq=False)
class Entry:
    """One point of the chart: the shift (3,) of this verification, its moving average (3,), and how far that may go."""

    standing: DriftStanding
    shift_mm: Array
    average_mm: Array
    limit_mm: float

    @property
    def drift_mm(self) -> float:
        """How far the target seems to have moved."""
        return float(np.linalg.norm(self.average_mm))


def sample_of(points_base_mm: Array, points_target_mm: Array, middle_mm: Array) -> Sample:
    """From the target's points (positions, points, 3) as they lie in base, and (points, 3) on the target.

    `middle_mm` (3,) on the target: the same one whichever points are seen.
    """
    flat = points_target_mm - points_target_mm.mean(axis=0)
    centres = []
    for seen in points_base_mm:
        mean = seen.mean(axis=0)
        # Kabsch: the rotation nearest to the product of both; for a flat target, too.
        rotation, _ = nearest_rotation((seen - mean).T @ flat)
        centres.append(mean + rotation @ (middle_mm - points_target_mm.mean(axis=0)))
    spread = np.asarray(centres)
    scatter = float(np.sqrt(np.mean(np.var(spread, axis=0, ddof=1)))) if len(spread) > 1 else 0.0
    return Sample(spread.mean(axis=0), scatter, len(spread))


def chart(samples: Sequence[Sample], rules: DriftRules) -> list[Entry]:
    """Every point of the chart, from the first verification after a calibration was put into force."""
    if not samples:
        return []
    centres = np.array([sample.centre_mm for sample in samples])
    shifts = centres - centres[: rules.learn].mean(axis=0)
    variances, dofs = _noise(samples, centres)
    entries = [Entry(DriftStanding.LEARNING, shift, np.zeros(3), float("inf")) for shift in shifts[: rules.learn]]
    average = np.zeros(3)
    for number in range(rules.learn, len(samples)):
        average = rules.weight * shifts[number] + (1 - rules.weight) * average
        limit = _limit_mm(number + 1 - rules.learn, float(variances[number]), float(dofs[number]), rules)
        drifting = float(np.linalg.norm(average)) > limit
        standing = DriftStanding.DRIFTING if drifting else DriftStanding.STEADY
        entries.append(Entry(standing, shifts[number], average, limit))
    return entries


def _limit_mm(since: int, variance: float, dof: float, rules: DriftRules) -> float:
    """How far the average may go, `since` verifications after the last that was learnt from."""
    forgotten = 1 - (1 - rules.weight) ** since
    of_average = rules.weight / (2 - rules.weight) * (1 - (1 - rules.weight) ** (2 * since))
    of_reference = forgotten**2 / rules.learn
    height = 3.0 * float(fdtri(3.0, dof, 1 - rules.chance))
    return rules.allowed_mm + sqrt(height * (of_average + of_reference) * variance)


def _noise(samples: Sequence[Sample], centres: Array) -> tuple[Array, Array]:
    """(n,) variance of a verification's centre in one axis, and its degrees of freedom, as known before each one."""
    count = np.arange(len(samples))
    scatter = np.cumsum([0.0, *(s.scatter_mm**2 / max(s.positions, 1) for s in samples[:-1])])
    prior = scatter / np.maximum(count, 1)
    differences = np.cumsum([0.0, 0.0, *np.sum(np.diff(centres[:-1], axis=0) ** 2, axis=1)])[: len(samples)]
    known = np.maximum(count - 1, 0)
    told = differences / (6 * np.maximum(known, 1))
    dof = DOF_A_DIFFERENCE * known
    return (PRIOR_DOF * prior + dof * told) / (PRIOR_DOF + dof), PRIOR_DOF + dof


def scatter_limit_mm(point_mm: float, robot_mm: float, positions: int, chance: float) -> float:
    """The largest scatter in one axis that a calibration explains whose mapped point is known to `point_mm`.

    `point_mm` and `robot_mm` (the robot's noise at the target) are in three axes together.
    """
    dof = 3.0 * (positions - 1)
    return sqrt((point_mm**2 + robot_mm**2) / 3 * float(chdtri(dof, chance)) / dof)

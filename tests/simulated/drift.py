"""Verifications of a cell that drifts, simulated, and the alarms of its control chart.

Three positions, the robot's noise at the target normal in each axis, X's own error constant over the positions.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from calibration.monitoring.control_chart import ChartSample, DriftRules, chart
from calibration.transforms import Array

POSITIONS = 3

NOISE_MM = 0.05
"""Of one position, in one axis: the robot's and the picture's."""

OF_A_VERIFICATION_MM = NOISE_MM / POSITIONS**0.5

Drift = Callable[[Array], Array]
"""The true shift along one direction, by the number of verifications since the change."""


@dataclass(frozen=True)
class Cell:
    """`x_error_mm`: of X at the target, one axis, different from position to position."""

    x_error_mm: float

    def verifications(self, shift_mm: Array, rng: np.random.Generator) -> list[ChartSample]:
        """One for each of `shift_mm` (n,)."""
        own = rng.normal(0, self.x_error_mm, (POSITIONS, 3))
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        seen = own + rng.normal(0, NOISE_MM, (len(shift_mm), POSITIONS, 3)) + shift_mm[:, None, None] * direction
        scatter = np.sqrt(np.mean(np.var(seen, axis=1, ddof=1), axis=1))
        return [ChartSample(row.mean(axis=0), float(s), POSITIONS) for row, s in zip(seen, scatter, strict=True)]


def first_alarm(samples: list[ChartSample], rules: DriftRules, after: int = 0) -> int | None:
    """The number of the first alarm from number `after` on; None when there is none."""
    entries = chart(samples, rules)
    return next((n for n in range(after, len(entries)) if entries[n].standing == "drifting"), None)


def steady(cell: Cell, rules: DriftRules, cells: int, length: int, rng: np.random.Generator) -> tuple[float, int]:
    """Verifications a false alarm, over all cells (maximum likelihood of an exponential, cut at `length`); alarms."""
    watched = alarms = 0
    for _ in range(cells):
        found = first_alarm(cell.verifications(np.zeros(length), rng), rules)
        watched += length if found is None else found + 1
        alarms += found is not None
    return watched / max(alarms, 1), alarms


def delays(
    cell: Cell, rules: DriftRules, drift: Drift, cells: int, rng: np.random.Generator, before: int = 20
) -> tuple[Array, Array]:
    """Verifications until the alarm, and the true shift then in mm; 200 when it does not come."""
    numbers = np.arange(before + 200)
    shift_mm = np.where(numbers >= before, drift(numbers - before + 1.0), 0.0)
    waited, suffered = [], []
    for _ in range(cells):
        found = first_alarm(cell.verifications(shift_mm, rng), rules, after=before)
        at = len(numbers) - 1 if found is None else found
        waited.append(at - before + 1)
        suffered.append(shift_mm[at])
    return np.array(waited), np.array(suffered)


def step(shift_mm: float) -> Drift:
    """All at once."""
    return lambda since: np.full_like(since, shift_mm)


def ramp(mm_each: float) -> Drift:
    """So much more each verification."""
    return lambda since: mm_each * since

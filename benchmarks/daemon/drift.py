"""How seldom a steady cell raises a false drift alarm, and how soon a drift is found.

`python -m benchmarks.daemon.drift`

Simulated verifications: three positions, the robot's noise at the target normal in each axis, X's own error constant
over the positions. Delays are counted in verifications from the change to the alarm; what parts had suffered by then
is the true shift at the alarm. All lengths in units of one verification's noise in one axis, and in mm.
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from calibration.monitoring.control_chart import ChartSample, DriftRules, DriftStanding, chart
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
    return next((n for n in range(after, len(entries)) if entries[n].standing is DriftStanding.DRIFTING), None)


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


def main() -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.daemon.drift", description=__doc__)
    parser.add_argument("--cells", type=int, default=100)
    parser.add_argument("--length", type=int, default=2000, help="verifications of each steady cell")
    options = parser.parse_args()
    rng = np.random.default_rng(20261121)
    print(
        f"noise of one verification in one axis: {1e3 * OF_A_VERIFICATION_MM:.0f} µm; defaults of [drift] unless said"
    )
    print("\nsteady cell: verifications a false alarm (asked for: 1000)")
    for rules in (DriftRules(), DriftRules(learn=10), DriftRules(weight=0.1), DriftRules(weight=0.4)):
        for x_error_mm in (0.0, 0.1):
            length, alarms = steady(Cell(x_error_mm), rules, options.cells, options.length, rng)
            bound = "" if alarms else " or more"
            name = f"weight {rules.weight}, learn {rules.learn:2d}, X's error {x_error_mm:.1f} mm"
            print(f"  {name}: {length:7.0f}{bound}"
                  f"  ({alarms} of {options.cells} cells within {options.length})")  # fmt: skip
    changes: list[tuple[str, Drift]] = [
        (f"step of {k:g} noises ({k * OF_A_VERIFICATION_MM:.3f} mm)", step(k * OF_A_VERIFICATION_MM))
        for k in (2, 3, 5, 10)
    ]
    changes += [(f"ramp of {mm:.3f} mm a verification", ramp(mm)) for mm in (0.002, 0.005, 0.02)]
    print("\ndrift: verifications until the alarm (median, 90 %), and the true shift then (median)")
    for name, drift in changes:
        waited, suffered = delays(Cell(0.05), DriftRules(), drift, options.cells, rng)
        late = f"{np.quantile(waited, 0.9):.0f}"
        print(f"  {name:<38}{np.median(waited):5.0f}{late:>6}{np.median(suffered):9.3f} mm")
    return 0


if __name__ == "__main__":
    sys.exit(main())

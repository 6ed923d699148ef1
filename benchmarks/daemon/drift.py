"""False-alarm rate of a steady cell, and delay until a drift is detected.

`python -m benchmarks.daemon.drift`

Simulated verifications: three positions, the robot's noise per axis of the target's normal, X's own error constant over
the positions. Delays are numbers of verifications from the change to the alarm; the true shift at the alarm is what
parts suffered until then. All lengths in units of one verification's noise in one axis, and in mm.
"""

import argparse
import sys

import numpy as np

from calibration.monitoring.control_chart import DriftRules
from tests.simulated.drift import OF_A_VERIFICATION_MM, Cell, Drift, delays, ramp, steady, step


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

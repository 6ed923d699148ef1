"""How often a camera that warms up during a session is found, and a steady one is blamed.

`python -m benchmarks.diagnosis.warming`

Simulated sessions whose pictures shift by so many pixels, and whose views hold the camera's temperature. U is that of
the worst point, k = 2; the shift is the one that the finding names.
"""

import argparse
import sys

import numpy as np

from calibration.solve import solve_hand_eye
from tests.simulated.sessions import CellNoise, random_cell
from tests.simulated.warming import warmed

ROBOTS = {
    "0.05 mm, 0.005 degrees": CellNoise(),
    "0.2 mm, 0.02 degrees": CellNoise(0.1, float(np.radians(0.02)), 0.2),
}
SHIFTS_PX = (0.0, 1.0, 2.0, 4.0)


def main() -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.diagnosis.warming", description=__doc__)
    parser.add_argument("--sessions", type=int, default=20)
    parser.add_argument("--views", type=int, default=12)
    options = parser.parse_args()
    print(
        f"{options.views} views from 450 to 650 mm, about 0.23 mm/px; robot, shift: found, U (median), shift (median)"
    )
    for robot, noise in ROBOTS.items():
        for shift_px in SHIFTS_PX:
            named, expanded_mm = [], []
            for seed in range(options.sessions):
                cell = random_cell(np.random.default_rng(seed), options.views, noise)
                solution = solve_hand_eye(warmed(cell.problem, shift_px))
                if solution.uncertainty is not None:
                    expanded_mm.append(solution.uncertainty.worst_point.expanded_mm)
                named += [
                    finding.message.params["shift_px"]  # type: ignore[attr-defined]
                    for finding in solution.findings
                    if finding.code == "still-warming"
                ]
            found = f"{len(named)} of {options.sessions}"
            shift = f"{np.median(named):.1f} px" if named else "-"
            print(f"  {robot}, {shift_px:g} px: {found}, {np.median(expanded_mm):.2f} mm, {shift}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

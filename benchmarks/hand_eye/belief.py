"""`python -m benchmarks.hand_eye.belief [--seeds N] [--first SEED] [--views N ...] [--first-run]`

Whether U comes out as expected, and what a cell that knows its arm's noise gains. Planned views of cells in which
print, lens and arm are as described; low noise of the arm is 0.05 mm and 0.005 degrees, high noise four times that.

- got / expected: U of all views, over the one that was expected of them after all views but the last.
- third / ideal: U in the third run of a cell, which has learnt its noise in two, over U where the noise is known.
- third / before: the same over what was expected of it before its first view.

`--first-run` prints the first column alone, in a quarter of the time.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, product

import numpy as np

from calibration.kinematics.robot_accuracy import USUAL_BELIEF, NoiseBelief, RobotNoise
from calibration.likelihood.predicted_uncertainty import ExpectedNoise
from calibration.planning.expectation import expectation_of
from calibration.solution import Solution
from calibration.solve import estimate_hand_eye
from tests.simulated.described_wrongly import HIGH, LOW, planned_session, u_ratio
from tests.simulated.sessions import CellNoise

VIEWS = (4, 5, 6, 8)
LEVELS = {"low": LOW, "high": HIGH}
KNOWN_FACTOR = 1.05


def expanded_mm(solution: Solution) -> float:
    """U at the worst point, infinite without X."""
    return np.inf if solution.uncertainty is None else solution.uncertainty.worst_point.expanded_mm


def third_over_ideal_and_before(seed: int, views: int, noise: CellNoise) -> tuple[float, float]:
    """U after two earlier runs of the same arm, over U of the same views where its noise is known, and over what was
    expected of them before the first."""
    belief = USUAL_BELIEF
    for run in range(3):
        problem = replace(planned_session(3 * seed + run, views, noise), robot_noise=belief)
        solution = estimate_hand_eye(problem)
        belief = (solution.noise.belief or belief).for_next_run()
    true = RobotNoise(noise.robot_translation_mm, noise.robot_rotation_rad)
    known = replace(problem, robot_noise=NoiseBelief(true, (KNOWN_FACTOR, KNOWN_FACTOR), "stated"))
    assumed = ExpectedNoise(noise.image_px, *problem.robot_noise.median.levels().tolist())
    before = expectation_of(problem, solution, assumed, ())
    got_mm, expected_mm = expanded_mm(solution), before.expanded_mm
    return got_mm / expanded_mm(estimate_hand_eye(known)), got_mm / (np.nan if expected_mm is None else expected_mm)


def rows(views: Sequence[int], chosen: Sequence[int], *, learning: bool) -> Iterator[str]:
    """A line for each number of views and noise, then one for all: median and 90 % of the ratios of the seeds."""
    every = []
    for count, (name, noise) in product(views, LEVELS.items()):
        found: list[Sequence[float]] = [[u_ratio(seed, count, noise) for seed in chosen]]
        if learning:
            found += zip(*(third_over_ideal_and_before(seed, count, noise) for seed in chosen), strict=True)
        every.append(found)
        yield f"{count:5d} {name:>6s} {_quantiles(found)}"
    yield f"{'all':>5s} {'':>6s} {_quantiles([[*chain.from_iterable(one)] for one in zip(*every, strict=True)])}"


def _quantiles(columns: Sequence[Sequence[float]]) -> str:
    return " ".join(f"{np.median(one):11.2f} {np.quantile(one, 0.9):6.2f}" for one in columns)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--views", type=int, nargs="+", default=VIEWS)
    parser.add_argument("--first-run", action="store_true")
    given = parser.parse_args()
    heads = ("got / expected",) if given.first_run else ("got / expected", "third / ideal", "third / before")
    print(" " * 12 + "".join(f" {head:>18s}" for head in heads))
    print("views  noise " + " ".join([f"{'median   90 %':>18s}"] * len(heads)))
    for row in rows(given.views, range(given.first, given.first + given.seeds), learning=not given.first_run):
        print(row, flush=True)


if __name__ == "__main__":
    main()

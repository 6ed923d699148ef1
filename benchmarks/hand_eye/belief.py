"""`python -m benchmarks.hand_eye.belief [--seeds N] [--first SEED]`

Whether U comes out as expected, and what a cell that knows its arm's noise gains. Planned views of cells in which
print, lens and arm are as described; low noise of the arm is 0.05 mm and 0.005 degrees, high noise four times that.

- got / expected: U of all views, over the one that was expected of them after all views but the last.
- third / ideal: U in the third run of a cell, which has learnt its noise in two, over U where the noise is known.
- third / before: the same over what was expected of it before its first view.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from calibration.kinematics.robot_accuracy import USUAL_BELIEF, NoiseBelief, RobotNoise
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, predict
from calibration.planning.expectation import expectation_of
from calibration.planning.scene_belief import ScenePrior, infer_scene
from calibration.solution import Solution
from calibration.solve import estimate_hand_eye
from tests.simulated.described_wrongly import CAMERA, FAULTS, HIGH, LOW, WrongSession, wrong_session
from tests.simulated.sessions import CellNoise

VIEWS = (4, 5, 6, 8)
LEVELS = {"low": LOW, "high": HIGH}
KNOWN_FACTOR = 1.05


def session(seed: int, views: int, noise: CellNoise) -> WrongSession:
    """A session in front of the camera on the flange."""
    return wrong_session(np.random.default_rng(seed), views, FAULTS["none"], noise, "eye-in-hand", "planned")


def expanded_mm(solution: Solution) -> float:
    """U at the worst point, infinite without X."""
    return np.inf if solution.uncertainty is None else solution.uncertainty.worst_point.expanded_mm


def got_over_expected(seed: int, views: int, noise: CellNoise) -> float:
    """U of the last planned view over what was expected of it before it was taken."""
    problem = session(seed, views, noise).problem
    prior = ScenePrior(problem.setup, problem.target, CAMERA, None, None, at_median(noise.image_px, USUAL_BELIEF))
    belief = infer_scene(prior, replace(problem, views=problem.views[:-1]))
    expected = predict(belief.scene, np.array([view.base_T_flange for view in problem.views])).worst_point.expanded_mm
    return expanded_mm(estimate_hand_eye(problem)) / expected


def third_over_ideal_and_before(seed: int, views: int, noise: CellNoise) -> tuple[float, float]:
    """U after two earlier runs of the same arm, over U of the same views where its noise is known, and over what was
    expected of them before the first."""
    belief = USUAL_BELIEF
    for run in range(3):
        problem = replace(session(3 * seed + run, views, noise).problem, robot_noise=belief)
        solution = estimate_hand_eye(problem)
        belief = (solution.noise.belief or belief).for_next_run()
    true = RobotNoise(noise.robot_translation_mm, noise.robot_rotation_rad)
    known = replace(problem, robot_noise=NoiseBelief(true, (KNOWN_FACTOR, KNOWN_FACTOR), "stated"))
    before = expectation_of(problem, solution, at_median(noise.image_px, problem.robot_noise), ())
    got_mm, expected_mm = expanded_mm(solution), before.expanded_mm
    return got_mm / expanded_mm(estimate_hand_eye(known)), got_mm / (np.nan if expected_mm is None else expected_mm)


def at_median(image_px: float, belief: NoiseBelief) -> ExpectedNoise:
    """The noise expected before the first view."""
    return ExpectedNoise(image_px, belief.median.rotation_rad, belief.median.translation_mm)


def rows(seeds: int, first: int) -> Iterator[str]:
    """A line for each number of views and noise: median and 90 % of the ratios."""
    for views in VIEWS:
        for name, noise in LEVELS.items():
            chosen = range(first, first + seeds)
            got = [got_over_expected(seed, views, noise) for seed in chosen]
            ideal, before = zip(*(third_over_ideal_and_before(seed, views, noise) for seed in chosen), strict=True)
            found = (got, ideal, before)
            each = " ".join(f"{np.median(one):11.2f} {np.quantile(one, 0.9):6.2f}" for one in found)
            yield f"{views:5d} {name:>6s} {each}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    print(f"{'':12s} {'got / expected':>18s} {'third / ideal':>18s} {'third / before':>18s}")
    print("views  noise " + " ".join([f"{'median   90 %':>18s}"] * 3))
    for row in rows(given.seeds, given.first):
        print(row, flush=True)


if __name__ == "__main__":
    main()

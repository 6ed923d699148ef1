"""`python -m benchmarks.hand_eye.belief [--seeds N]`

Whether U comes out as expected, and what a cell that knows its arm's noise gains. Planned views of cells in which
print, lens and arm are as described; low noise of the arm is 0.05 mm and 0.005 degrees, high noise four times that.

- got / expected: U of all views, over the one that was expected of them after all views but the last.
- third / ideal: U in the third run of a cell, which has learnt its noise in two, over U where the noise is known.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from calibration.kinematics.robot_accuracy import USUAL_BELIEF, NoiseBelief, RobotNoise
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, predict
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
    image = ExpectedNoise(noise.image_px, USUAL_BELIEF.rms().rotation_rad, USUAL_BELIEF.rms().translation_mm)
    prior = ScenePrior(problem.setup, problem.target, CAMERA, None, None, image)
    belief = infer_scene(prior, replace(problem, views=problem.views[:-1]))
    expected = predict(belief.scene, np.array([view.base_T_flange for view in problem.views])).worst_point.expanded_mm
    return expanded_mm(estimate_hand_eye(problem)) / expected


def third_over_ideal(seed: int, views: int, noise: CellNoise) -> float:
    """U after two earlier runs of the same arm, over U of the same views where its noise is known."""
    belief = USUAL_BELIEF
    for run in range(3):
        problem = session(3 * seed + run, views, noise).problem
        solution = estimate_hand_eye(replace(problem, robot_noise=belief))
        belief = solution.noise.belief.for_next_run() if solution.noise.belief is not None else belief
    true = RobotNoise(noise.robot_translation_mm, noise.robot_rotation_rad)
    known = NoiseBelief(true, (KNOWN_FACTOR, KNOWN_FACTOR), "stated")
    return expanded_mm(solution) / expanded_mm(estimate_hand_eye(replace(problem, robot_noise=known)))


def rows(seeds: int) -> Iterator[str]:
    """A line for each number of views and noise: median and 90 % of both ratios."""
    ratios: tuple[Callable[[int, int, CellNoise], float], ...] = (got_over_expected, third_over_ideal)
    for views in VIEWS:
        for name, noise in LEVELS.items():
            found = [[one(seed, views, noise) for seed in range(seeds)] for one in ratios]
            both = " ".join(f"{np.median(one):11.2f} {np.quantile(one, 0.9):6.2f}" for one in found)
            yield f"{views:5d} {name:>6s} {both}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=30)
    given = parser.parse_args()
    print(f"{'':12s} {'got / expected':>18s} {'third / ideal':>18s}")
    print(f"views  noise {'median   90 %':>18s} {'median   90 %':>18s}")
    for row in rows(given.seeds):
        print(row, flush=True)


if __name__ == "__main__":
    main()

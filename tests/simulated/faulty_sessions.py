"""Sessions without a fault, into which the diagnosis' benchmark puts one: simulated ones, and parts of real ones."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from calibration.problem import Problem
from calibration.solve import estimate_session, solve_hand_eye
from calibration.transforms import transform
from tests.simulated.fault_kinds import Session
from tests.simulated.faults import SETUPS, Noise, poses_of, simulated_session, with_poses

REAL = ("ic_charuco", "ic_circles", "metric_1")
PART = 20
"""Views of a part of a real session."""


def simulated(rng: np.random.Generator) -> Session:
    """Noise of 0.02 to 0.5 px, up to 0.5 mm and 0.05 degrees; 6 to 30 views, either set-up."""
    noise = Noise(rng.choice([0.02, 0.1, 0.5]), *((0, 0), (0.05, 0.005), (0.5, 0.05))[rng.integers(3)])
    return Session(simulated_session(rng, int(rng.integers(6, 31)), noise, SETUPS[rng.integers(2)]), noise)


def part_of(problem: Problem, rng: np.random.Generator) -> Session:
    """At most 20 views of a real session, one after the other, numbered anew."""
    start = int(rng.integers(max(len(problem.views) - PART, 0) + 1))
    chosen = problem.views[start : start + PART]
    part = replace(problem, views=tuple(replace(view, index=index) for index, view in enumerate(chosen)))
    return Session(part, None)


def real_session(name: str) -> Problem | None:
    """Views that agree, the camera that fits, travel in units of the target as it is; None where no folder is.

    A slip of the pitch that undoes the session's own would be no fault.
    """
    from daemon.sessions.session_reader import load_problem, open_session

    root = Path(os.environ.get("HANDEYED_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))
    if not (root / name).is_dir():
        return None
    problem = load_problem(open_session(root / name))
    solution = solve_hand_eye(problem)
    agreeing = {result.index for result in solution.views if result.status != "rejected"}
    views = tuple(view for view in problem.views if view.index in agreeing)
    clean = replace(problem, views=views, camera=solution.camera)
    poses, size = poses_of(clean), estimate_session(problem).best.scale
    return with_poses(clean, transform(poses[:, :3, :3], poses[:, :3, 3] / size))

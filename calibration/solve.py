"""From a calibration session to X: `solve_hand_eye(problem) -> Solution`, pure and never raising for bad data."""

from calibration.problem import Problem
from calibration.solution import Noise, Observability, Solution


def solve_hand_eye(problem: Problem, method: str = "auto") -> Solution:
    """X, the target's pose, their uncertainty and what was found wrong with the input.

    `method`: "auto" (maximum likelihood) or a closed form's name. `Solution.mount_T_camera` is None, and a finding
    of severity "error" says why, when the session cannot determine X. Raises ValueError for an unknown method.
    """
    return Solution(
        setup=problem.setup,
        method=method,
        mount_T_camera=None,
        anchor_T_target=None,
        camera=problem.camera,
        camera_source="given" if problem.camera else "estimated",
        uncertainty=None,
        noise=Noise(None, None, None),
        views=(),
        observability=Observability(0, 0.0, 0.0, "all of it"),
        hold_out=None,
    )

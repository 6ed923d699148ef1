"""From a calibration session to X: `solve_hand_eye(problem) -> Solution`, pure and never raising for bad data."""

from dataclasses import replace

import numpy as np

from calibration.closed_forms.registry import CLOSED_FORMS
from calibration.diagnosis.explain import explained
from calibration.errors import UndeterminedError
from calibration.likelihood.augmented_model import widened
from calibration.observability import require_observable
from calibration.preprocessing.prepare import Prepared, prepare, with_real_target
from calibration.problem import Problem
from calibration.solution import Solution
from calibration.solver.initial_guess import Start, best_start
from calibration.solver.solution_builder import refused_solution, solution_of
from calibration.solver.systematic_error_check import assumptions, doubted, doubting_the_centre, shared_errors
from calibration.solver.target_scale_check import scale_error, with_scale
from calibration.solver.view_outliers import Selection, agreeing_rows, select

METHODS = ("auto", *CLOSED_FORMS)

MOST_ROUNDS = 3
"""Camera and target shape are estimated in turn, the camera with the robot's help; each round gains less."""

CONTRADICTORY = (
    "contradictory-input",
    "the robot's poses and the images contradict each other so much that no estimate of X exists",
    "check the poses' units, their convention and their order",
)
"""Numbers far from any cell break the arithmetic; which convention would mend them is for the diagnosis to say."""


def solve_hand_eye(problem: Problem, method: str = "auto") -> Solution:
    """X, the target's pose, their uncertainty and what was found wrong with the input.

    `method`: "auto" (maximum likelihood) or a closed form's name. `Solution.mount_T_camera` is None, and a finding
    of severity "error" says why, when the session cannot determine X. Raises ValueError for an unknown method.
    """
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}: one of {', '.join(METHODS)}")
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            prepared, start, selection = estimated(problem)
            solution = solution_of(problem, method, prepared, start, selection)
    except UndeterminedError as undetermined:
        return explained(problem, refused_solution(problem, method, undetermined))
    except (np.linalg.LinAlgError, ArithmeticError):
        return explained(problem, refused_solution(problem, method, UndeterminedError(*CONTRADICTORY)))
    return explained(problem, solution, prepared)


def estimated(problem: Problem) -> tuple[Prepared, Start, Selection]:
    """The session as it is best understood, where the estimate started, and the estimate. Raises UndeterminedError."""
    prepared = prepare(problem)
    used = agreeing_rows(prepared)
    if not np.all(used):
        require_observable(prepared.seen.base_T_flange[used])
    start = best_start(prepared.take(used))
    selection = select(prepared, used, start.chain, start.variances)
    wider = widened(prepared.take(selection.used).seen, selection.best)
    if share := scale_error(wider):
        prepared = with_scale(prepared, share)
        selection = _again(prepared, selection)
    if prepared.shape is not None and problem.camera is None:
        for _ in range(MOST_ROUNDS):
            prepared = with_real_target(replace(prepared, camera=selection.best.camera, scale=selection.best.scale))
            selection = _again(prepared, selection)
    if selection.best is not wider.best:
        wider = widened(prepared.take(selection.used).seen, selection.best)
    models = assumptions(prepared, wider)
    doubt, levels = shared_errors(prepared, selection, models)
    if doubt:
        prepared = doubted(prepared, doubt)
        selection = select(prepared, selection.used, selection.best.chain, levels)
        models = assumptions(prepared, widened(prepared.take(selection.used).seen, selection.best))
    return prepared, start, doubting_the_centre(prepared, selection, models)


def _again(prepared: Prepared, selection: Selection) -> Selection:
    return select(prepared, selection.used, selection.best.chain, selection.best.variances)

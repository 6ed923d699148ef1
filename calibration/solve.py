"""From a calibration session to X: `solve_hand_eye(problem) -> Solution`, pure and never raising for bad data."""

from calibration.closed_forms.registry import CLOSED_FORMS
from calibration.consistency.outliers import agreeing_rows, select
from calibration.errors import UndeterminedError
from calibration.observability import require_determined
from calibration.prepare import prepare
from calibration.problem import Problem
from calibration.results import refused_solution, solution_of
from calibration.solution import Solution
from calibration.starts import best_start

METHODS = ("auto", *CLOSED_FORMS)


def solve_hand_eye(problem: Problem, method: str = "auto") -> Solution:
    """X, the target's pose, their uncertainty and what was found wrong with the input.

    `method`: "auto" (maximum likelihood) or a closed form's name. `Solution.mount_T_camera` is None, and a finding
    of severity "error" says why, when the session cannot determine X. Raises ValueError for an unknown method.
    """
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}: one of {', '.join(METHODS)}")
    try:
        prepared = prepare(problem)
        used = agreeing_rows(prepared)
        require_determined(prepared.seen.base_T_flange[used])
        start = best_start(prepared.take(used))
        selection = select(prepared, used, start.chain, start.variances)
    except UndeterminedError as undetermined:
        return refused_solution(problem, method, undetermined)
    return solution_of(problem, method, prepared, start, selection)

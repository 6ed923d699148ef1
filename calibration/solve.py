"""Hand-eye calibration of a session: `solve_hand_eye(problem) -> Solution`; pure, does not raise for bad data."""

from dataclasses import dataclass, replace

import numpy as np

from calibration.closed_forms.observability import require_observable
from calibration.closed_forms.registry import CLOSED_FORMS
from calibration.diagnosis.explain import diagnose_solution
from calibration.diagnosis.plausibility import check_plausibility
from calibration.diagnosis.warming import warming_findings
from calibration.errors import UndeterminedError
from calibration.kinematics.external_axis import ExternalAxis
from calibration.knowledge import Knowledge
from calibration.likelihood.estimate import Estimate
from calibration.preprocessing.prepare import PreparedSession, at_given_lens, prepare_at_seen_lens, update_target_shape
from calibration.problem import Problem
from calibration.sentences.sentence import Sentence
from calibration.solution import Solution
from calibration.solver.effects import take_up_effects
from calibration.solver.external_axis import AxisFit, find_axis, fit_axis, readings_of
from calibration.solver.initial_guess import InitialGuess, find_initial_guess
from calibration.solver.shared_errors import fit_trend, widen_by_given, widen_by_shared_errors
from calibration.solver.solution_builder import build_solution, solution_without_x
from calibration.solver.view_outliers import Selection, agreeing_rows, select_views

METHODS = ("auto", *CLOSED_FORMS)

MAX_ROUNDS = 3
"""Rounds in which target shape and camera are estimated in turn, the camera with the robot's poses."""

CONTRADICTORY = ("contradictory-input", Sentence("no-estimate"), Sentence("check-pose-convention"))
"""Code, message and fix when numbers far from any cell break the arithmetic; the diagnosis may name the convention."""


@dataclass(frozen=True, eq=False)
class SessionEstimate:
    """All of one prepared session: its `start`, and in `selection` the views that agree with the estimate of them."""

    prepared: PreparedSession
    start: InitialGuess
    selection: Selection

    @property
    def best(self) -> Estimate:
        """The estimate itself."""
        return self.selection.best


def solve_hand_eye(problem: Problem, method: str = "auto") -> Solution:
    """X, the target's pose, their uncertainty and findings on the input.

    `method`: "auto" (maximum likelihood) or a closed form's name. When the session does not determine X,
    `Solution.mount_T_camera` is None and a finding of severity "error" names the reason. Raises ValueError for an
    unknown method, and for a closed form where the views measure the target in space.
    """
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}: one of {', '.join(METHODS)}")
    if problem.in_space and method != "auto":
        raise ValueError(f"{method!r} is for images: poses and points in space are solved by maximum likelihood")
    solution = _solve_in_space(problem) if problem.in_space else diagnose_solution(*_estimate_images(problem, method))
    solution = check_plausibility(poses_at_zero(problem, solution), solution)
    taken = {view.index: view for view in problem.views}
    views = tuple(
        replace(view, joints_rad=taken[view.index].stance.joints_rad,
                camera_temperature_c=taken[view.index].camera_temperature_c)
        for view in solution.views
    )  # fmt: skip
    return replace(
        solution,
        views=views,
        findings=(*solution.findings, *warming_findings(poses_at_zero(problem, solution), solution)),
    )


def estimate_hand_eye(problem: Problem) -> Solution:
    """As `solve_hand_eye` of images, without its diagnosis, which takes half of the time and may widen the uncertainty.

    For plans between two views; the result of a session is `solve_hand_eye`'s.
    """
    return _estimate_images(problem, "auto")[1]


def _estimate_images(problem: Problem, method: str) -> tuple[Problem, Solution, PreparedSession | None]:
    """The problem, with an external axis at its zero, and its solution; without the prepared session where X is not
    determined."""
    given, fit = problem.external_axis, None
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            if given is None:
                estimate = estimate_session(problem)
            else:
                problem, estimate, fit = _estimate_with_axis(problem, given)
            solution = build_solution(problem, method, estimate.prepared, estimate.start, estimate.selection)
            if given is not None and fit is not None:
                solution = replace(solution, external_axis=fit.estimate(given, solution))
    except UndeterminedError as undetermined:
        return problem, solution_without_x(problem, method, undetermined), None
    except (np.linalg.LinAlgError, ArithmeticError):
        return problem, solution_without_x(problem, method, UndeterminedError(*CONTRADICTORY)), None
    return problem, solution, at_given_lens(problem, estimate.prepared)


def _estimate_with_axis(problem: Problem, given: ExternalAxis) -> tuple[Problem, SessionEstimate, AxisFit]:
    """The problem with the axis at zero, its estimate, and the last step of the axis. Raises UndeterminedError."""
    readings, axis = readings_of(problem), find_axis(problem, given)
    for _ in range(MAX_ROUNDS):
        at_zero = problem.with_axis_at_zero(axis)
        estimate = estimate_session(at_zero)
        prepared, selection = estimate.prepared, estimate.selection
        fit = fit_axis(axis, readings[prepared.seen.positions], prepared, selection)
        if fit.settled:
            break
        axis = fit.axis
    return at_zero, replace(estimate, selection=selection.widened(fit.widening)), fit


def poses_at_zero(problem: Problem, solution: Solution) -> Problem:
    """The problem whose poses the solution is of: with its external axis at zero, where it has one."""
    found = solution.external_axis
    return problem if found is None else problem.with_axis_at_zero(found.axis)


def _solve_in_space(problem: Problem) -> Solution:
    """The solution of a session whose views measure the target in space; by maximum likelihood only."""
    # Imported here: images need none of it, and it takes a fifth of the time of importing this module.
    from calibration.diagnosis.measured import measured_evidence, measured_findings
    from calibration.pose_pairs.session import measured_without_x, solve_measured_session

    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            found = solve_measured_session(problem)
    except UndeterminedError as undetermined:
        found = measured_without_x(problem, undetermined)
    except (np.linalg.LinAlgError, ArithmeticError):
        found = measured_without_x(problem, UndeterminedError(*CONTRADICTORY))
    if found.seen is None:  # another unit
        return found.solution
    evidence = measured_evidence(problem, found.seen, found.covariance)
    used = {view.index for view in found.solution.views if view.status != "rejected"}
    causes = measured_findings(problem, evidence, used, drifting=found.drifting)
    return replace(found.solution, findings=(*found.solution.findings, *causes))


def estimate_session(problem: Problem, *, with_effects: bool = True) -> SessionEstimate:
    """The estimate of a session of images. Raises UndeterminedError.

    From the best closed form of the views that agree; then with the target's shape, with rare effects, with errors of
    the robot that follow its pose, and with its covariance widened by what all views may share. Errors of an arm may
    look like such effects: its identification leaves them out (`with_effects`).
    """
    prepared = prepare_at_seen_lens(problem)
    used = agreeing_rows(prepared)
    if not np.all(used):
        require_observable(prepared.seen.base_T_flange[used], offset_given=prepared.given is not None)
    start = find_initial_guess(prepared.take(used))
    estimate = SessionEstimate(prepared, start, select_views(prepared, used, start.chain, start.variances, prepared.z))
    if estimate.prepared.shaped and problem.camera is None:
        estimate = _with_target_shape(estimate, problem.knowledge)
    more = np.zeros((12, 12))
    if with_effects:
        prepared, selection, more = take_up_effects(estimate.prepared, estimate.selection)
        estimate = replace(estimate, prepared=prepared, selection=selection)
    trend = fit_trend(estimate.best)
    if trend is not None and trend.significant:
        best = estimate.best
        selection = select_views(
            estimate.prepared, estimate.selection.used, best.chain, trend.levels, best.z, trend=True
        )
        estimate = replace(estimate, selection=selection)
    selection = widen_by_given(widen_by_shared_errors(estimate.prepared, estimate.selection, trend)).widened(more)
    prepared, scale, found = estimate.prepared, selection.best.scale, selection.best.seen(estimate.prepared.seen)
    found = replace(found, points_mm=found.points_mm / scale)
    return replace(estimate, prepared=replace(prepared, scale=scale, seen_as_found=found), selection=selection)


def _with_target_shape(estimate: SessionEstimate, knowledge: Knowledge) -> SessionEstimate:
    """The target's shape and the camera estimated in turn, for a camera that is not given."""
    for _ in range(MAX_ROUNDS):
        best, used = estimate.best, estimate.selection.used
        prepared = update_target_shape(estimate.prepared, best, knowledge)
        selection = select_views(prepared, used, best.chain, best.variances, prepared.z)
        estimate = replace(estimate, prepared=prepared, selection=selection)
    return estimate

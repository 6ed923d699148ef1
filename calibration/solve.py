"""Hand-eye calibration of a session: `solve_hand_eye(problem) -> Solution`; pure, does not raise for bad data."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.closed_forms.observability import require_observable
from calibration.closed_forms.registry import CLOSED_FORMS
from calibration.diagnosis.explain import diagnose_solution
from calibration.diagnosis.plausibility import check_plausibility
from calibration.diagnosis.warming import warming_findings
from calibration.errors import GeometryError, UndeterminedError
from calibration.kinematics.abb_arms import ARMS
from calibration.kinematics.arm import Arm
from calibration.kinematics.arm_errors import AXES, ArmErrorModel, Postures, approach_sides
from calibration.kinematics.external_axis import ExternalAxis
from calibration.kinematics.joint_check import require_joints_of_each_view
from calibration.kinematics.load import NO_LOAD, SAME_SHARE, Load
from calibration.knowledge import Knowledge
from calibration.likelihood.estimate import Estimate
from calibration.preprocessing.prepare import PreparedSession, at_given_lens, prepare_at_seen_lens, update_target_shape
from calibration.problem import Problem
from calibration.sentences.sentence import Sentence, from_one
from calibration.solution import Solution
from calibration.solver.arm_hypotheses import SessionsContradict
from calibration.solver.arm_identification import ArmFit, UnusualArm, identify_arm
from calibration.solver.arm_session import KnownDistance, TargetViews
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
    return at_zero, replace(estimate, selection=fit.widen(selection)), fit


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


def estimate_session(problem: Problem) -> SessionEstimate:
    """The estimate of a session of images. Raises UndeterminedError.

    From the best closed form of the views that agree; then with the target's shape, with errors of the robot that
    follow its pose, and with its covariance widened by what all views may share.
    """
    prepared = prepare_at_seen_lens(problem)
    used = agreeing_rows(prepared)
    if not np.all(used):
        require_observable(prepared.seen.base_T_flange[used], offset_given=prepared.given is not None)
    start = find_initial_guess(prepared.take(used))
    estimate = SessionEstimate(prepared, start, select_views(prepared, used, start.chain, start.variances, prepared.z))
    if estimate.prepared.shaped and problem.camera is None:
        estimate = _with_target_shape(estimate, problem.knowledge)
    trend = fit_trend(estimate.best)
    if trend is not None and trend.significant:
        best = estimate.best
        selection = select_views(
            estimate.prepared, estimate.selection.used, best.chain, trend.levels, best.z, trend=True
        )
        estimate = replace(estimate, selection=selection)
    selection = widen_by_given(widen_by_shared_errors(estimate.prepared, estimate.selection, trend))
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


def identify_arm_session(arm: Arm, problems: Sequence[Problem], distances: Sequence[KnownDistance] = ()) -> ArmFit:
    """The arm's errors, X and their covariance from sessions of images: of one target, at a place for each session.

    `distances`: known ones between the target's places, which are counted as the problems are. All views hold joints.
    Raises UndeterminedError where a session does not determine X without errors of the arm, GeometryError for views
    without joints, of different loads or of one beyond the arm's payload, JointsDisagree for joints that are not this
    arm's, SessionsContradict for views that do not belong together, UnusualArm for errors that arms do not have.
    """
    load, found = _load_of(arm, problems), []
    for problem in problems:
        alone = estimate_session(_with_own_joints(arm, problem))
        seen, at = TargetViews(alone.prepared, alone.selection.used, alone.best), alone.prepared.seen.positions
        stood = np.array([view.stance.joints_rad for view in problem.views])
        celsius = np.array([view.arm_temperature_c for view in problem.views], float)  # NaN where it is not known
        found.append((seen, (stood[at], approach_sides(stood)[at], celsius[at])))  # it went from view to view
    order = sorted(range(len(found)), key=lambda row: -int(np.count_nonzero(found[row][0].used)))
    views, standstills = zip(*(found[row] for row in order), strict=True)
    known = [replace(one, first=order.index(one.first), second=order.index(one.second)) for one in distances]
    joints, sides, temperatures_c = (np.concatenate(parts) for parts in zip(*standstills, strict=True))
    mean_c = round(float(temperatures_c.mean()), 2)  # a step of 0.01 K moves no point by a micrometre
    warmth_k = None if np.isnan(mean_c) else temperatures_c - mean_c
    fit = identify_arm(ArmErrorModel(arm), views, Postures(joints, load or NO_LOAD, sides, warmth_k), known)
    if one := fit.contradiction:
        place = order[one.place]
        number = None if one.position is None else problems[place].views[one.position].index + 1
        raise SessionsContradict(one, place + 1, number)
    if unusual := fit.beyond_usual():
        raise UnusualArm(arm.name, unusual)
    return fit if warmth_k is None else replace(fit, temperature_c=mean_c)


def _load_of(arm: Arm, problems: Sequence[Problem]) -> Load | None:
    """What the flange carried in all of them, None where any of them does not state it. Raises GeometryError."""
    loads = [problem.load for problem in problems]
    known = [load for load in loads if load is not None]
    heaviest_kg = max((load.mass_kg for load in known), default=0.0)
    if arm.payload_kg is not None and heaviest_kg > (1 + SAME_SHARE) * arm.payload_kg:
        raise GeometryError(
            f"the sessions carried {heaviest_kg:g} kg, an {arm.name} carries {arm.payload_kg:g} kg: correct the load"
        )
    for other in known[1:]:
        if not other.is_as(known[0]):
            raise GeometryError(
                f"the sessions carried {known[0].mass_kg:g} and {other.mass_kg:g} kg, or another centre: the errors of"
                " an arm are identified with one load"
            )
    return known[0] if known and len(known) == len(loads) else None


def _with_own_joints(arm: Arm, problem: Problem) -> Problem:
    """The problem, whose views hold joints of that arm. Raises GeometryError, JointsDisagree."""
    joints = [view.stance.joints_rad for view in problem.views]
    without = [view.index for view, one in zip(problem.views, joints, strict=True) if one is None or len(one) != AXES]
    if without:
        what = f"pictures {from_one(without)} hold no joints of six axes, from which an arm's errors are identified"
        raise GeometryError(f"{what}: record joints_deg, or confdata, since a pose has several postures")
    poses, numbers = np.array([view.base_T_flange for view in problem.views]), [view.index for view in problem.views]
    require_joints_of_each_view(arm, np.array(joints), poses, ARMS, numbers)
    return problem

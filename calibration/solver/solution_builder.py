"""Assembly of a Solution from the estimate."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibration.closed_forms.observability import summarise_motion
from calibration.errors import UndeterminedError
from calibration.likelihood.estimate import Estimate
from calibration.likelihood.leave_out import base_errors, hold_out, leave_groups_out
from calibration.likelihood.nuisances import CENTRE, FOCAL
from calibration.likelihood.predicted_uncertainty import (
    observability_of,
    point_weights,
    uncertainty_of,
    working_points_mm,
)
from calibration.linear_algebra import covariance_of
from calibration.observations.observations import Observations, UnusableReason, observe
from calibration.observations.reprojection import pixel_residuals
from calibration.observations.view_poses import refine_poses
from calibration.preprocessing.prepare import PreparedSession
from calibration.problem import Problem
from calibration.sentences.sentence import Sentence, as_sentence
from calibration.solution import Finding, Noise, Observability, PointResiduals, Solution, ViewResult
from calibration.solver.closed_form import solve_closed_form
from calibration.solver.findings import method_findings, solver_findings
from calibration.solver.initial_guess import InitialGuess
from calibration.solver.view_outliers import Selection
from calibration.transforms import Array, map_points, transform


def build_solution(
    problem: Problem, method: str, prepared: PreparedSession, start: InitialGuess, selection: Selection
) -> Solution:
    """The solution of a session that determines X. Raises UndeterminedError when the closed form `method` fails."""
    findings = solver_findings(problem, prepared, start, selection)
    agreeing = selection.used
    closed_form = None if method == "auto" else solve_closed_form(prepared, selection, method)
    if closed_form is not None:
        selection = closed_form.selection
        findings += method_findings(method, prepared.take(selection.used))
    best, rows = selection.best, prepared.take(selection.used)
    own_poses = refine_poses(best.seen(rows.seen), best.camera, rows.camera_T_target)
    centre = problem.target.points_mm.mean(axis=0, keepdims=True)
    distance_mm = float(np.median(np.linalg.norm(map_points(own_poses, centre), axis=-1)))
    points_mm = working_points_mm(best.camera, distance_mm)
    covariance = best.step.covariance[:6, :6] if closed_form is None else closed_form.covariance
    weights, left_out = point_weights(points_mm), None
    if closed_form is None and np.all(np.isfinite(weights)):  # a camera may not see its working volume
        left_out = leave_groups_out(best, own_poses @ transform(np.eye(3), centre[0]), weights)
    if left_out is not None:
        # Of errors that all views share, for which the covariance is widened, nothing shows in views left out.
        covariance = covariance + (left_out.inflation - 1) * covariance_of(best.step.information)[:6, :6]
    distortion = prepared.nuisances.distortion  # of a given camera
    shown = distortion[1:] if closed_form is None and prepared.nuisances.shows_tangential else ()
    if shown and best.differs(shown) and best.differs(CENTRE):
        # A thin prism looks alike with another direction of the optical axis: as far as X moved it is uncertain.
        covariance = covariance + np.outer(moved := best.shift_of_x(shown), moved)
    lens_differs = any(part and best.differs(part) for part in (FOCAL, CENTRE, distortion))
    return Solution(
        setup=problem.setup,
        method=method,
        mount_T_camera=best.chain.mount_T_camera,
        anchor_T_target=best.chain.anchor_T_target,
        camera=best.camera,
        camera_source="estimated" if prepared.nuisances.estimated or lens_differs else "given",
        uncertainty=replace(uncertainty_of(covariance, best.chain.mount_T_camera, points_mm), arm_scale=best.arm_scale),
        noise=_noise(best),
        views=_views(problem, prepared, selection, agreeing, own_poses),
        observability=observability_of(problem.setup, rows.seen.base_T_flange, best.chain.mount_T_camera, covariance),
        hold_out=hold_out(rows.seen, best, own_poses) if closed_form is None else closed_form.hold_out,
        findings=findings,
        leave_out=left_out,
        axis_offset=None if prepared.given is None else prepared.given.offset,
        target_scale=best.scale,
    )


def solution_without_x(problem: Problem, method: str, why: UndeterminedError) -> Solution:
    """A solution without a transform, with the reason as its finding."""
    seen, refused = observe(problem)
    motion = summarise_motion(seen.base_T_flange)
    return Solution(
        setup=problem.setup,
        method=method,
        camera=problem.camera,
        camera_source="given" if problem.camera else "estimated",
        views=tuple(
            _without_numbers(problem, position, refused.get(position)) for position in range(len(problem.views))
        ),
        observability=Observability(len(seen), motion.max_rotation_rad, motion.axis_spread, why.what),
        findings=(Finding(why.code, "error", why.what, why.fix), *_missing_target(problem)),
    )


def _missing_target(problem: Problem) -> Iterator[Finding]:
    """At most one finding: the target was not found in most views, with the commonest reason."""
    reasons = Counter(view.missing for view in problem.views if view.detection is None and view.missing is not None)
    if 2 * reasons.total() > len(problem.views):
        (code, sentence), _ = reasons.most_common(1)[0]
        params = sentence.params if isinstance(sentence, Sentence) else {}
        found, why = len(problem.views) - reasons.total(), params.get("what", sentence)
        message = Sentence("target-unseen", found=found, views=len(problem.views), why=as_sentence(why))
        yield Finding(code, "error", message, params.get("fix", Sentence("compare-target")))


def _noise(best: Estimate) -> Noise:
    levels = best.variances
    image_px, rotation_rad, translation_mm = np.sqrt([levels.pixel, levels.rotation, levels.translation]).tolist()
    return Noise(image_px, rotation_rad, translation_mm, best.belief)


def _views(
    problem: Problem, prepared: PreparedSession, selection: Selection, agreeing: NDArray[np.bool_], own_poses: Array
) -> tuple[ViewResult, ...]:
    best, rows = selection.best, prepared.take(selection.used)
    real, predicted = best.seen(rows.seen), best.chain.camera_T_target()
    residuals = pixel_residuals(real, best.camera, predicted)
    errors = base_errors(real, best.chain.without_corrections(), own_poses)
    results = [_without_numbers(problem, position, why) for position, why in prepared.unusable.items()]
    for row in np.flatnonzero(~selection.used):
        reason = "beyond-the-first-three" if agreeing[row] else "pose-disagrees"
        results.append(_outlier_result(problem, prepared, int(row), best, reason))
    reprojection_px, base_error_mm = _rms(rows.seen, residuals), _rms(rows.seen, errors)
    for kept, position in enumerate(rows.seen.positions):
        view = problem.views[position]
        results.append(
            ViewResult(
                index=view.index,
                image=view.image,
                status="corrected" if rows.board_turned[kept] else "used",
                reason="board-turned" if rows.board_turned[kept] else None,
                reprojection_px=float(reprojection_px[kept]),
                base_error_mm=float(base_error_mm[kept]),
                robot_correction=(best.chain.corrections[kept, 3:], best.chain.corrections[kept, :3]),
                points=_points(real, kept, predicted[kept], residuals[kept]),
            )
        )
    return tuple(sorted(results, key=lambda result: result.index))


def _outlier_result(problem: Problem, prepared: PreparedSession, row: int, best: Estimate, reason: str) -> ViewResult:
    only = prepared.take(np.array([row]))
    chain = best.chain.for_poses(only.seen.base_T_flange)
    errors = base_errors(only.seen, chain, only.camera_T_target)
    residuals = pixel_residuals(only.seen, best.camera, chain.camera_T_target())
    correction = chain.with_corrections_from(only.camera_T_target).corrections[0]
    view = problem.views[only.seen.positions[0]]
    return ViewResult(
        index=view.index,
        image=view.image,
        status="rejected",
        reason=reason,
        reprojection_px=float(_rms(only.seen, residuals)[0]),
        base_error_mm=float(_rms(only.seen, errors)[0]),
        robot_correction=(correction[3:], correction[:3]),
        points=_points(only.seen, 0, chain.camera_T_target()[0], residuals[0]),
    )


def _points(seen: Observations, row: int, camera_T_target: Array, residuals: Array) -> PointResiduals:
    """The points of view `row` with their residuals (m, 2) at its pose (4, 4)."""
    there = seen.present[row] > 0
    distances_mm = map_points(camera_T_target, seen.points_mm[row, there])[:, 2]
    return PointResiduals(seen.pixels[row, there], residuals[there], distances_mm, seen.weights[row, there] > 0)


def _rms(seen: Observations, errors: Array) -> Array:
    """RMS (n,) over each view's used corners of errors (n, m, 2 or 3)."""
    used = seen.weights > 0
    squares = np.where(used, np.sum(errors * errors, axis=-1), 0.0)
    rms: Array = np.sqrt(squares.sum(axis=1) / np.count_nonzero(used, axis=1))
    return rms


def _without_numbers(problem: Problem, position: int, why: UnusableReason | None) -> ViewResult:
    view = problem.views[position]
    if why is None:
        return ViewResult(view.index, view.image, "used")
    return ViewResult(view.index, view.image, "rejected", why.code, why=why.what)

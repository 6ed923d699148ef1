"""Findings on what the solver changed in the input and what it assumed; `verdict` decides on acceptance."""

from collections.abc import Iterator, Sequence

import numpy as np

from calibration.closed_forms.observability import describe_direction
from calibration.closed_forms.three_pose import solve_three_pose
from calibration.kinematics.robot_accuracy import PRIOR_NOISE
from calibration.likelihood.estimate import Estimate
from calibration.likelihood.noise_marginalisation import MAX_PRIOR_VIEWS
from calibration.likelihood.nuisances import CENTRE, FOCAL
from calibration.likelihood.predicted_uncertainty import point_weights, working_points_mm
from calibration.observations.observations import IMAGE_REPEATED, STATION_REPEATED
from calibration.preprocessing.prepare import IMAGE_DISAGREES, PreparedSession
from calibration.problem import Problem
from calibration.sentences.sentence import Sentence
from calibration.solution import Finding, Severity
from calibration.solver.closed_form import THREE_POSE
from calibration.solver.effects import KINDS
from calibration.solver.initial_guess import InitialGuess
from calibration.solver.view_outliers import Selection

CONTRADICTING_SIGMA = 4.0
"""Deviation from a stated size, in standard deviations of statement and estimate together, that is named."""


def solver_findings(
    problem: Problem, prepared: PreparedSession, start: InitialGuess, selection: Selection
) -> tuple[Finding, ...]:
    """The solver's findings, in the order of its steps."""
    return (
        *_images(problem, prepared),
        *_target(prepared, selection),
        *_camera(prepared, selection),
        *_effects(prepared, selection),
        *_statements(problem, selection),
        *_trend(selection),
        *_axis_offset(problem, prepared),
        *_poses(problem, prepared, selection),
        *_estimate(prepared, start, selection),
    )


def _images(problem: Problem, prepared: PreparedSession) -> Iterator[Finding]:
    by_reason: dict[tuple[str, str], list[int]] = {}
    for position, why in sorted(prepared.unusable.items()):
        by_reason.setdefault((why.code, why.what), []).append(problem.views[position].index)
    for (code, what), indices in by_reason.items():
        repeated = {IMAGE_REPEATED: "take-new-images", STATION_REPEATED: "use-each-pose-once"}
        fix = Sentence({IMAGE_DISAGREES.code: "compare-target", **repeated}.get(code, "check-lighting"))
        severity: Severity = "warning" if code in repeated else "info"
        yield Finding(code, severity, Sentence("views-not-used", views=indices, why=what), fix)
    if left_out := int(np.count_nonzero((prepared.seen.weights == 0) & (prepared.seen.present > 0))):
        message = Sentence("corners-left-out", corners=left_out)
        yield Finding("corners-left-out", "info", message, Sentence("nothing-unless-many"))
    if np.any(prepared.board_turned):
        indices = [problem.views[position].index for position in prepared.seen.positions[prepared.board_turned]]
        message = Sentence("board-turned", views=indices)
        yield Finding("board-turned", "warning", message, Sentence("use-oriented-target"))


def _target(prepared: PreparedSession, selection: Selection) -> Iterator[Finding]:
    best, given = selection.best, prepared.nuisances
    in_plane_mm, out_of_plane_mm = given.shape_mm(best.z, prepared.nominal_mm)
    if prepared.shaped or best.differs(given.shape):
        yield Finding(
            "target-not-as-drawn",
            "info",
            Sentence("target-not-as-drawn", in_plane_mm=in_plane_mm, out_of_plane_mm=out_of_plane_mm),
            Sentence("print-flat"),
            effect_mm=_effect_mm(prepared, best, given.shape),
        )
    if best.differs([given.size]):
        share = best.scale - 1
        yield Finding(
            "target-scale",
            "error",
            Sentence("target-larger" if share > 0 else "target-smaller", percent=100 * abs(share)),
            Sentence("measure-pitch"),
            effect_mm=_effect_mm(prepared, best, [given.size]),
            sizes=(("print_scale_share", share),),
        )


def _effect_mm(prepared: PreparedSession, best: Estimate, places: Sequence[int]) -> float:
    """By how much a measured point has moved (RMS) with the nuisances at these places of z as found."""
    distance_mm = float(np.median(np.linalg.norm(prepared.camera_T_target[:, :3, 3], axis=1)))
    weights, moved = point_weights(working_points_mm(best.camera, distance_mm)), best.shift_of_x(places)
    return float(np.sqrt(moved @ weights @ moved))


def _camera(prepared: PreparedSession, selection: Selection) -> Iterator[Finding]:
    best, known = selection.best, prepared.nuisances
    if known.estimated:
        return
    right, down = best.z[list(CENTRE)]
    off = Sentence("distortion-off", px=float(np.linalg.norm(best.z[known.distortion])))
    focal = Sentence("focal-length-off", percent=100 * np.expm1(best.z[FOCAL[0]]))
    parts: tuple[tuple[Sequence[int], Severity, Sentence, str], ...] = (
        (FOCAL, "warning", focal, "calibrate-camera-in-focus"),
        (CENTRE, "info", Sentence("principal-point-off", right_px=right, down_px=down), "calibrate-camera"),
        (known.distortion, "warning", off, "calibrate-distortion"),
    )
    for places, severity, what, fix in parts:
        if best.differs(places):
            yield Finding(what.id, severity, what, Sentence(fix), effect_mm=_effect_mm(prepared, best, places))


def _effects(prepared: PreparedSession, selection: Selection) -> Iterator[Finding]:
    best, fixes = selection.best, {kind.code: kind.fix for kind in KINDS}
    first = len(best.z) - len(prepared.nuisances.effects)
    for place, code in enumerate(prepared.nuisances.effects, start=first):
        what, effect_mm = Sentence(code, mm=float(best.z[place])), _effect_mm(prepared, best, [place])
        yield Finding(code, "warning", what, Sentence(fixes[code]), effect_mm=effect_mm)


def _statements(problem: Problem, selection: Selection) -> Iterator[Finding]:
    """What was stated of the target's size or of the camera and the session contradicts."""
    best, stated, known = selection.best, problem.knowledge, selection.best.nuisances
    if known is None:
        return
    sigma, sized = stated.target.size_sigma, 12 + known.size
    if sigma is not None and stated.target.source != "printed":
        spread = float(np.hypot(sigma, np.sqrt(best.step.covariance[sized, sized])))
        if abs(best.z[known.size]) > CONTRADICTING_SIGMA * spread:
            yield Finding(
                "statement-contradicted",
                "warning",
                Sentence("size-contradicted", stated_percent=100 * sigma, percent=100 * (best.scale - 1)),
                Sentence("compare-pitch-and-arm"),
            )
    if stated.camera == "this-session" and not known.estimated and (best.differs(FOCAL) or best.differs(CENTRE)):
        yield Finding(
            "statement-contradicted", "warning", Sentence("camera-contradicted"), Sentence("calibrate-camera-in-focus")
        )


def _trend(selection: Selection) -> Iterator[Finding]:
    best = selection.best
    if best.model.trend_terms:
        rotation_rad, translation_mm = np.sqrt(best.trend_variances())
        message = Sentence("robot-trend", translation_mm=translation_mm, rotation_deg=np.degrees(rotation_rad))
        yield Finding("robot-trend", "info", message, Sentence("stay-near-work"))


def _axis_offset(problem: Problem, prepared: PreparedSession) -> Iterator[Finding]:
    """That one coordinate is as given and no view shows it, or that the motions determine it without."""
    offset, given = problem.axis_offset, prepared.given
    if offset is None:
        return
    if given is None:
        yield Finding("axis-offset-unused", "info", Sentence("axis-offset-unused"), Sentence("remove-axis-offset"))
        return
    in_mount = "flange" if problem.setup == "eye-in-hand" else "base"
    in_anchor = "base" if problem.setup == "eye-in-hand" else "flange"
    axis, frame = (given.axis_mount, in_mount) if offset.of == "camera" else (given.axis_anchor, in_anchor)
    yield Finding(
        "axis-offset-given",
        "info",
        Sentence(
            f"axis-offset-of-{offset.of}",
            axis=describe_direction(frame, axis),
            coordinate_mm=offset.coordinate_mm,
            sigma_mm=offset.sigma_mm,
        ),
        Sentence("measure-axis-offset"),
    )


def _poses(problem: Problem, prepared: PreparedSession, selection: Selection) -> Iterator[Finding]:
    positions = prepared.seen.positions
    if not np.all(selection.used):
        indices = [problem.views[position].index for position in positions[~selection.used]]
        message = Sentence("pose-disagrees", views=indices)
        yield Finding("pose-disagrees", "warning", message, Sentence("check-these-poses"))


def _estimate(prepared: PreparedSession, start: InitialGuess, selection: Selection) -> Iterator[Finding]:
    if start.other_optima:
        yield Finding(
            "starts-disagree",
            "error" if start.ambiguous else "warning",
            Sentence("starts-ambiguous" if start.ambiguous else "starts-disagree", methods=list(start.other_optima)),
            Sentence("add-larger-turns"),
        )
    if not selection.best.converged:
        yield Finding("not-converged", "error", Sentence("not-converged"), Sentence("look-for-odd-view"))
    if np.count_nonzero(selection.used) <= MAX_PRIOR_VIEWS:
        message = Sentence(
            "noise-assumed",
            views=np.count_nonzero(selection.used),
            translation_mm=PRIOR_NOISE.translation_mm,
            rotation_deg=np.degrees(PRIOR_NOISE.rotation_rad),
        )
        yield Finding("noise-assumed", "info", message, Sentence("take-eight-views"))


def method_findings(method: str, rows: PreparedSession) -> tuple[Finding, ...]:
    """Findings of a closed form on its own accuracy; only three-pose has one."""
    if method != THREE_POSE:
        return ()
    three_pose = solve_three_pose(rows.anchor_T_mount, rows.camera_T_target)
    angle_deg = np.degrees(three_pose.axis_angle_rad)
    message = Sentence("three-pose", distance=three_pose.distance_from_rotation, angle_deg=angle_deg)
    return (Finding("three-pose", "info", message, Sentence("use-auto")),)

"""Adds the findings of the diagnosis to a solution: `diagnose_solution(problem, solution)`."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calibration.camera import CameraModel
from calibration.diagnosis.diagnose import FALSE_ALARM_PROBABILITY, MAX_VIEWS, MIN_VIEWS, diagnose, evenly_spaced
from calibration.diagnosis.effect import MappedPoint
from calibration.diagnosis.evidence import Evidence, evidence_of, pixel_deviation, turn_pictures
from calibration.diagnosis.findings import diagnosis_findings, lens_findings, with_comparison
from calibration.diagnosis.fit import fit
from calibration.diagnosis.intrinsics_check import (
    LensMisfit,
    fits_better,
    free_camera,
    gross_lens_misfit,
    lens_misfit,
    scaled_lens_misfit,
)
from calibration.diagnosis.picture_hypotheses import TURNS_DEG
from calibration.diagnosis.screening import needs_diagnosis
from calibration.diagnosis.target_check import target_findings
from calibration.errors import UndeterminedError
from calibration.observations.observations import Observations, observe
from calibration.observations.reprojection import pixel_statistics
from calibration.observations.view_poses import candidate_poses, poses_by_lens, refine_poses
from calibration.preprocessing.prepare import IMAGE_DISAGREES, PreparedSession, prepare
from calibration.problem import Problem
from calibration.solution import COVERAGE_FACTOR, Finding, Solution, Uncertainty
from calibration.transforms import Array
from calibration.verdict import DEFAULT_VERDICT_LIMITS

MAX_TRANSLATION_MM = 1e9
"""mm: views with a larger coordinate of the robot's pose are ignored."""

MAX_LEFT_OUT_SHARE = 0.1
"""Share of the corners from which their places on the target are doubted."""

MAX_BENT_SHARE = 0.03
"""Deviation of points from the drawing, as a share of the target's diagonal, from which their places are doubted."""

MISPLACED_PX = 5.0
"""Pixel noise from which the target is doubted; wrong intrinsics and bent boards mostly leave less."""

MAX_USUAL_PX = 1.0
"""Pixel noise from which intrinsics are sought far from the given ones."""

MAX_STEP_SHARE = 0.1
"""Shift of the target over its distance from which intrinsics reached from the given ones may not be the best ones."""

MIN_SURE_SHARE = 0.5
"""Share of the pixels' deviation below which other intrinsics are believed without the robot's agreement."""

FLIPPED = frozenset({"pictures-mirrored", "pictures-turned"})
"""Causes with which the principal point of some pictures, or of all, is elsewhere."""

LENS_DEVIATIONS = frozenset(
    {"focal-length-off", "principal-point-off", "distortion-off", "lens-refocuses", "target-below-glass"}
)
"""The solver's findings that the lens, or what lies before the target, differs from the description."""

SHAPE_DEVIATION = "target-not-as-drawn"

OF_ANOTHER_SIZE = FLIPPED | {"intrinsics-do-not-fit", "target-not-as-described"}
"""Causes with which the target appears larger or smaller than it is."""

MAX_TURNED_RATIO = 2.0
"""Most pixel noise of a turned picture over that of the others, and least by which it fits better than as it is."""

MAX_SLIGHT_LENS_SHARE = 0.005
"""Shift of the target over its distance up to which a lens is slightly off, and any other cause is named before it."""

SOLVER_FINDINGS = {"wrong-pitch": "target-scale", "board-turned": "board-turned"}
"""Causes that the solver reports as well, with the code of its finding; the diagnosis adds its figures to that."""


def diagnose_solution(problem: Problem, solution: Solution, prepared: PreparedSession | None = None) -> Solution:
    """The solution with findings on the cause of an inconsistent input.

    `prepared`: the prepared session; None when the session does not determine X.
    """
    # Contradictory numbers may overflow in any hypothesis.
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        found = _findings_without_x(problem) if prepared is None else _findings_with_x(problem, solution, prepared)
    drop = set[str]()
    if any(f.code == "pictures-turned" for f in found):
        drop |= {"board-turned"}
    if prepared is not None and prepared.nuisances.effects:
        found = tuple(f for f in found if f.code != "wrong-pitch")  # the solver weighs a size against the effect
    if any(_gives_another_size(f) for f in found):
        # Seen through another lens, or with corners numbered otherwise, a target has another size, or a lens seems to.
        drop |= {"target-scale", *LENS_DEVIATIONS}
    beyond_mm = np.inf if solution.uncertainty is None else COVERAGE_FACTOR * solution.uncertainty.point_mm
    if any(f.code == "intrinsics-do-not-fit" and (f.effect_mm or 0.0) > beyond_mm for f in found):
        drop |= LENS_DEVIATIONS  # the estimate had to take up other errors of the lens with these
    solution = replace(solution, findings=tuple(f for f in solution.findings if f.code not in drop))
    if not found:
        return solution
    findings = _in_order(solution.findings, found)
    return replace(solution, findings=findings, uncertainty=_widen(solution.uncertainty, found))


def _gives_another_size(finding: Finding) -> bool:
    """Whether the target appears larger or smaller than it is; not through a lens that is another focus at most."""
    share = dict(finding.sizes).get("lens_share", np.inf)
    is_certain = finding.code in OF_ANOTHER_SIZE and finding.severity == "error"
    return is_certain and share > DEFAULT_VERDICT_LIMITS.lens_share


def _in_order(solver: Sequence[Finding], found: Sequence[Finding]) -> tuple[Finding, ...]:
    """The solver's findings with the figures of the diagnosis, then those that it adds.

    A size of the target comes after another cause: the diagnosis weighed it as well, and it often follows from that.
    """
    known = {finding.code for finding in solver}
    more = {SOLVER_FINDINGS[finding.code]: finding for finding in found if SOLVER_FINDINGS.get(finding.code) in known}
    extended = [with_comparison(finding, more[finding.code]) if finding.code in more else finding for finding in solver]
    added = [finding for finding in found if SOLVER_FINDINGS.get(finding.code) not in known]
    weighed = any(finding.code != "intrinsics-do-not-fit" for finding in added)
    return tuple(sorted((*extended, *added), key=lambda finding: weighed and finding.code == "target-scale"))


def _widen(uncertainty: Uncertainty | None, findings: Sequence[Finding]) -> Uncertainty | None:
    """The uncertainty with the effects of the findings counted, each as an expanded uncertainty (k = 2)."""
    effects = [finding.effect_mm for finding in findings if finding.effect_mm]
    if uncertainty is None or not effects or not uncertainty.point_mm > 0:
        return uncertainty
    more = float(np.sum(np.square(effects))) / (COVERAGE_FACTOR * uncertainty.point_mm) ** 2
    return uncertainty.scaled(float(np.sqrt(1 + more)))


def _findings_with_x(problem: Problem, solution: Solution, prepared: PreparedSession) -> tuple[Finding, ...]:
    camera, poses = prepared.camera, prepared.camera_T_target
    used = {view.index for view in solution.views if view.status != "rejected"}
    given = found = _with_turned_views(problem, prepared, camera, poses)
    differs = {finding.code for finding in solution.findings} & {*LENS_DEVIATIONS, SHAPE_DEVIATION}
    if differs and solution.camera is not None and prepared.seen_as_found is not None:
        estimated = replace(prepared, seen=prepared.seen_as_found)
        own_poses = poses_by_lens(estimated.seen, solution.camera, camera, poses)
        found = _with_turned_views(problem, estimated, solution.camera, own_poses)
    point = None if solution.mount_T_camera is None else MappedPoint(used, prepared.scale, camera, poses)
    another_target = tuple(target_findings(problem)) if _points_lie_elsewhere(prepared, poses) else ()
    if another_target:
        return another_target
    if scaled := _scaled_lens(problem):
        return scaled
    if np.any(prepared.board_turned):
        as_read = _diagnosis_findings(problem, _as_read(problem, prepared, poses), used, point)
        if any(finding.code in FLIPPED for finding in as_read):
            return as_read
    if found is not given:
        as_given = _diagnosis_findings(problem, given, used, point)
        if any(finding.code in FLIPPED for finding in as_given):
            return as_given  # such pictures bend the estimate of lens and target
    misfit = None if problem.camera is None else _lens_misfit(problem, prepared, poses)
    # Effects change the pictures as a slightly different lens does.
    if misfit is None or (prepared.nuisances.effects and misfit.share <= MAX_STEP_SHARE):
        return _diagnosis_findings(problem, found, used, point)
    as_found = _diagnosis_findings(problem, found, used, point)
    if not misfit.significant and not as_found:
        return ()
    if any(finding.code in FLIPPED for finding in as_found):
        return as_found  # other intrinsics fit since the principal point is elsewhere in such pictures
    fitting = _fitting_evidence(problem, prepared, misfit)
    beyond = misfit.share > MAX_STEP_SHARE or _fits_better(solution, prepared, misfit)
    if not beyond and differs == {SHAPE_DEVIATION}:
        return as_found  # it is the target that is not as described, and the lens need not be another one
    effect_mm = None
    if beyond and point is not None and solution.mount_T_camera is not None and misfit.share <= MAX_STEP_SHARE:
        effect_mm = point.shift_by_lens_mm(solution.mount_T_camera, fitting)
    if misfit.after_px > MIN_SURE_SHARE * misfit.before_px and not _agrees_better(fitting, given):
        # The pixels show the target's shape or the light: with those intrinsics the poses would be wrong.
        lens = lens_findings(misfit, camera, False, effect_mm) if misfit.significant else ()
        return (*as_found, *lens)
    still_wrong = _diagnosis_findings(problem, fitting, used, point)
    # A slight misfit is reported only when it explains everything.
    lens = lens_findings(misfit, camera, True, effect_mm) if misfit.significant or not still_wrong else ()
    flipped = any(finding.code in FLIPPED for finding in still_wrong)
    lens_first = misfit.share > MAX_SLIGHT_LENS_SHARE and not flipped
    return (*lens, *still_wrong) if lens_first else (*still_wrong, *lens)


def _fits_better(solution: Solution, prepared: PreparedSession, misfit: LensMisfit) -> bool:
    """Whether the intrinsics of the misfit fit better than the solution's own lens and target."""
    seen, camera = prepared.seen_as_found, solution.camera
    if seen is None or camera is None:
        return False
    return fits_better(misfit, seen, camera, prepared.camera_T_target, FALSE_ALARM_PROBABILITY)


def _fitting_evidence(problem: Problem, prepared: PreparedSession, misfit: LensMisfit) -> Evidence:
    """The evidence with the intrinsics that fit; with those far from the given ones that of a session without any,
    where other corners are outliers and the camera's errors are unknowns."""
    if misfit.share > MAX_STEP_SHARE:
        try:
            free = prepare(replace(problem, camera=None))
            return evidence_of(problem, free.seen, free.camera, free.camera_T_target, free.camera_covariance)
        except (UndeterminedError, np.linalg.LinAlgError, ArithmeticError):
            pass  # the views do not determine intrinsics by themselves
    drawn = replace(prepared.seen, points_mm=prepared.nominal_mm[prepared.seen.ids])
    return evidence_of(problem, drawn, misfit.camera, misfit.camera_T_target, misfit.covariance)


def _with_turned_views(problem: Problem, prepared: PreparedSession, camera: CameraModel, poses: Array) -> Evidence:
    """The evidence of the views at these poses (n, 4, 4) by that camera, and of those whose corners fit only turned.

    Where the principal point is off the middle, those are not used, and what remains may agree.
    """
    seen = prepared.seen
    refused = [position for position, why in prepared.unusable.items() if why.code == IMAGE_DISAGREES.code]
    if refused:
        every, _ = observe(problem)
        left_out = every.take(np.isin(every.positions, refused))
        as_seen, rms_px = candidate_poses(left_out, camera)
        most_px = MAX_TURNED_RATIO * pixel_deviation(pixel_statistics(seen, camera, poses))
        turned_px = [
            candidate_poses(turn_pictures(left_out, problem.image_size, np.radians(degrees)), camera)[1][:, 0]
            for degrees in TURNS_DEG
        ]
        fits = np.min(turned_px, axis=0) < np.minimum(most_px, rms_px[:, 0] / MAX_TURNED_RATIO)
        seen, poses = _join(seen, poses, left_out.take(fits), as_seen[fits, 0])
    return evidence_of(problem, seen, camera, poses, prepared.camera_covariance)


def _as_read(problem: Problem, prepared: PreparedSession, poses: Array) -> Evidence:
    """The evidence with the corners as they were numbered where they have been renumbered.

    A symmetric board in a picture turned by 180 degrees looks like one that was read the wrong way round.
    """
    seen, kept = prepared.seen, ~prepared.board_turned
    every, _ = observe(problem)
    read = every.take(np.isin(every.positions, seen.positions[prepared.board_turned]))
    seen, poses = _join(seen.take(kept), poses[kept], read, candidate_poses(read, prepared.camera)[0][:, 0])
    return evidence_of(problem, seen, prepared.camera, poses, prepared.camera_covariance)


def _join(seen: Observations, poses: Array, more: Observations, more_poses: Array) -> tuple[Observations, Array]:
    """Both with their poses (n, 4, 4), in the session's order."""
    seen, poses = seen.joined(more), np.concatenate([poses, more_poses])
    order = np.argsort(seen.positions)
    return seen.take(order), poses[order]


def _scaled_lens(problem: Problem) -> tuple[Finding, ...]:
    """The finding that the given intrinsics are those of pictures of another size; what else is wrong shows later."""
    seen, _ = observe(problem)
    misfit = scaled_lens_misfit(problem, seen)
    if misfit is None or problem.camera is None:
        return ()
    if misfit.after_px > MIN_SURE_SHARE * misfit.before_px:
        given = evidence_of(problem, seen, problem.camera, candidate_poses(seen, problem.camera)[0][:, 0])
        if not _agrees_better(evidence_of(problem, seen, misfit.camera, misfit.camera_T_target), given):
            return ()
    return lens_findings(misfit, problem.camera, agrees_better=True)


def _agrees_better(fitting: Evidence, given: Evidence) -> bool:
    """Whether robot and images agree better with other intrinsics: by the product of the robot's two noise levels."""
    return bool(np.prod(fit(fitting).variances) < np.prod(fit(given).variances))


def _points_lie_elsewhere(prepared: PreparedSession, poses: Array) -> bool:
    """Whether the corners fit so badly that they may be those of another target."""
    seen, deviation_mm = prepared.seen, np.hypot(*prepared.nuisances.shape_mm(prepared.z, prepared.nominal_mm))
    diagonal_mm = float(np.linalg.norm(np.ptp(prepared.nominal_mm, axis=0)))
    if deviation_mm > MAX_BENT_SHARE * diagonal_mm:
        return True
    left_out = np.count_nonzero((seen.weights == 0) & (seen.present > 0))
    if left_out > MAX_LEFT_OUT_SHARE * np.count_nonzero(seen.present):
        return True
    return pixel_deviation(pixel_statistics(seen, prepared.camera, poses)) > MISPLACED_PX


def _lens_misfit(problem: Problem, prepared: PreparedSession, poses: Array) -> LensMisfit | None:
    """The misfit of the given intrinsics; a wrong lens is preferred to a deviating target shape, being simpler."""
    as_seen = pixel_deviation(pixel_statistics(prepared.seen, prepared.camera, poses))
    drawn, as_shaped = prepared.seen, np.inf
    if prepared.shaped:
        drawn, as_shaped = replace(prepared.seen, points_mm=prepared.nominal_mm[prepared.seen.ids]), as_seen
        poses = refine_poses(drawn, prepared.camera, poses)
    misfit = lens_misfit(drawn, prepared.camera, poses, FALSE_ALARM_PROBABILITY, as_shaped)
    of_another_size = abs(prepared.scale - 1) > DEFAULT_VERDICT_LIMITS.print_scale_share
    if misfit is not None:
        is_far = misfit.share > MAX_STEP_SHARE
    else:  # other points of the target, or another size of it, may fit in place of a lens that no step reaches
        is_far = as_seen > MAX_USUAL_PX or of_another_size or prepared.shaped
    if not is_far:
        return misfit
    both = [found for found in (misfit, gross_lens_misfit(problem, drawn, as_shaped)) if found is not None]
    return min(both, key=lambda found: found.after_px, default=None)


def _findings_without_x(problem: Problem) -> tuple[Finding, ...]:
    """Findings of a session that does not determine X: another target, or another unit or convention of the poses."""
    seen, _ = observe(problem)
    another_target = tuple(target_findings(problem))
    if another_target or len(seen) < MIN_VIEWS:
        return another_target
    if problem.camera is not None:
        camera = problem.camera
    elif (found := free_camera(problem)) is not None:
        camera = found.camera
    else:
        return ()
    if scaled := _scaled_lens(problem):
        return scaled
    misfit = None if problem.camera is None else gross_lens_misfit(problem, seen)
    kept, lens = evenly_spaced(len(seen), MAX_VIEWS), tuple[Finding, ...]()
    if misfit is None or problem.camera is None:
        poses = candidate_poses(seen.take(kept), camera)[0][:, 0]
    else:
        # No intrinsics leave X undetermined: a unit or convention that does is named before them.
        lens = lens_findings(misfit, problem.camera, True)
        camera, poses = misfit.camera, misfit.camera_T_target[kept]
    return (*_diagnosis_findings(problem, evidence_of(problem, seen.take(kept), camera, poses), set()), *lens)


def _diagnosis_findings(
    problem: Problem, evidence: Evidence, used: set[int], point: MappedPoint | None = None
) -> tuple[Finding, ...]:
    evidence = evidence.take(np.max(np.abs(evidence.base_T_flange[:, :3, 3]), axis=1) < MAX_TRANSLATION_MM)
    if len(evidence) < MIN_VIEWS or not needs_diagnosis(evidence, fit(evidence)):
        return ()
    diagnosis = diagnose(evidence, problem.target.points_mm.mean(axis=0), problem.rows)
    if diagnosis is None:
        return ()
    return diagnosis_findings(diagnosis, used, None if point is None else point.shift_mm(diagnosis.cause))

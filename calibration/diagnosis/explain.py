"""From a solution to a solution that also says what is wrong with its input: `explained(problem, solution)`."""

from dataclasses import replace

import numpy as np

from calibration.camera import CameraModel
from calibration.diagnosis.diagnose import CHANCE, FEWEST_VIEWS, MOST_VIEWS, diagnose, evenly
from calibration.diagnosis.evidence import Evidence, evidence_of, pixel_deviation
from calibration.diagnosis.findings import compared, findings_of, lens_findings
from calibration.diagnosis.fit import fit
from calibration.diagnosis.intrinsics_check import LensMisfit, lens_misfit
from calibration.diagnosis.screening import suspicious
from calibration.diagnosis.target_check import target_findings
from calibration.errors import UndeterminedError
from calibration.intrinsics.estimate import estimate_camera
from calibration.observations.observations import observe
from calibration.observations.reprojection import pixel_statistics
from calibration.observations.view_poses import candidate_poses, refined_poses
from calibration.preprocessing.prepare import Prepared
from calibration.problem import Problem
from calibration.solution import Finding, Solution
from calibration.transforms import Array

LARGEST_NUMBER = 1e9
"""mm: a pose further away is no pose, and says nothing about the others."""

SAID_ALREADY = {"wrong-pitch": "target-scale", "board-turned": "board-turned"}
"""Causes that a solver's own finding tells as well; what the diagnosis measured is added to it."""


def explained(problem: Problem, solution: Solution, prepared: Prepared | None = None) -> Solution:
    """The solution with findings on why its input is inconsistent, when it is.

    `prepared`: the session as the solver understood it; None where it was refused before.
    """
    found = _refused(problem) if prepared is None else _solved(problem, solution, prepared)
    known = {finding.code for finding in solution.findings}
    more = {
        SAID_ALREADY[finding.code]: compared(finding) for finding in found if SAID_ALREADY.get(finding.code) in known
    }
    told = (
        replace(finding, message=f"{finding.message}. {more[finding.code]}") if finding.code in more else finding
        for finding in solution.findings
    )
    added = (finding for finding in found if SAID_ALREADY.get(finding.code) not in known)
    return replace(solution, findings=(*told, *added)) if found else solution


def _solved(problem: Problem, solution: Solution, prepared: Prepared) -> tuple[Finding, ...]:
    camera, seen, poses = prepared.camera, prepared.seen, prepared.camera_T_target.copy()
    poses[:, :3, 3] /= prepared.scale  # whether the target's size is wrong is for the diagnosis to find
    used = {view.index for view in solution.views if view.status != "rejected"}
    given = evidence_of(problem, seen, camera, poses)
    misfit = None if problem.camera is None else _lens_misfit(prepared, poses)
    if misfit is None:
        return _diagnosed(problem, given, used)
    if not misfit.matters and not _diagnosed(problem, given, used):
        return ()
    drawn = replace(seen, points_mm=prepared.drawn_mm[seen.ids])
    fitting = evidence_of(problem, drawn, misfit.camera, misfit.camera_T_target)
    still_wrong = _diagnosed(problem, fitting, used)
    # A slight misfit is worth a word when it is all that was wrong.
    return (*(lens_findings(misfit) if misfit.matters or not still_wrong else ()), *still_wrong)


def _lens_misfit(prepared: Prepared, poses: Array) -> LensMisfit | None:
    """A lens that is not as given looks like a target that is not as drawn: the simpler explanation first."""
    if prepared.shape is None:
        return lens_misfit(prepared.seen, prepared.camera, poses, CHANCE)
    as_shaped = pixel_deviation(pixel_statistics(prepared.seen, prepared.camera, poses))
    drawn = replace(prepared.seen, points_mm=prepared.drawn_mm[prepared.seen.ids])
    return lens_misfit(drawn, prepared.camera, refined_poses(drawn, prepared.camera, poses), CHANCE, as_shaped)


def _refused(problem: Problem) -> tuple[Finding, ...]:
    """Motions that determine nothing may be motions in another unit or convention, or the target be another one."""
    seen, _ = observe(problem)
    camera = problem.camera or _estimated(problem)
    another_target = tuple(target_findings(problem, camera))
    if another_target or camera is None or len(seen) < FEWEST_VIEWS:
        return another_target
    seen = seen.take(evenly(len(seen), MOST_VIEWS))
    return _diagnosed(problem, evidence_of(problem, seen, camera, candidate_poses(seen, camera)[0][:, 0]), set())


def _estimated(problem: Problem) -> CameraModel | None:
    detections = [view.detection for view in problem.views if view.detection is not None]
    few = [detections[row] for row in evenly(len(detections), MOST_VIEWS)]
    try:
        return estimate_camera(problem.target, few, problem.image_size).camera
    except UndeterminedError:
        return None


def _diagnosed(problem: Problem, evidence: Evidence, used: set[int]) -> tuple[Finding, ...]:
    evidence = evidence.take(np.max(np.abs(evidence.base_T_flange[:, :3, 3]), axis=1) < LARGEST_NUMBER)
    if len(evidence) < FEWEST_VIEWS or not suspicious(evidence, fit(evidence)):
        return ()
    diagnosis = diagnose(evidence, problem.target.points_mm.mean(axis=0))
    if diagnosis is None:
        return ()
    return findings_of(diagnosis, used)

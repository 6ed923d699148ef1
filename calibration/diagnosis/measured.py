"""Diagnosis of sessions whose views measure the target in space: also the camera's poses may be read wrongly."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from calibration.diagnosis.angle_agreement import angles_between
from calibration.diagnosis.convention_hypotheses import change_quaternion_order
from calibration.diagnosis.diagnose import MIN_VIEWS, diagnose
from calibration.diagnosis.evidence import Evidence, recorded_joints
from calibration.diagnosis.findings import diagnosis_findings
from calibration.diagnosis.fit import fit
from calibration.diagnosis.hypothesis import Hypothesis
from calibration.diagnosis.orientation_readings import READINGS, likely_readings
from calibration.diagnosis.screening import is_unusual, needs_diagnosis
from calibration.diagnosis.view_hypotheses import CHANGE_CODES
from calibration.observations.measured_poses import MeasuredViews
from calibration.problem import Problem
from calibration.sentences.sentence import Sentence
from calibration.solution import Finding
from calibration.transforms import Array, skew, transform

UNKNOWN_SIZE = "wrong-pitch"
"""Poses and points carry no size of the target; that of the camera's lengths is tested by the solver."""


def measured_evidence(problem: Problem, seen: MeasuredViews, covariance: Array) -> Evidence:
    """The evidence of measured views.

    `covariance` (n, 6, 6): of [rotation rad, translation of the target's origin mm].
    """
    poses = seen.camera_T_target
    # exp(z) turns about the camera's origin, not about the target's.
    about_camera = np.broadcast_to(np.eye(6), covariance.shape).copy()
    about_camera[:, 3:, :3] = skew(poses[:, :3, 3])
    covariance = about_camera @ covariance @ np.swapaxes(about_camera, 1, 2)
    indices = np.array([problem.views[position].index for position in seen.positions], np.intp)
    redundancy = np.full(len(seen), max(6.0 * len(seen) - 12, 1.0))
    joints_rad = recorded_joints(problem, seen.positions)
    return Evidence(problem.setup, indices, seen.base_T_flange, poses, covariance, redundancy, joints_rad)


def measured_findings(
    problem: Problem, evidence: Evidence, used: set[int], *, drifting: bool = False
) -> tuple[Finding, ...]:
    """At most one finding on the cause of an inconsistency; `used`: indices of the views of the solution.

    `drifting`: the camera's errors add up, so that a change of target or camera cannot be seen.
    """
    if len(evidence) < MIN_VIEWS or not needs_diagnosis(evidence, fit(evidence)):
        return ()
    centre = problem.target.points_mm.mean(axis=0)
    diagnosis = diagnose(evidence, centre, problem.rows, camera_pose_hypotheses)
    if diagnosis is None or diagnosis.cause.code == UNKNOWN_SIZE or (drifting and diagnosis.cause.code in CHANGE_CODES):
        return ()
    if diagnosis.cause.code == "setup-swapped":
        diagnosis = replace(diagnosis, cause=_inverted_or_other_setup(diagnosis.cause))
    return diagnosis_findings(diagnosis, used)


def _inverted_or_other_setup(swapped: Hypothesis) -> Hypothesis:
    """Inverted poses of the camera have the equations of the other setup, and equally long transforms."""
    return replace(
        swapped,
        code="camera-poses-inverted",
        message=Sentence("camera-poses-inverted", other=swapped.message),
        fix=Sentence("give-camera-T-target", other=swapped.fix),
    )


def camera_pose_hypotheses(evidence: Evidence) -> Iterator[Hypothesis]:
    """Other readings of the camera's poses of the target, where robot and camera disagree by more than is usual."""
    if not is_unusual(fit(evidence)):
        return
    seen = evidence.camera_T_target
    yield Hypothesis(
        "camera-quaternion-w-last",
        (),
        evidence.with_camera_poses(change_quaternion_order(seen)),
        evidence,
        Sentence("camera-quaternion-w-last"),
        Sentence("write-w-first"),
        whole_session=True,
    )
    yield from _orientations(evidence)


def _orientations(evidence: Evidence) -> Iterator[Hypothesis]:
    turns = angles_between(evidence.base_T_flange[:, :3, :3])
    for likely in likely_readings(evidence.camera_T_target[:, :3, :3], turns):
        reading = likely.reading
        baseline = evidence if len(likely.rows) == len(evidence) else evidence.take(likely.rows)
        poses = transform(likely.rotations, baseline.camera_T_target[:, :3, 3])
        yield Hypothesis(
            f"camera-{reading.code}",
            (),
            baseline.with_camera_poses(poses),
            baseline,
            Sentence("camera-reading", what=reading.message),
            reading.fix,
            alternatives=READINGS,
            whole_session=True,
        )

"""arm.json from sessions, and what a calibration's verdict has of it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calibration.documents.arm import ArmErrorsDocument, ArmParameterDocument
from calibration.documents.arm_conditions import LoadDocument
from calibration.documents.calibration import CalibrationFindingDocument
from calibration.documents.more_arm_views import (
    FurtherArmViewDocument,
    MoreArmViewsDocument,
    PointAfterViewsDocument,
)
from calibration.documents.pose import PoseDocument, round_vector
from calibration.errors import CalibrationError, GeometryError
from calibration.kinematics.arm import Arm
from calibration.kinematics.load import NO_LOAD
from calibration.problem import Problem
from calibration.sentences.sentence import Sentence, as_sentence
from calibration.solution import Finding
from calibration.targets import Target
from calibration.transforms import Array
from extensions.arm_identification.mathematics.identification import ArmFit, identify_arm_session
from extensions.arm_identification.mathematics.joints import joints_of_poses
from extensions.arm_identification.mathematics.more_views import MORE_VIEWS, plan_more_arm_views
from extensions.arm_identification.mathematics.session import CheckedDistance, KnownDistance

DISTANCE_DISAGREES = "distance-disagrees"
"""Code of the warning that a known distance is not the one found."""

MAX_DISTANCE_SIGMAS = 3.0
"""Standard deviations of both together by which they may differ: exceeded by chance in 3 of 1000."""


def identify_arm_document(
    arm: Arm,
    problems: Sequence[Problem],
    *,
    created_at: str,
    software: str,
    box_mm: Array | None = None,
    distances: Sequence[KnownDistance] = (),
) -> ArmErrorsDocument:
    """The errors of the arm from sessions of images, each with the target at another place.

    `box_mm` (2, 3) of the base: where `more_views` predicts registered points; without it, around those of the views.
    `distances`: known ones between the places, counted as the problems are.
    Views without joints get those of their poses and confdata. Raises as `identify_arm_session`, GeometryError for
    sessions without images or of a tool's poses without joints, UnreachablePoseError for poses out of reach.
    """
    if any(problem.in_space for problem in problems):
        raise GeometryError("the errors of an arm are identified from images only, this session holds poses or points")
    without = sum(view.stance.joints_rad is None for problem in problems for view in problem.views)
    whole = [_with_joints(arm, problem) for problem in problems]
    fit = identify_arm_session(arm, whole, distances)
    joints = np.degrees(np.array([view.stance.joints_rad for problem in whole for view in problem.views]))
    sigmas = np.sqrt(np.diagonal(fit.covariance)[6:])
    return ArmErrorsDocument(
        arm=fit.model.arm.identifier, created_at=created_at, software=software, setup=problems[0].setup,
        taken_up=fit.taken_up, log_evidence=fit.log_evidence, ladder=list(fit.ladder),
        mount_T_camera=PoseDocument.of(fit.mount_T_camera),
        parameters=[
            ArmParameterDocument(
                name=one.name, group=one.group, axis=one.axis, unit=one.unit, value=float(value), sigma=float(sigma)
            )
            for one, value, sigma in zip(fit.model.parameters, fit.parameters, sigmas, strict=True)
        ],
        covariance=fit.covariance.tolist(),
        scatter_mm=float(np.sqrt(fit.variances.translation)),
        scatter_deg=float(np.degrees(np.sqrt(fit.variances.rotation))),
        views=len(joints), joints_from_poses=without, places=len(problems),
        load=None if fit.load == NO_LOAD else LoadDocument(**vars(fit.load)), temperature_c=fit.temperature_c,
        lowest_joints_deg=tuple(joints.min(axis=0).tolist()), highest_joints_deg=tuple(joints.max(axis=0).tolist()),
        more_views=more_arm_views_document(fit, problems[0].target, box_mm),
        findings=[CalibrationFindingDocument.of(finding) for finding in disagreements(fit.distances)],
    )  # fmt: skip


def more_arm_views_document(fit: ArmFit, target: Target, box_mm: Array | None = None) -> MoreArmViewsDocument | None:
    """As `plan_more_arm_views`, after 10, 20 and 30 views, or all that are possible if fewer."""
    planned = plan_more_arm_views(fit, target, box_mm)
    if planned is None:
        return None
    counts = sorted({min(count, len(planned.after_mm)) for count in MORE_VIEWS})
    return MoreArmViewsDocument(
        box_mm=(round_vector(planned.box_mm[0]), round_vector(planned.box_mm[1])),
        points=len(planned.interest.points_mm),
        now_mm=round(planned.now_mm, 6),
        after=[PointAfterViewsDocument(more=count, point_mm=round(planned.after_mm[count - 1], 6)) for count in counts],
        further=[
            FurtherArmViewDocument(joints_deg=tuple(joints), target_mm=round_vector(fit.anchor_T_target[place, :3, 3]))
            for joints, place in zip(np.degrees(planned.joints_rad).tolist(), planned.places, strict=True)
        ],
    )


def disagreements(distances: Sequence[CheckedDistance]) -> list[Finding]:
    """The warning DISTANCE_DISAGREES of each known distance that differs from the estimate by more than both know."""
    return [
        Finding(
            DISTANCE_DISAGREES, "warning",
            Sentence(
                DISTANCE_DISAGREES, known_mm=one.known_mm, known_sigma_mm=one.known_sigma_mm, found_mm=one.found_mm,
                found_sigma_mm=one.found_sigma_mm, percent=100 * (one.found_mm / one.known_mm - 1),
            ),
            Sentence("check-distance"), effect_mm=abs(one.found_mm - one.known_mm),
        )
        for one in distances
        if one.sigmas > MAX_DISTANCE_SIGMAS
    ]  # fmt: skip


def identify_with_findings(
    arm: Arm, problem: Problem, created_at: str, *, software: str
) -> tuple[ArmErrorsDocument | None, tuple[Finding, ...]]:
    """As `identify_arm_document`, with findings in words; no document, and the reason, where it is refused."""
    try:
        found = identify_arm_document(arm, [problem], created_at=created_at, software=software)
    except CalibrationError as refusal:
        why = Sentence("arm-not-identified", why=as_sentence(str(refusal)))
        return None, (Finding("arm-not-identified", "warning", why, Sentence("correct-arm-session")),)
    shown = Sentence("arm-as-drawn")
    if found.taken_up:
        without, *models = found.ladder
        after_mm = max(models, key=lambda row: row.log_evidence).hold_out_mm
        shown = Sentence("arm-errors", before_mm=without.hold_out_mm, after_mm=after_mm)
    return found, (Finding(shown.id, "info", shown, Sentence("none-needed")),)


def _with_joints(arm: Arm, problem: Problem) -> Problem:
    views = problem.views
    if all(view.stance.joints_rad is not None for view in views):
        return problem
    if (of := problem.poses_of) is not None and (of.tool or of.base):
        what = f"views have no joints, and their poses are of {of.tool or 'the flange'} in {of.base or 'the base'}"
        raise GeometryError(f"{what}: record joints_deg, or give the flange's poses in the base")
    poses, known = [view.base_T_flange for view in views], [view.stance.joints_rad for view in views]
    joints = joints_of_poses(arm, poses, known, [view.stance.confdata for view in views])
    return replace(problem, views=tuple(view.standing(joints_rad=one) for view, one in zip(views, joints, strict=True)))

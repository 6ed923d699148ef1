"""A calibration in use: where the flange and the camera are when a controller reports a stance."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.calibration import (
    CalibrationDocument,
    CalibrationFindingDocument,
    FindingDocument,
    UncertaintyDocument,
)
from calibration.kinematics.arm_conditions import NOT_KNOWN, ArmConditions
from calibration.kinematics.arm_estimate import ArmEstimate
from calibration.kinematics.joint_check import require_consistent_joints
from calibration.kinematics.robot_accuracy import RobotNoise
from calibration.kinematics.stance import Correction, Stance
from calibration.likelihood.mapped_points import WORKING_VOLUME_NAMES, point_sigmas_mm
from calibration.likelihood.predicted_uncertainty import uncertainty_of, working_points_mm
from calibration.problem import Problem
from calibration.sentences.sentence import Sentence
from calibration.solution import COVERAGE_FACTOR, Finding
from calibration.solver.registered_points import NO_SCATTER, point_variances
from calibration.transforms import Array


def uncertainty_with_arm(
    document: CalibrationDocument, estimate: ArmEstimate, joints_rad: Array
) -> UncertaintyDocument | None:
    """In place of the document's: of X by the joint estimate, and of points by X and the arm at joints (n, 6).

    A point that matters keeps its place before the camera, and has the largest of its uncertainties at the joints.
    """
    claimed = document.uncertainty
    if claimed is None:
        return None
    covariance = estimate.covariance[:6, :6]
    listed = np.array([point.camera_mm for point in claimed.points]).reshape(-1, 3)
    volume = working_volume_mm(document)
    places = np.concatenate([listed, volume])
    if document.setup == "eye-to-hand":  # a camera beside the robot: in the base, by X alone
        sigmas = point_sigmas_mm(covariance, places)[None]
    else:
        sigmas = np.sqrt(point_variances(estimate, joints_rad, places))
    of_x = uncertainty_of(covariance, estimate.mount_T_camera, volume)
    x, y, z = of_x.translation_mm.tolist()
    a, b, c = np.degrees(of_x.rotation_rad).tolist()
    points = [
        point.model_copy(update={"sigma_mm": float(sigma), "expanded_mm": COVERAGE_FACTOR * float(sigma)})
        for point, sigma in zip(claimed.points, sigmas.max(axis=0), strict=False)
    ]
    return claimed.model_copy(
        update={
            "translation_mm": (x, y, z),
            "rotation_deg": (a, b, c),
            "point_mm": float(np.sqrt(np.mean(sigmas[:, len(listed) :] ** 2))),
            "covariance": tuple(map(tuple, covariance.tolist())),
            "points": tuple(points),
            "leave_out": None,
        }
    )


def working_volume_mm(document: CalibrationDocument) -> Array:
    """The points (n, 3) of the camera's frame at which `point_mm` is taken; the camera's origin where none is known."""
    points = () if document.uncertainty is None else document.uncertainty.points
    if not points:
        return np.zeros((1, 3))
    listed = np.array([point.camera_mm for point in points])
    if document.camera is None or {point.name for point in points} <= set(WORKING_VOLUME_NAMES):
        return listed
    return working_points_mm(document.camera.camera(), float(np.median(np.linalg.norm(listed, axis=1))))


POSE_WITHOUT_JOINTS = "pose-without-joints"
"""Code of the warning that joints were computed from poses."""

OTHER_LOAD = "arm-other-load"
"""Code of the warning that the flange carries another load than when the arm's errors were identified."""

UNKNOWN_TEMPERATURE = "arm-temperature-unknown"
"""Code of the warning that the arm's temperature, with which its errors were identified, is not known now."""

AS_BUILT = "as-built"
"""Of results: the poses are those of the arm with its errors."""


@dataclass(frozen=True)
class Placement:
    """How well points are placed from some poses with the arm as built.

    point_mm : one standard deviation over three axes, RMS over the working volume, at the worst of the poses; of X, of
        what is not known of the arm there, and of its scatter.
    seen : all joints are within the range of the session.
    """

    point_mm: float
    seen: bool


@dataclass(frozen=True, eq=False)
class CalibrationInUse:
    """A calibration in use.

    document : its X, with uncertainty and the robot's noise, is the one identified with the arm, where the arm's errors
        were taken up.
    arm : the arm as built; None for one as drawn.
    seen_rad : (2, 6) lowest and highest joints of the session, in which a pose without joints is taken to be.
    scatter : of the arm as built about one pose.
    of_conditions : findings on the arm's load and temperature, where they are others than when it was identified.
    """

    document: CalibrationDocument
    arm: ArmEstimate | None = None
    seen_rad: Array = field(default_factory=lambda: np.zeros((2, 6)))
    scatter: RobotNoise = NO_SCATTER
    of_conditions: tuple[Finding, ...] = ()

    @classmethod
    def of(
        cls, document: CalibrationDocument, errors: ArmErrorsDocument | None, conditions: ArmConditions = NOT_KNOWN
    ) -> "CalibrationInUse":
        """With arm.json, where that was identified and took errors up. Raises GeometryError for a damaged one.

        `conditions`: load and temperature of the arm now. The sag and the growth by others than arm.json's are computed
        with what is known of the arm; see `ArmEstimate.under` for what is not known.
        """
        if errors is None or not errors.taken_up:
            return cls(document)
        name = "flange_T_camera" if document.setup == "eye-in-hand" else "base_T_camera"
        seen_rad, identified = np.radians([errors.lowest_joints_deg, errors.highest_joints_deg]), errors.estimate()
        estimate = identified.under(conditions)
        levels = {"robot_rotation_deg": errors.scatter_deg, "robot_translation_mm": errors.scatter_mm}
        uncertainty = uncertainty_with_arm(document, estimate, _joints_of(document, seen_rad))
        with_arm = {
            name: errors.mount_T_camera,
            "uncertainty": uncertainty,
            "accuracy": document.accuracy.of_uncertainty(uncertainty),
            "noise": document.noise.model_copy(update=levels),
        }
        scatter = RobotNoise(errors.scatter_mm, float(np.radians(errors.scatter_deg)))
        findings = _of_conditions(identified, estimate)
        return cls(document.model_copy(update=with_arm), estimate, seen_rad, scatter, findings)

    @property
    def corrections(self) -> Sequence[Correction]:
        """In their order: the arm on its base, then the base."""
        axis = self.document.external_axis
        return (*(() if self.arm is None else (self,)), *(() if axis is None else (axis,)))

    def base_T_flange(self, stances: Sequence[Stance]) -> Array:
        """Poses (n, 4, 4) of the flange: of the arm as built, and as if the external axis stood at its zero.

        As reported where the calibration has neither. Raises JointsDisagree for joints of any stance that are not those
        of its pose, UnreachablePoseError, DocumentError for a stance without the reading of the axis.
        """
        poses = np.array([stance.base_T_flange for stance in stances])
        for correction in self.corrections:
            poses = correction.place(poses, stances)
        return poses

    def place(self, base_T_flange: Array, stances: Sequence[Stance]) -> Array:
        """As `Correction`: of the arm as built, at its joints or those of the drawing's inverse kinematics."""
        assert self.arm is not None
        joints = self.joints_of(self.arm, stances)
        for stance, row in zip(stances, joints, strict=True):
            if stance.joints_rad is not None:
                require_consistent_joints(self.arm.model.arm, row[None], stance.base_T_flange[None])
        return self.arm.base_T_flange(joints)

    def joints_of(self, arm: ArmEstimate, stances: Sequence[Stance]) -> Array:
        """Joints (n, 6) as known, else by inverse kinematics of the drawing. Raises UnreachablePoseError."""
        drawing, seen_rad = arm.model.arm, self.seen_rad
        known = (stance.joints_rad for stance in stances)
        return np.array(
            [
                drawing.nearest_to_range(stance.base_T_flange, *seen_rad) if joints is None else joints
                for stance, joints in zip(stances, known, strict=True)
            ]
        )

    def correct(self, problem: Problem) -> Problem:
        """The problem with the poses of `base_T_flange`. Raises as that."""
        poses = self.base_T_flange([view.stance for view in problem.views])
        moved = (
            view.standing(base_T_flange=pose, external_axes=None)
            for view, pose in zip(problem.views, poses, strict=True)
        )
        return replace(problem, views=tuple(moved), external_axis=None)

    def placement(self, stances: Sequence[Stance]) -> "Placement | None":
        """How well points are placed from there; None of an arm as drawn, and of a camera beside the robot.

        Raises UnreachablePoseError.
        """
        if self.arm is None or self.document.setup == "eye-to-hand":
            return None
        joints = self.joints_of(self.arm, stances)
        variances = point_variances(self.arm, joints, working_volume_mm(self.document), self.scatter)
        lowest, highest = self.seen_rad
        seen = bool(np.all((joints >= lowest) & (joints <= highest)))
        return Placement(float(np.sqrt(variances.mean(axis=1).max())), seen)

    def findings(self, stances: Sequence[Stance]) -> list[FindingDocument]:
        """Warnings on the arm's errors in use: POSE_WITHOUT_JOINTS where some poses have none, and `of_conditions`."""
        without = sum(stance.joints_rad is None for stance in stances)
        if self.arm is None:
            return []
        found = []
        if without:
            message = Sentence("arm-joints-from-poses", views=without)
            found.append(Finding(POSE_WITHOUT_JOINTS, "warning", message, Sentence("record-joints")))
        return [
            FindingDocument(code=one.code, severity=one.severity, message=one.message, fix=one.fix)
            for one in map(CalibrationFindingDocument.of, (*found, *self.of_conditions))
        ]


def _of_conditions(identified: ArmEstimate, now: ArmEstimate) -> tuple[Finding, ...]:
    """The warnings OTHER_LOAD and UNKNOWN_TEMPERATURE on the same arm, when it was identified and now."""
    found = []
    if now.load != identified.load:
        loads = {"before_kg": identified.load.mass_kg, "now_kg": now.load.mass_kg}
        found.append(Finding(OTHER_LOAD, "warning", Sentence(OTHER_LOAD, **loads), Sentence("identify-arm-again")))
    if now.warmth_sigma_k and now.temperature_c is not None:
        message = Sentence(UNKNOWN_TEMPERATURE, before_c=now.temperature_c, sigma_k=now.warmth_sigma_k)
        found.append(Finding(UNKNOWN_TEMPERATURE, "warning", message, Sentence("state-arm-temperature")))
    return tuple(found)


def _joints_of(document: CalibrationDocument, seen_rad: Array) -> Array:
    """Joints (n, 6) of the views that were used; without any, the middle of the session's."""
    known = [view.joints_deg for view in document.views if view.joints_deg and view.status != "rejected"]
    found: Array = np.radians(np.array(known)) if known else seen_rad.mean(axis=0)[None]
    return found

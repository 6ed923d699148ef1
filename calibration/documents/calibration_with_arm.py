"""A calibration with the errors of its arm: where the flange and the camera are at a pose that a controller reports."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.calibration import CalibrationDocument, CalibrationFindingDocument, FindingDocument
from calibration.kinematics.arm_estimate import ArmEstimate
from calibration.kinematics.joint_check import require_consistent_joints
from calibration.kinematics.joints_of_poses import joints_in_range
from calibration.problem import Problem
from calibration.sentences.sentence import Sentence
from calibration.solution import Finding
from calibration.transforms import Array

POSE_WITHOUT_JOINTS = "pose-without-joints"
"""Code of the warning that joints were computed from poses."""

AS_BUILT = "as-built"
"""Of results: the poses are those of the arm with its errors."""


@dataclass(frozen=True, eq=False)
class CalibrationWithArm:
    """A calibration in use.

    document : its X is the one identified with the arm, where the arm's errors were taken up.
    arm : the arm as built; None for one as drawn.
    seen_rad : (2, 6) lowest and highest joints of the session, in which a pose without joints is taken to be.
    """

    document: CalibrationDocument
    arm: ArmEstimate | None = None
    seen_rad: Array = field(default_factory=lambda: np.zeros((2, 6)))

    @classmethod
    def of(cls, document: CalibrationDocument, errors: ArmErrorsDocument | None) -> "CalibrationWithArm":
        """With arm.json, where that was identified and took errors up. Raises GeometryError for a damaged one."""
        if errors is None or not errors.taken_up:
            return cls(document)
        name = "flange_T_camera" if document.setup == "eye-in-hand" else "base_T_camera"
        seen_rad = np.radians([errors.lowest_joints_deg, errors.highest_joints_deg])
        return cls(document.model_copy(update={name: errors.mount_T_camera}), errors.estimate(), seen_rad)

    def reading(self, external_axes: Sequence[float | None] | None) -> float | None:
        """Of the calibration's external axis, mm or rad, in the controller's axes; None without either."""
        found = self.document.external_axis
        return None if found is None else found.reading(external_axes)

    def base_T_flange(
        self,
        reported: Sequence[Array],
        joints_rad: Sequence[Array | None],
        readings: Sequence[float | None] | None = None,
    ) -> Array:
        """Poses (n, 4, 4) of the flange: as reported (4, 4) of an arm as drawn, else of the arm as built at its joints.

        Poses without joints get theirs by the drawing's inverse kinematics. With an external axis, which stood at the
        `readings` (mm or rad), they are as if it stood at its zero. Raises JointsDisagree for joints of any view that
        are not those of its pose, UnreachablePoseError, DocumentError for a pose without its reading.
        """
        poses = self._at_joints(reported, joints_rad)
        found = self.document.external_axis
        return poses if found is None else found.at_zero(poses, readings or [None] * len(poses))

    def _at_joints(self, reported: Sequence[Array], joints_rad: Sequence[Array | None]) -> Array:
        """As `base_T_flange`, on the base where it stood."""
        if self.arm is None:
            return np.array(reported)
        drawing = self.arm.model.arm
        joints = np.array(
            [
                joints_in_range(drawing, pose, *self.seen_rad) if known is None else known
                for pose, known in zip(reported, joints_rad, strict=True)
            ]
        )
        for row, known in enumerate(joints_rad):
            if known is not None:
                require_consistent_joints(drawing, joints[row : row + 1], np.array(reported[row : row + 1]))
        return self.arm.base_T_flange(joints)

    def correct(self, problem: Problem) -> Problem:
        """The problem with the poses of the arm as built. Raises as `base_T_flange`."""
        views = problem.views
        poses = self.base_T_flange(
            [view.base_T_flange for view in views],
            [view.joints_rad for view in views],
            [view.axis_reading for view in views],
        )
        moved = (replace(view, base_T_flange=pose, axis_reading=None) for view, pose in zip(views, poses, strict=True))
        return replace(problem, views=tuple(moved), external_axis=None)

    def findings(self, joints_rad: Sequence[Array | None]) -> list[FindingDocument]:
        """The warning POSE_WITHOUT_JOINTS, where the arm's errors are in use and some poses have no joints."""
        without = sum(joints is None for joints in joints_rad)
        if self.arm is None or not without:
            return []
        message = Sentence("arm-joints-from-poses", views=without)
        finding = Finding(POSE_WITHOUT_JOINTS, "warning", message, Sentence("record-joints"))
        whole = CalibrationFindingDocument.of(finding)
        return [FindingDocument(code=whole.code, severity=whole.severity, message=whole.message, fix=whole.fix)]

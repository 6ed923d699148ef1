"""A touch test by an arm as built: where the tip touched and where the camera looked are placed with its errors."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from calibration.documents.calibration_with_arm import CalibrationWithArm
from calibration.documents.pose import PoseDocument
from calibration.documents.tip import TipDocument
from calibration.documents.touch_test import TouchTestDocument
from calibration.documents.touches import TouchesDocument
from calibration.kinematics.arm_estimate import ArmEstimate
from calibration.problem import Problem
from extensions.touch.mathematics.report import SeenPoint, TouchingArm, touch_test


def touch_test_with_arm(
    given: CalibrationWithArm,
    tip: TipDocument,
    touches: TouchesDocument,
    seen: Mapping[int, SeenPoint],
    tolerance_mm: float | None = None,
    origin: str = "touches",
) -> TouchTestDocument:
    """As `touch_test`, with the arm's errors and what is not known of them, where they are in force.

    `touches`: with poses as the controller reports them. `seen`: from the poses of `given`. Raises as `touch_test`,
    UnreachablePoseError.
    """
    arm = None if given.arm is None else _arm_at(given, given.arm, touches, seen)
    return touch_test(given.document, tip, touches_as_built(given, touches), seen, tolerance_mm, origin, arm)


def touches_as_built(given: CalibrationWithArm, touches: TouchesDocument) -> TouchesDocument:
    """The touches in the poses that the calibration gives to those reported. Raises UnreachablePoseError."""
    if given.arm is None and given.document.external_axis is None:
        return touches

    def placed(pose: PoseDocument | None) -> PoseDocument | None:
        return None if pose is None else PoseDocument.of(given.base_T_flange([pose.transform()], [None])[0])

    moved = [
        touch.model_copy(update={"base_T_flange": placed(touch.base_T_flange), "seen_from": placed(touch.seen_from)})
        for touch in touches.touches
    ]
    return touches.model_copy(update={"touches": tuple(moved)})


def with_joints(given: CalibrationWithArm, problem: Problem) -> Problem:
    """The problem with joints in each view, by its pose where none are recorded; as it is of an arm as drawn.

    Raises UnreachablePoseError.
    """
    if given.arm is None:
        return problem
    views = problem.views
    joints = given.joints_by(given.arm, [view.base_T_flange for view in views], [view.joints_rad for view in views])
    return replace(problem, views=tuple(replace(view, joints_rad=q) for view, q in zip(views, joints, strict=True)))


def _arm_at(
    given: CalibrationWithArm, arm: ArmEstimate, touches: TouchesDocument, seen: Mapping[int, SeenPoint]
) -> TouchingArm | None:
    """The arm at its joints; None where touches lack poses or points, which `touch_test` refuses."""
    poses = [touch.base_T_flange.transform() for touch in touches.touches if touch.base_T_flange is not None]
    known = all(touch.id is None or touch.id in seen for touch in touches.touches)
    if len(poses) < len(touches.touches) or not known:
        return None
    looks = []
    for touch in touches.touches if given.document.setup == "eye-in-hand" else ():
        recorded = None if touch.id is None else seen[touch.id].joints_rad
        if recorded is None and touch.seen_from is not None:
            recorded = given.joints_by(arm, [touch.seen_from.transform()], [None])
        looks.append(np.zeros((0, 6)) if recorded is None else recorded)
    return TouchingArm(arm, given.joints_by(arm, poses, [None] * len(poses)), looks)

"""A touch test by a calibration in use: it places where the tip touched and where the camera looked."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.documents.pose import PoseDocument
from calibration.documents.tip import TipDocument
from calibration.documents.touch_test import TouchTestDocument
from calibration.documents.touches import TouchDocument, TouchesDocument
from calibration.kinematics.arm_estimate import ArmEstimate
from calibration.kinematics.stance import Stance
from calibration.problem import Problem
from calibration.transforms import Array
from extensions.touch.mathematics.report import SeenPoint, TouchingArm, touch_test


def touch_test_with_arm(
    given: CalibrationInUse,
    tip: TipDocument,
    touches: TouchesDocument,
    seen: Mapping[int, SeenPoint],
    tolerance_mm: float | None = None,
    origin: str = "touches",
) -> TouchTestDocument:
    """As `touch_test`, with the arm's errors and what is not known of them, where they are active.

    `touches`: with poses as the controller reports them. `seen`: from the poses of `given`. Raises as `touch_test`,
    and as `CalibrationInUse.base_T_flange`.
    """
    arm = None if given.arm is None else _arm_at(given, given.arm, touches, seen)
    return touch_test(given.document, tip, touches_in_use(given, touches), seen, tolerance_mm, origin, arm)


def touches_in_use(given: CalibrationInUse, touches: TouchesDocument) -> TouchesDocument:
    """The touches in the poses that the calibration gives to those reported. Raises as `base_T_flange` of it."""
    if not given.corrections:
        return touches

    def placed(touch: TouchDocument) -> TouchDocument:
        touched, looked = touch.touched, touch.looked
        update: dict[str, Any] = {}
        if touched is not None:
            update["base_T_flange"] = PoseDocument.of(given.base_T_flange([touched])[0])
            update["miss_mm"] = tuple((base_turn(given, touched) @ touch.miss_mm).tolist())
        if looked is not None:
            update["seen_from"] = PoseDocument.of(given.base_T_flange([looked])[0])
        return touch.model_copy(update=update)

    return touches.model_copy(update={"touches": tuple(map(placed, touches.touches))})


def base_turn(given: CalibrationInUse, stance: Stance) -> Array:
    """(3, 3) from directions in the base as it stands there to those with the external axis at its zero.

    Raises DocumentError for a stance without the reading of the axis.
    """
    axis = given.document.external_axis
    return np.eye(3) if axis is None else np.asarray(axis.place(np.eye(4)[None], [stance])[0, :3, :3])


def with_joints(given: CalibrationInUse, problem: Problem) -> Problem:
    """The problem with joints in each view, by its pose where none are recorded; as it is of an arm as drawn.

    Raises UnreachablePoseError.
    """
    if given.arm is None:
        return problem
    joints = given.joints_of(given.arm, [view.stance for view in problem.views])
    views = (view.standing(joints_rad=one) for view, one in zip(problem.views, joints, strict=True))
    return replace(problem, views=tuple(views))


def _arm_at(
    given: CalibrationInUse, arm: ArmEstimate, touches: TouchesDocument, seen: Mapping[int, SeenPoint]
) -> TouchingArm | None:
    """The arm at its joints; None where touches lack poses or points, which `touch_test` refuses."""
    touched = [touch.touched for touch in touches.touches if touch.touched is not None]
    known = all(touch.id is None or touch.id in seen for touch in touches.touches)
    if len(touched) < len(touches.touches) or not known:
        return None
    looks = []
    for touch in touches.touches if given.document.setup == "eye-in-hand" else ():
        recorded = None if touch.id is None else seen[touch.id].joints_rad
        if recorded is None and touch.looked is not None:
            recorded = given.joints_of(arm, [touch.looked])
        looks.append(np.zeros((0, 6)) if recorded is None else recorded)
    return TouchingArm(arm, given.joints_of(arm, touched), looks)

"""The error of the arm over a box of places of its flange, before and after its errors are taken out (mm)."""

from dataclasses import replace

import numpy as np
from pydantic import Field

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.calibration import CalibrationDocument
from calibration.documents.pose import Vector, round_vector
from calibration.documents.validation import Document
from calibration.errors import GeometryError
from calibration.kinematics.arm_box import box_around, grid_in, joints_at_places, middle_of
from calibration.kinematics.arm_estimate import ArmEstimate
from calibration.solver.registered_points import registered_points
from calibration.transforms import Array, map_points

MAX_STEPS = 9
"""Places along one edge of the box: 729 poses take the inverse kinematics 0.2 s."""


class ArmFieldPointDocument(Document):
    """One place of the flange in the base, and the point that is registered from there.

    `error_mm`: by how much the arm as drawn, with the X found without the arm's errors, misses the point according to
    those errors. `before_mm`: RMS length of that miss, what is not known about the arm included; `after_mm`: RMS miss
    that is left with the errors taken out. `seen`: all joints are within the range of the session.
    """

    flange_mm: Vector
    point_mm: Vector
    error_mm: Vector
    before_mm: float
    after_mm: float
    seen: bool


class ArmFieldDocument(Document):
    """The error field of an arm, places out of reach left out.

    The flange is turned as in the session's middle view at all places. `point_in_flange_mm`: the registered point: at
    the session's distance before the camera, or tool0 itself where the camera stands beside the robot.
    `before_rms_mm`, `after_rms_mm`: over all places.
    """

    calibration_id: str
    arm: str
    taken_up: bool
    box_mm: tuple[Vector, Vector]
    steps: int
    point_in_flange_mm: Vector
    before_rms_mm: float | None
    after_rms_mm: float | None
    points: list[ArmFieldPointDocument] = Field(max_length=MAX_STEPS**3)


def arm_field(
    errors: ArmErrorsDocument, calibration: CalibrationDocument, steps: int, box: tuple[Vector, Vector] | None = None
) -> ArmFieldDocument:
    """The field on `steps`³ places of the flange in a box (its least and largest corner); without one, around the
    session's views.

    Raises GeometryError for a damaged arm.json, a box with a minimum above its maximum, and a calibration whose views
    hold no joints.
    """
    if box is not None and any(low > high for low, high in zip(*box, strict=True)):
        raise GeometryError("the box has a minimum above its maximum: give the least x, y, z, then the largest")
    estimate, drawn_x, distance_mm = _sensor(errors, calibration)
    arm, views = estimate.model.arm, _joints_of(calibration)
    box_mm = box_around(arm, views) if box is None else np.array(box)
    lowest, highest = np.radians([errors.lowest_joints_deg, errors.highest_joints_deg])
    joints = joints_at_places(arm, middle_of(views), grid_in(box_mm, steps), (lowest, highest))
    drawn, point = arm.forward(joints), np.array([[0.0, 0.0, distance_mm]])
    found, covariances = registered_points(estimate, estimate.postures(joints), np.tile(point, (len(joints), 1)))
    missed = map_points(drawn @ drawn_x, point)[:, 0] - found
    left = np.trace(covariances, axis1=1, axis2=2)
    squares = np.sum(missed**2, axis=1) + left
    seen = np.all((joints >= lowest) & (joints <= highest), axis=1)
    return ArmFieldDocument(
        calibration_id=calibration.id,
        arm=errors.arm,
        taken_up=errors.taken_up,
        box_mm=(round_vector(box_mm[0]), round_vector(box_mm[1])),
        steps=steps,
        point_in_flange_mm=round_vector(map_points(estimate.mount_T_camera, point)[0]),
        before_rms_mm=_rms(squares),
        after_rms_mm=_rms(left),
        points=[
            ArmFieldPointDocument(
                flange_mm=round_vector(drawn[row, :3, 3]),
                point_mm=round_vector(found[row]),
                error_mm=round_vector(missed[row]),
                before_mm=round(float(np.sqrt(squares[row])), 6),
                after_mm=round(float(np.sqrt(left[row])), 6),
                seen=bool(seen[row]),
            )
            for row in range(len(joints))
        ],
    )


def arm_field_text(field: ArmFieldDocument) -> str:
    """What people read: RMS and worst over the box, before and after."""
    if not field.points:
        return f"{field.arm}: no place of the box is within reach"
    worst = max(field.points, key=lambda point: point.after_mm)
    where = ", ".join(f"{value:.0f}" for value in worst.flange_mm)
    return (
        f"{field.arm}, {len(field.points)} places in the box: a registered point is off by {field.before_rms_mm:.3f} mm"
        f" RMS as drawn, by {field.after_rms_mm:.3f} mm with the arm's errors taken out; most at flange {where} mm:"
        f" {worst.after_mm:.3f} mm"
    )


def _sensor(errors: ArmErrorsDocument, calibration: CalibrationDocument) -> tuple[ArmEstimate, Array, float]:
    """The arm as built with its X, the X (4, 4) of the arm as drawn, and the registered point's distance from it.

    Of a camera beside the robot the point is tool0, and X the identity.
    """
    estimate = errors.estimate()
    if calibration.setup == "eye-to-hand":
        covariance = estimate.covariance.copy()
        covariance[:6], covariance[:, :6] = 0.0, 0.0
        return replace(estimate, covariance=covariance, mount_T_camera=np.eye(4)), np.eye(4), 0.0
    if calibration.mount_T_camera is None or calibration.anchor_T_target is None:
        raise GeometryError(f"calibration {calibration.id} holds no transform: calibrate again")
    x, views = calibration.mount_T_camera.transform(), _joints_of(calibration)
    cameras = estimate.model.arm.forward(views) @ x
    seen = np.linalg.inv(cameras) @ calibration.anchor_T_target.transform()
    return estimate, x, float(np.median(seen[:, 2, 3]))


def _joints_of(calibration: CalibrationDocument) -> Array:
    joints = [view.joints_deg for view in calibration.views if view.joints_deg is not None]
    if not joints:
        raise GeometryError(f"the pictures of calibration {calibration.id} hold no joints: calibrate with joints_deg")
    found: Array = np.radians(np.array(joints))
    return found


def _rms(squares: Array) -> float | None:
    return round(float(np.sqrt(squares.mean())), 6) if len(squares) else None

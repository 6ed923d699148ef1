"""A touch test from its documents: a calibration, a tip, the touches, and where the camera saw the points."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import radians

import numpy as np

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.tip import TipDocument
from calibration.documents.touch_test import TouchTestDocument
from calibration.documents.touches import TouchDocument, TouchesDocument
from calibration.errors import DocumentError, DocumentProblem
from calibration.kinematics.arm_estimate import ArmEstimate
from calibration.solver.registered_points import unknown_covariances
from calibration.transforms import Array, inverse, map_points
from extensions.touch.mathematics.misses import (
    SharedError,
    TouchTest,
    evaluate_touch_test,
    mapping_error,
    pose_error,
    seen_points_mm,
    tip_error,
)


@dataclass(frozen=True, eq=False)
class SeenPoint:
    """A point as seen from k poses: base_T_mount (k, 4, 4), camera_mm (k, 3), `sigma_mm` of their mean per axis.

    joints_rad : (k, 6) of the arm there; None where they are not needed.
    """

    base_T_mount: Array
    camera_mm: Array
    sigma_mm: float = 0.0
    joints_rad: Array | None = None


@dataclass(frozen=True, eq=False)
class Sighting:
    """Where the camera saw a point, (3,) in the base, and the unit directions (k, 3) in which it looked at it."""

    point_mm: Array
    sights: Array


@dataclass(frozen=True, eq=False)
class TouchingArm:
    """The arm as built whose flange poses are given, with its joints, rad.

    touched_rad : (n, 6) where the tip touched. seen_rad : (k, 6) of the k looks at each point; none of a camera beside
    the robot.
    """

    estimate: ArmEstimate
    touched_rad: Array
    seen_rad: Sequence[Array]

    def rows(self, base_T_flange: Array, flange_mm: Array, joints_rad: Array) -> Array:
        """Derivative (n, 3, k) of points (n, 3) of the flange's frame, in the base, by the arm's errors."""
        postures = self.estimate.postures(joints_rad)
        found: Array = pose_error(base_T_flange, flange_mm, 0.0, 0.0).rows @ self.estimate.model.jacobian(
            self.estimate.parameters, postures
        )
        return found


def verified_points(
    ids: Sequence[int], base_T_mount: Array, mount_T_camera: Array, base_mm: Array, joints_rad: Array | None = None
) -> dict[int, SeenPoint]:
    """The target's points by id, from a verification's base_mm (k, n, 3) and its poses base_T_mount (k, 4, 4).

    `joints_rad`: (k, 6) of its poses, for an arm as built.
    """
    camera_mm = map_points(inverse(base_T_mount @ mount_T_camera), base_mm)
    return {
        point: SeenPoint(base_T_mount, camera_mm[:, column], joints_rad=joints_rad) for column, point in enumerate(ids)
    }


def touch_test(
    calibration: CalibrationDocument,
    tip: TipDocument,
    touches: TouchesDocument,
    seen: Mapping[int, SeenPoint],
    tolerance_mm: float | None = None,
    origin: str = "touches",
    arm: TouchingArm | None = None,
) -> TouchTestDocument:
    """Evaluate the touches; `seen`: the target's points by id. `origin` names the touches in errors.

    `arm`: of poses that are those of the arm as built; what is not known of it counts with X's error.

    Raises DocumentError for a calibration without X or its covariance, points that were not seen, and poses that are
    missing or too many; GeometryError as `evaluate_touch_test`.
    """
    mount_T_camera, covariance = _mapping(calibration)
    points = _seen(touches.touches, seen, calibration, origin)
    with np.errstate(over="ignore", invalid="ignore"):  # numbers beyond all measure are refused where they arrive
        seen_mm, mapping, looks = _in_base(points, mount_T_camera, covariance, calibration, arm)
        base_T_flange = np.array([touch.base_T_flange.transform() for touch in touches.touches if touch.base_T_flange])
        tips_mm = np.broadcast_to(np.array(tip.flange_tip_mm), (len(points), 3))
        touched_mm = map_points(base_T_flange, tips_mm[:, None])[:, 0] + [touch.miss_mm for touch in touches.touches]
        if arm is not None:  # [X, the arm's errors] move the touched points, too
            rows = mapping.rows.copy()
            rows[:, :, 6:] -= arm.rows(base_T_flange, tips_mm, arm.touched_rad)
            mapping = SharedError(rows, mapping.covariance)
        own = _own(points, base_T_flange, tip, touches.placing_sigma_mm, calibration, arm)
        shared = [tip_error(base_T_flange, np.array(tip.covariance)), *looks]
        found = evaluate_touch_test(seen_mm, touched_mm, mapping, shared, own, tolerance_mm)
        return _document(found, calibration.id, tip, touches.touches, seen_mm, touched_mm)


def sighting_of(
    calibration: CalibrationDocument, touch: TouchDocument, seen: Mapping[int, SeenPoint], origin: str = "touches"
) -> Sighting:
    """Where the camera saw the point of a touch, mean over its looks. Raises as `touch_test`, and DocumentError for a
    point that no camera sees: behind it."""
    mount_T_camera, _ = _mapping(calibration)
    (point,) = _seen((touch,), seen, calibration, origin)
    if not (point.camera_mm[:, 2] > 0).all():
        what, fix = "the point lies behind the camera", "its z axis looks at the point"
        raise DocumentError.one(origin, "touch.camera_mm", what, fix)
    base_R_camera = point.base_T_mount[:, :3, :3] @ mount_T_camera[:3, :3]
    looks = np.einsum("kij,kj->ki", base_R_camera, point.camera_mm)
    seen_mm = seen_points_mm(point.base_T_mount, mount_T_camera, point.camera_mm)
    return Sighting(seen_mm.mean(axis=0), looks / np.linalg.norm(looks, axis=1, keepdims=True))


def _mapping(calibration: CalibrationDocument) -> tuple[Array, Array]:
    covariance = None if calibration.uncertainty is None else calibration.uncertainty.matrix()
    if calibration.mount_T_camera is None or covariance is None:
        what = "it holds no transform with a covariance"
        raise DocumentError.one(f"calibration {calibration.id}", "uncertainty", what, "calibrate again")
    return calibration.mount_T_camera.transform(), covariance


def _seen(
    touches: Sequence[TouchDocument], seen: Mapping[int, SeenPoint], calibration: CalibrationDocument, origin: str
) -> list[SeenPoint]:
    """Each touch's point as seen. Raises DocumentError with all problems."""
    in_hand = calibration.setup == "eye-in-hand"
    problems: list[DocumentProblem] = []
    points: list[SeenPoint] = []
    for index, touch in enumerate(touches):
        place = f"touches[{index}]"
        if touch.base_T_flange is None:
            problems.append(DocumentProblem(f"{place}.base_T_flange", "missing", "add it"))
        if touch.id is not None:
            if touch.id not in seen:
                what = f"point {touch.id} was not seen from every pose"
                problems.append(DocumentProblem(f"{place}.id", what, "touch points that were seen"))
            else:
                points.append(seen[touch.id])
        elif (touch.seen_from is None) == in_hand:
            what = f"the pose in which the camera saw it is {'missing' if in_hand else 'of no use: the camera stands'}"
            problems.append(DocumentProblem(f"{place}.seen_from", what, "add it" if in_hand else "leave it out"))
        else:
            pose = np.eye(4) if touch.seen_from is None else touch.seen_from.transform()
            points.append(SeenPoint(pose[None], np.array([touch.camera_mm]), touch.sigma_mm))
    if problems:
        raise DocumentError(origin, problems)
    return points


def _in_base(
    points: Sequence[SeenPoint],
    mount_T_camera: Array,
    covariance: Array,
    calibration: CalibrationDocument,
    arm: TouchingArm | None,
) -> tuple[Array, SharedError, list[SharedError]]:
    """The points (n, 3) in the base, each the mean over its looks, and their errors: of X, and of each look's pose.

    With an arm as built the first is that of [X, the arm's errors], and the pose's contains its play.
    """
    counts = [len(point.camera_mm) for point in points]
    mean = np.repeat(np.eye(len(points)) / counts, counts, axis=1)  # (n, m) over all looks at all points
    poses = np.concatenate([point.base_T_mount for point in points])
    camera_mm = np.concatenate([point.camera_mm for point in points])
    seen_mm = mean @ seen_points_mm(poses, mount_T_camera, camera_mm)
    mapping = mapping_error(poses, mount_T_camera, camera_mm, covariance)
    rows, looks = mapping.rows, list[SharedError]()
    if arm is not None:
        covariance = arm.estimate.covariance
        rows = np.concatenate([rows, np.zeros((len(rows), 3, len(arm.estimate.model)))], axis=-1)
    if calibration.setup == "eye-in-hand":
        flange_mm = map_points(mount_T_camera, camera_mm)
        error, plays = pose_error(poses, flange_mm, *_robot_noise(calibration)), np.zeros((len(poses), 6, 6))
        if arm is not None:
            joints_rad = np.concatenate(list(arm.seen_rad))
            rows[:, :, 6:] = arm.rows(poses, flange_mm, joints_rad)
            plays = unknown_covariances(arm.estimate, joints_rad)
        _, look_of = np.unique(poses.reshape(-1, 16).round(9), axis=0, return_inverse=True)
        for look in range(int(look_of.max()) + 1):
            own = look_of.ravel() == look
            of_look = np.einsum("nm,mij->nij", mean[:, own], error.rows[own])
            looks.append(SharedError(of_look, error.covariance + plays[np.argmax(own)]))
    return seen_mm, SharedError(np.einsum("nm,mij->nij", mean, rows), covariance), looks


def _robot_noise(calibration: CalibrationDocument, otherwise_mm: float = 0.0) -> tuple[float, float]:
    """The robot's noise as the calibration found it: (rad, mm) per axis."""
    rotation_deg, translation_mm = calibration.noise.robot_rotation_deg, calibration.noise.robot_translation_mm
    return radians(rotation_deg or 0.0), otherwise_mm if translation_mm is None else translation_mm


def _own(
    points: Sequence[SeenPoint],
    base_T_flange: Array,
    tip: TipDocument,
    placing_sigma_mm: float | None,
    calibration: CalibrationDocument,
    arm: TouchingArm | None,
) -> Array:
    """Errors (n, 3, 3) that no two points share: of the robot when it touches, of placing the tip, of the camera.

    The tip's calibration shows robot and placing together; what is more than the robot's part is the placing's.
    """
    tip_mm = np.array([tip.flange_tip_mm])
    noise = _robot_noise(calibration, tip.placing_sigma_mm)
    errors = [pose_error(pose[None], tip_mm, *noise) for pose in base_T_flange]
    if arm is not None:
        plays = unknown_covariances(arm.estimate, arm.touched_rad)
        errors = [SharedError(error.rows, error.covariance + play) for error, play in zip(errors, plays, strict=True)]
    robot = np.array([error.of_points() for error in errors])
    if placing_sigma_mm is None:
        by_robot = np.trace(robot, axis1=1, axis2=2) / 3
        placing = np.maximum(tip.placing_sigma_mm**2 - by_robot, 0.0)
    else:
        placing = np.full(len(points), placing_sigma_mm**2)
    camera = np.array([point.sigma_mm**2 for point in points])
    own: Array = robot + (placing + camera)[:, None, None] * np.eye(3)
    return own


def _document(
    found: TouchTest,
    calibration_id: str,
    tip: TipDocument,
    touches: Sequence[TouchDocument],
    seen_mm: Array,
    touched_mm: Array,
) -> TouchTestDocument:
    accepted = found.agree if found.conformance is None else found.conformance == "within"
    points = [
        {
            "name": touch.label or f"touch {index + 1}",
            "seen_mm": seen_mm[index].round(6).tolist(),
            "touched_mm": touched_mm[index].round(6).tolist(),
            "miss_mm": found.base_miss_mm[index].round(6).tolist(),
            "length_mm": float(found.lengths_mm[index]),
            "expanded_mm": float(found.expanded_mm[index]),
            "claimed_mm": float(found.claimed_mm[index]),
            "outlying": bool(found.outlying[index]),
            "base_T_flange": touch.base_T_flange,
        }
        for index, touch in enumerate(touches)
    ]
    return TouchTestDocument.model_validate(
        {
            "calibration_id": calibration_id,
            "flange_tip_mm": tip.flange_tip_mm,
            "points": points,
            "largest_mm": float(found.lengths_mm.max()),
            "mean_mm": found.base_mean_mm.round(6).tolist(),
            "probability": found.probability,
            "agree": found.agree,
            "tolerance_mm": found.tolerance_mm,
            "conformance": found.conformance,
            "accepted": accepted,
            "summary": _summary(found),
        }
    )


def _summary(found: TouchTest) -> str:
    worst = int(np.argmax(found.lengths_mm))
    text = f"{len(found.lengths_mm)} points: the largest miss is {found.lengths_mm[worst]:.3f} mm"
    text += f" (U = {found.expanded_mm[worst]:.3f} mm, k = 2)"
    match found.conformance:
        case "within":
            text += f", within the tolerance of {found.tolerance_mm:g} mm"
        case "beyond":
            text += f", beyond the tolerance of {found.tolerance_mm:g} mm: calibrate again, and look at camera and tip"
        case "undecided":
            text += (
                f"; whether {found.tolerance_mm:g} mm is met is not decided: know the tip better, touch more exactly"
            )
    if not found.agree:
        text += (
            f"; misses so large have a probability of {found.probability:.2g} by the stated uncertainties: camera or"
        )
        text += " tip moved, the robot is less exact than stated, or a point was taken for another"
    return text


def touch_test_text(found: TouchTestDocument) -> str:
    """A touch test in a few lines, the summary first."""
    lines = [found.summary]
    for point in found.points:
        x, y, z = point.miss_mm
        known = f"U = {point.expanded_mm:.3f} mm; with X's {point.claimed_mm:.3f} mm"
        mark = "  larger than that explains" if point.outlying else ""
        lines.append(f"  {point.name:<16} {point.length_mm:.3f} mm  ({x:+.3f}, {y:+.3f}, {z:+.3f})  {known}{mark}")
    x, y, z = found.mean_mm
    return "\n".join([*lines, f"  {'mean':<16} ({x:+.3f}, {y:+.3f}, {z:+.3f}) mm along the base's axes"])

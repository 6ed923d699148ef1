"""Schemas of the cell's state. Lengths mm, angles deg, quaternions scalar first."""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

from pydantic import JsonValue

from calibration.documents.arm_conditions import ArmTemperature
from calibration.documents.calibration import SentenceDocument
from calibration.documents.external_axis import external_axes_of
from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.session import CameraDocument
from calibration.documents.target import TargetDocument
from calibration.documents.validation import Document
from calibration.kinematics.seven_axes import AnyArm
from calibration.problem import Setup
from calibration.sentences.sentence import as_sentence
from daemon.api.schemas.answer import EXAMPLE_AT, Answer, as_it_stands
from daemon.cell.device_watch import DeviceState
from daemon.cell.frame_check import frame_difference
from daemon.cell.readings import RobotReading
from daemon.cell.skeleton import lengths_mm, skeleton_mm
from daemon.config.settings import Settings, TaughtPose
from daemon.model.check_result import CheckResult
from daemon.model.records import PlannedPoseDocument
from daemon.sessions.look import Look
from drivers.interfaces import Robot


class RobotDocument(Answer):
    """The pose of the arm and the status of the controller.

    `external_axes`: the controller's axes beside the arm, mm or degrees, null where it has none.
    `skeleton_mm`: base, shoulder, elbow, wrist and flange in the base frame; null, as `model`, when the settings do not
    name the arm. `mode`: "manual" whenever the controller is not in automatic mode. `frame`: the frame of the pose;
    "world" where the controller gives that one and [robot] base_frame does not say where the base stands in it: the two
    are taken for one. `frame_warning`: what the axes of a known arm say against the pose, with the likely cause.
    `arm_angle_deg`: of an arm with seven axes, else null.
    """

    connected: bool
    detail: str
    base_T_flange: PoseDocument
    configuration: tuple[int, int, int, int]
    joints_deg: list[float]
    external_axes: list[float | None] | None
    arm_angle_deg: float | None
    still: bool
    motors_on: bool
    automatic: bool
    emergency_stop: bool
    moving: bool
    armed: bool
    program_running: bool
    speed_limited: bool
    held_by: str | None
    mode: Literal["automatic", "manual"]
    model: str | None
    skeleton_mm: list[Vector] | None
    frame: Literal["base", "world"]
    frame_warning: str | None

    @classmethod
    def of(cls, reading: RobotReading, robot: Robot, holder: str | None, arm: AnyArm | None) -> "RobotDocument":
        status, pose, link = reading.status, reading.pose, robot.link
        cf1, cf4, cf6, cfx = pose.posture
        axes = external_axes_of(pose.external_axes)
        return cls(
            connected=link.connected,
            detail=link.detail,
            base_T_flange=PoseDocument.of(pose.base_T_flange),
            configuration=(cf1, cf4, cf6, cfx),
            joints_deg=[math.degrees(angle) for angle in reading.joints],
            external_axes=None if axes is None else list(axes),
            arm_angle_deg=pose.arm_angle_deg,
            still=pose.still,
            **vars(status),
            held_by=holder,
            mode="automatic" if status.automatic else "manual",
            model=arm.name if arm else None,
            skeleton_mm=skeleton_mm(arm, reading.joints),
            frame=robot.capabilities.pose_frame,
            frame_warning=frame_warning(arm, reading),
        )


def frame_warning(arm: AnyArm | None, reading: RobotReading) -> str | None:
    """How far the reported pose of a standing arm is from the one by its axes, and why; None when they agree."""
    if arm is None or not reading.pose.still:
        return None
    found = frame_difference(arm, reading.joints, reading.pose)
    return None if found.agrees else f"{found.what}: {found.fix}"


class ArmTemperatureRequest(Document):
    """The temperature of the arm's links, in °C."""

    temperature_c: ArmTemperature


class ArmTemperatureDocument(Answer):
    """The temperature of the arm's links in °C, and seconds since it was stated; null where it is not known."""

    temperature_c: float | None
    age_s: float | None


class MissingDocument(Answer):
    """Why the target was not found: a stable code, a sentence, and its id and parameters as in calibration.json."""

    code: str
    what: str
    id: str
    params: dict[str, JsonValue]

    @classmethod
    def of(cls, code: str, what: str) -> "MissingDocument":
        return cls(code=code, what=str(what), **as_sentence(what).pair())


class LookDocument(Answer):
    """What the camera sees of the target: `corners` as [id, u, v] in px, of the `of` that it has.

    `sharpness`: of the edges relative to the contrast; `saturated`: share of the pixels that are white; `fill`: share
    of the picture that the target takes. All three where the target is, else of the whole picture, with `fill` 0.
    `bits` of a grey level, `exposure_us` and `gain_db`: null for a camera that does not report them.
    """

    taken_at: str
    size: tuple[int, int]
    corners: list[tuple[int, float, float]]
    of: int
    missing: MissingDocument | None
    sharpness: float
    saturated: float
    fill: float
    bits: int | None = None
    exposure_us: float | None = None
    gain_db: float | None = None

    @classmethod
    def of_look(cls, look: Look) -> "LookDocument":
        seen, quality, capture = look.detection, look.quality, look.capture
        rows = [] if seen is None else zip(seen.ids.tolist(), seen.corners_px.tolist(), strict=True)
        return cls(
            taken_at=look.taken_at, size=look.size, of=look.of,
            corners=[(point, round(u, 2), round(v, 2)) for point, (u, v) in rows],
            missing=None if look.missing is None else MissingDocument.of(*look.missing),
            sharpness=round(quality.sharpness, 4), saturated=round(quality.saturated, 4), fill=round(quality.fill, 4),
            bits=None if capture is None else capture.bits,
            exposure_us=None if capture is None else capture.exposure_us,
            gain_db=None if capture is None else capture.gain_db,
        )  # fmt: skip


FAULT_EXAMPLE = {
    "code": "device-unreachable",
    "what": "not connected yet",
    "fix": "check its power, cable and address: handeyed check asks every device",
    "at": EXAMPLE_AT,
}


@dataclass(frozen=True, kw_only=True)
class DeviceDocument(DeviceState):
    """A device of the settings. `kind`: of its driver, by the address, which is shown without passwords."""

    __pydantic_config__: ClassVar = as_it_stands(
        name="camera", connected=False, detail="not connected yet", since=EXAMPLE_AT, last_error=FAULT_EXAMPLE,
        kind="http", address="http://camera/frame.png",
    )  # fmt: skip

    kind: str
    address: str


@dataclass(frozen=True, kw_only=True)
class CheckDocument(CheckResult):
    """One thing that was checked: `what` was found, and what to do when it is not well; and what both are made of."""

    __pydantic_config__: ClassVar = as_it_stands()

    what_detail: SentenceDocument
    fix_detail: SentenceDocument


class CheckList(Answer):
    """What `handeyed check` looks at, by the running daemon."""

    results: list[CheckDocument]


class CellScannerDocument(Answer):
    """A scanner by its name in the settings; `camera`: whose calibration places its clouds."""

    name: str
    camera: str
    poses: int


class ArmDocument(Answer):
    """What does not change while the daemon runs: the arm, its limits, the target, the poses of the settings.

    `setup`, `target`, `camera` and `taught_poses` are of the camera asked for; `cameras`: the names of all of them.
    `model` and `limits_deg` (lowest and highest of each axis) are null when the settings do not name the arm.
    `lengths_mm`: base to axis 2 forward and up, lower arm, axis 4 above axis 3, forearm, wrist to flange, axis 6 above
    axis 4; null for an arm with seven axes. `identifies_arm`: whether a calibration finds the arm's errors, too, where
    its request does not say.
    """

    model: str | None
    limits_deg: list[tuple[float, float]] | None
    reach_mm: float | None
    lengths_mm: tuple[float, ...] | None
    box_mm: tuple[Vector, Vector]
    speed_mm_s: float
    joint_travel_deg: float
    moves: bool
    setup: Setup
    target: TargetDocument
    target_points_mm: list[Vector]
    camera: CameraDocument | None
    taught_poses: list[TaughtPose]
    identifies_arm: bool
    scan_poses: list[TaughtPose]
    cameras: list[str]
    scanners: list[CellScannerDocument]

    @classmethod
    def of_settings(cls, settings: Settings, arm: AnyArm | None, moves: bool) -> "ArmDocument":
        robot, points = settings.robot, settings.target.points_mm
        bounds = None if arm is None else zip(arm.lower_rad, arm.upper_rad, strict=True)
        return cls(
            model=arm.name if arm else None,
            limits_deg=None if bounds is None else [(math.degrees(low), math.degrees(high)) for low, high in bounds],
            reach_mm=round(arm.reach_mm, 3) if arm else None,
            lengths_mm=lengths_mm(arm),
            box_mm=robot.box_mm,
            speed_mm_s=robot.speed_mm_s,
            joint_travel_deg=robot.joint_travel_deg,
            moves=moves,
            setup=settings.camera.setup,
            target=settings.target,
            target_points_mm=[(float(x), float(y), float(z)) for x, y, z in points],
            camera=settings.camera.intrinsics,
            taught_poses=list(settings.calibration.poses),
            identifies_arm=settings.calibration.arm,
            scan_poses=list(settings.scanner.poses) if settings.scanner else [],
            cameras=list(settings.camera_names),
            scanners=[
                CellScannerDocument(name=name, camera=scanner.camera, poses=len(scanner.poses))
                for name, scanner in settings.named_scanners().items()
            ],
        )


class ForesightDocument(Answer):
    """The poses that a run would take from where the arm stands, and what U (k = 2, mm) would be after each.

    `predicted_mm`: at the worst of the points that matter; null before the views determine X.
    `note`: what was assumed, or why nothing can be planned before the first views.
    """

    poses: list[PlannedPoseDocument]
    predicted_mm: list[float | None]
    note: str

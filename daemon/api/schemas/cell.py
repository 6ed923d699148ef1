"""Schemas of the cell's state. Lengths mm, angles deg, quaternions scalar first."""

import math
from typing import Literal

from calibration.documents.pose import PoseDocument, Vector
from calibration.kinematics.arm import Arm
from daemon.api.schemas.answer import EXAMPLE_AT, Answer, example
from daemon.cell.device_watch import DeviceState
from daemon.cell.readings import RobotReading
from daemon.cell.skeleton import skeleton_mm
from daemon.sessions.look import Look
from drivers.interfaces import LinkHealth


class RobotDocument(Answer):
    """The pose of the arm and the status of the controller.

    `skeleton_mm`: base, shoulder, elbow, wrist and flange in the base frame; null, as `model`, when the settings do not
    name the arm. `mode`: "manual" whenever the controller is not in automatic mode.
    """

    connected: bool
    detail: str
    base_T_flange: PoseDocument
    configuration: tuple[int, int, int, int]
    joints_deg: list[float]
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

    @classmethod
    def of(cls, reading: RobotReading, link: LinkHealth, holder: str | None, arm: Arm | None) -> "RobotDocument":
        status, pose = reading.status, reading.pose
        cf1, cf4, cf6, cfx = pose.posture
        return cls(
            connected=link.connected,
            detail=link.detail,
            base_T_flange=PoseDocument.of(pose.base_T_flange),
            configuration=(cf1, cf4, cf6, cfx),
            joints_deg=[math.degrees(angle) for angle in reading.joints],
            still=pose.still,
            motors_on=status.motors_on,
            automatic=status.automatic,
            emergency_stop=status.emergency_stop,
            moving=status.moving,
            armed=status.armed,
            program_running=status.program_running,
            speed_limited=status.speed_limited,
            held_by=holder,
            mode="automatic" if status.automatic else "manual",
            model=arm.name if arm else None,
            skeleton_mm=skeleton_mm(arm, reading.joints),
        )


class MissingDocument(Answer):
    """Why the target was not found: a stable code and a sentence."""

    code: str
    what: str


class LookDocument(Answer):
    """What the camera sees of the target: `corners` as [id, u, v] in px, of the `of` that it has.

    `sharpness`: of the edges relative to the contrast; `saturated`: share of the pixels that are white; `fill`: share
    of the picture that the target takes. All three where the target is, else of the whole picture, with `fill` 0.
    """

    taken_at: str
    size: tuple[int, int]
    corners: list[tuple[int, float, float]]
    of: int
    missing: MissingDocument | None
    sharpness: float
    saturated: float
    fill: float

    @classmethod
    def of_look(cls, look: Look) -> "LookDocument":
        seen, quality = look.detection, look.quality
        rows = [] if seen is None else zip(seen.ids.tolist(), seen.corners_px.tolist(), strict=True)
        return cls(
            taken_at=look.taken_at, size=look.size, of=look.of,
            corners=[(point, round(u, 2), round(v, 2)) for point, (u, v) in rows],
            missing=None if look.missing is None else MissingDocument(code=look.missing[0], what=look.missing[1]),
            sharpness=round(quality.sharpness, 4), saturated=round(quality.saturated, 4), fill=round(quality.fill, 4),
        )  # fmt: skip


class DeviceFaultDocument(Answer):
    """An error of a device, and when it was noted."""

    code: str
    what: str
    fix: str
    at: str


class LiveDevice(Answer):
    """The link of a device. `since`: of this state; `last_error` stays when it is over."""

    model_config = example(
        name="camera", connected=False, detail="not connected yet", since=EXAMPLE_AT,
        last_error={"code": "device-unreachable", "what": "not connected yet", "fix": "check its power, cable and"
                    " address: handeyed check asks every device", "at": EXAMPLE_AT},
    )  # fmt: skip

    name: str
    connected: bool
    detail: str
    since: str
    last_error: DeviceFaultDocument | None

    @classmethod
    def of(cls, state: DeviceState) -> "LiveDevice":
        fault = state.last_error
        return cls(
            name=state.name, connected=state.connected, detail=state.detail, since=state.since,
            last_error=None if fault is None else DeviceFaultDocument(**vars(fault)),
        )  # fmt: skip

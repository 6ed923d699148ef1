"""Bodies of the requests that start something."""

import math
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, ConfigDict, Field, model_validator

from calibration.documents.knowledge import KnowledgeDocument
from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.requirement import Tolerance
from calibration.documents.session import SessionDocument
from calibration.documents.target import TargetDocument
from calibration.documents.validation import Document
from calibration.problem import AxisOffset
from daemon.access.actor_names import imitates_actor, validate_key_name
from daemon.config.settings import DeviceName, TaughtPose


def examples(*bodies: dict[str, Any]) -> ConfigDict:
    """A `model_config` with examples for openapi.json."""
    return ConfigDict(json_schema_extra={"examples": list(bodies)})


_SEEN = {"translation_mm": [12.0, -8.0, 520.0], "quaternion_wxyz": [0.0, 1.0, 0.0, 0.0]}
_POSE = {"translation_mm": [900.0, -250.0, 900.0], "quaternion_wxyz": [0.0, 0.6, 0.8, 0.0]}

MAX_JOG_MM, MAX_JOG_DEG = 100.0, 30.0
"""Limits of one jog, of the flange and of an axis."""

MAX_HELD_MM_S = 50.0
"""Speed of a held move: the arm goes on for some tenths of a second after the button is let go."""

Degrees = Annotated[float, Field(ge=-720, le=720)]
HoldName = Annotated[str, Field(min_length=8, max_length=64)]
Stations = Annotated[tuple[TaughtPose, ...], Field(min_length=1, max_length=100)]


NAME_PATTERN = r"^[^\x00-\x1f\x7f-\x9f\xad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff]*$"
"""No control characters (C0, C1), and none that change the direction of text or cannot be seen: names are printed."""


def require_printable(name: str) -> str:
    if not name.isprintable():
        raise ValueError("it has a character that cannot be printed; leave it out")
    return name


def _validate_applied_by(name: str) -> str:
    if imitates_actor(name) or not name.isprintable():
        raise ValueError("the audit log calls another actor so; choose another")
    return name


class CalibrateRequest(Document):
    """Everything is optional: poses of the flange (else taught ones, else planned ones), how many, another target.

    `tolerance_mm`: largest U (k = 2) at the worst of the points that matter; the verdict applies it in place of the
    settings', and planning ends when it is met. `uncertainty_mm`: planning ends when a measured point is known to
    this (one sigma). With either, `count` is the most.
    `manual`: the operator jogs the arm, by joystick or with POST /runs/{id}/jog, and takes each view with
    POST /runs/{id}/stations; nothing else moves it.
    `axis_offset`: of an arm that turns its flange about one axis only, in place of the settings'.
    `arm`: the errors of the arm as built are identified, too: GET /calibrations/{id}/arm. [robot] model names the arm.
    Without it as [calibration] arm says.
    `camera`: name of one of [cameras]; [camera] without it. `together`: names of further cameras, and of scanners with
    organised clouds, on the same mount: each looks from every station, and all are solved in one estimate (GET /rigs).
    """

    model_config = examples(
        {}, {"count": 8, "tolerance_mm": 0.3}, {"count": 8, "uncertainty_mm": 0.1}, {"poses": [_POSE, _POSE, _POSE]}
    )

    poses: Annotated[tuple[TaughtPose, ...], Field(min_length=3, max_length=100)] | None = None
    count: Annotated[int, Field(ge=3, le=100)] | None = None
    uncertainty_mm: Tolerance | None = None
    tolerance_mm: Tolerance | None = None
    target: TargetDocument | None = None
    manual: bool = False
    arm: bool | None = None
    camera: DeviceName | None = None
    together: Annotated[tuple[DeviceName, ...], Field(min_length=1, max_length=3)] | None = None
    axis_offset: AxisOffset | None = None

    @model_validator(mode="after")
    def _check_manual(self) -> "CalibrateRequest":
        if self.manual and self.poses is not None:
            raise ValueError("poses are driven to, and in a manual run nothing moves the arm: leave one of them out")
        return self


class ArtefactRequest(Document):
    """A sphere's calibrated radius; with `spacing_mm` a ball bar, whose two centres are so far apart."""

    radius_mm: Annotated[float, Field(gt=0, le=10_000)]
    """Calibrated radius, mm."""
    spacing_mm: Annotated[float, Field(gt=0, le=100_000)] | None = None
    """Calibrated distance of the two centres, mm; null without a ball bar."""


class VerifyRequest(Document):
    """Poses to look at the target from; by default three of those a calibration would take.

    `tolerance_mm`: U (k = 2) that the active calibration shall have at the worst of the points that matter, and twice
    the largest standard deviation of a point of the target over the poses; by default the settings'.
    `camera`: name of one of [cameras]; [camera] without it.
    With `artefact` and `scan_id` the scanner is verified instead: each view of that scan is a position of the artefact.
    """

    model_config = examples(
        {}, {"tolerance_mm": 0.3}, {"scan_id": "20261121-090000-3f9a1c", "artefact": {"radius_mm": 25.0}}
    )

    poses: Annotated[tuple[TaughtPose, ...], Field(min_length=2, max_length=100)] | None = None
    tolerance_mm: Tolerance | None = None
    target: TargetDocument | None = None
    artefact: ArtefactRequest | None = None
    scan_id: Annotated[str, Field(min_length=1, max_length=64)] | None = None
    camera: DeviceName | None = None

    @model_validator(mode="after")
    def _check_kind(self) -> "VerifyRequest":
        if (self.artefact is None) != (self.scan_id is None):
            raise ValueError("a scanner is verified with artefact and scan_id: give both, or neither")
        of_camera = (self.poses, self.target, self.tolerance_mm)
        if self.artefact is not None and any(value is not None for value in of_camera):
            raise ValueError(
                "poses, target and tolerance_mm belong to the camera's verification: leave them out beside artefact"
            )
        return self


class ScanRequest(Document):
    """A new scan. With `poses`, or `capture`, the arm is driven and the daemon's scanner fills it.

    `refine`: after each view the views are fitted to each other in the background, within the robot's noise.
    `scanner`: name of one of [scanners], whose clouds the scan is to hold; [scanner] without it.
    """

    model_config = examples({"name": "door 4711"}, {"name": "door 4711", "capture": True, "refine": True})

    name: Annotated[str, Field(max_length=200, pattern=NAME_PATTERN), AfterValidator(require_printable)] = ""
    capture: bool = False
    refine: bool = False
    poses: Stations | None = None
    scanner: DeviceName | None = None


class JogRequest(Document):
    """A jog of the arm: at most 100 mm and 30 deg, a move of all axes to their angles, or a held move; one of four.

    `axis` (from 1) turns by `by_deg`. `joints_deg`: all axes go to these angles, each by at most [robot]
    joint_travel_deg. `shift_mm` and `turn_deg` (rotation vector) move the flange along and about the axes of `frame`,
    the turn about the flange's origin. `speed_mm_s`: of the fastest point, at most [robot] speed_mm_s.
    `to` moves the flange to a pose in the base, by steps of 20 mm and 2 deg, while POST /runs/{id}/hold says that a
    button is held; at most 50 mm/s. `hold` is a new name of that button. Nothing moves before the first such word.
    """

    model_config = examples(
        {"axis": 6, "by_deg": -10.0}, {"frame": "flange", "shift_mm": [0.0, 0.0, -50.0], "speed_mm_s": 25.0}
    )

    axis: Annotated[int, Field(ge=1, le=7)] | None = None
    by_deg: Annotated[float, Field(ge=-MAX_JOG_DEG, le=MAX_JOG_DEG)] | None = None
    joints_deg: Annotated[tuple[Degrees, ...], Field(min_length=6, max_length=7)] | None = None
    frame: Literal["base", "flange"] = "base"
    shift_mm: Vector | None = None
    turn_deg: Vector | None = None
    to: PoseDocument | None = None
    hold: Annotated[HoldName | None, Field(exclude=True)] = None
    speed_mm_s: Annotated[float, Field(ge=1, le=250)] | None = None

    @model_validator(mode="after")
    def _check_one_move(self) -> "JogRequest":
        by_axis, by_step, held = (self.axis, self.by_deg), (self.shift_mm, self.turn_deg), (self.to, self.hold)
        given = (by_axis != (None, None), self.joints_deg is not None, by_step != (None, None), held != (None, None))
        if sum(given) != 1 or (given[0] and None in by_axis) or (given[3] and None in held):
            raise ValueError("give axis with by_deg, joints_deg, shift_mm, turn_deg, or to with hold: one of the four")
        if self.to is not None and (self.speed_mm_s or 0.0) > MAX_HELD_MM_S:
            raise ValueError(f"a held move has at most {MAX_HELD_MM_S:g} mm/s: give a lower speed_mm_s")
        for name, step, most in (("shift_mm", self.shift_mm, MAX_JOG_MM), ("turn_deg", self.turn_deg, MAX_JOG_DEG)):
            if step is not None and math.hypot(*step) > most:
                raise ValueError(f"{name} is longer than {most:g}: take several steps")
        return self


class HoldRequest(Document):
    """A button is held, or was let go. `hold`: its name, of the request to move; `at_s`: by any clock of the screen."""

    model_config = examples({"hold": "3f9a1c0b77d2", "at_s": 12.25})

    hold: HoldName
    at_s: Annotated[float, Field(ge=0, le=1e9)] = 0.0
    released: bool = False


class ApplyRequest(Document):
    """Who applies a calibration, and why; a rejected one is applied only when `despite_verdict` says so."""

    model_config = examples(
        {"applied_by": "Ann"}, {"applied_by": "Ann", "despite_verdict": True, "reason": "for a trial without a part"}
    )

    applied_by: Annotated[
        str, Field(min_length=1, max_length=200, pattern=NAME_PATTERN), AfterValidator(_validate_applied_by)
    ] = "operator"
    despite_verdict: bool = False
    reason: Annotated[str, Field(max_length=500, pattern=NAME_PATTERN), AfterValidator(require_printable)] = ""


class SetupRequest(Document):
    """The set-up code from the daemon's log, and a name for the first key."""

    model_config = examples({"code": "ABCD-EFGH-JKLM-NPQR", "name": "Ann"})

    code: Annotated[str, Field(min_length=1, max_length=100)]
    name: Annotated[
        str, Field(min_length=1, max_length=100, pattern=NAME_PATTERN), AfterValidator(validate_key_name)
    ] = "admin"


class SupportBundleRequest(Document):
    """What a support bundle holds beside texts; {} for texts alone. `pictures`: those of the newest run."""

    model_config = examples({"pictures": False})

    pictures: bool = False


class SessionRequest(Document):
    """An API key, or a pairing code from a screen that is signed in."""

    model_config = examples({"code": "ABCD-EFGH"})

    key: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    code: Annotated[str, Field(min_length=1, max_length=100)] | None = None

    @model_validator(mode="after")
    def _check_one(self) -> "SessionRequest":
        if (self.key is None) == (self.code is None):
            raise ValueError("give key or code, one of the two")
        return self


class PairingRequest(Document):
    """Up to which role the other screen may act; by default that of the caller."""

    model_config = examples({}, {"role": "viewer"})

    role: Literal["viewer", "operator", "admin"] | None = None


class ObservationsRequest(SessionDocument):
    """A session as in session.json whose views need no file: a robot pose each, and what another program has measured.

    `corners_px`: [id, u, v] of the target's points in a picture; `points_mm`: [id, x, y, z] of them in the camera's
    frame; `camera_T_target`: the target's pose in the camera, with its `covariance` where that is known.
    `arm`: the errors of this cell's arm are identified, too, from `corners_px` and `joints_deg`.
    """

    model_config = examples(
        {"schema_version": 1, "setup": "eye-in-hand", "views": [{"base_T_flange": _POSE, "camera_T_target": _SEEN}] * 3}
    )

    arm: bool = False


class SolveRequest(Document):
    """Solve a calibration's session again: without some of its views (from 0), or with another method.

    `known`: what is known of target, camera or arm, in place of what the session states of it.
    """

    model_config = examples({"without": [2]}, {"method": "park"}, {"known": {"target": {"source": "certified"}}})

    without: Annotated[tuple[Annotated[int, Field(ge=0, le=999)], ...], Field(max_length=1000)] = ()
    method: Literal["auto", "three-pose", "tsai", "park", "horaud", "daniilidis", "shah", "kronecker"] = "auto"
    known: KnowledgeDocument = KnowledgeDocument()


class NewKeyRequest(Document):
    """A key for a person or a program. `days` null: it never expires."""

    model_config = examples({"name": "MES", "role": "operator"})

    name: Annotated[str, Field(min_length=1, max_length=100, pattern=NAME_PATTERN), AfterValidator(validate_key_name)]
    role: Literal["viewer", "operator", "admin"]
    days: Annotated[float, Field(gt=0, le=36_500)] | None = 365.0


class RotateKeyRequest(Document):
    """A new key of the same name and role; the old one ends after `overlap_h`."""

    model_config = examples({}, {"overlap_h": 0})

    days: Annotated[float, Field(gt=0, le=36_500)] | None = 365.0
    overlap_h: Annotated[float, Field(ge=0, le=8760)] = 24.0

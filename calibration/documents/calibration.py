"""calibration.json: what `handeyed solve DIR --json` prints and the daemon stores (mm, degrees, w first)."""

from collections.abc import Sequence
from math import degrees
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import Field, JsonValue, model_validator

from calibration.documents.external_axis import FoundAxisDocument
from calibration.documents.knowledge import NoiseBeliefDocument
from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.requirement import LimitsInForceDocument, renamed
from calibration.documents.session import CameraDocument
from calibration.documents.target import TargetDocument, document_of_target
from calibration.documents.validation import Document
from calibration.likelihood.mapped_points import scale_variance_mm2
from calibration.planning.expectation import NOTHING_EXPECTED, Expectation
from calibration.problem import ANCHORS, MOUNTS, AxisOffset, Setup
from calibration.sentences.sentence import AS_WRITTEN, Sentence, as_sentence, is_known
from calibration.solution import (
    COVERAGE_FACTOR,
    ArmScale,
    ClockOffsetDocument,
    Finding,
    HoldOutDocument,
    LeaveOutDocument,
    Noise,
    PointFrame,
    Solution,
    ViewResult,
    worst_of,
)
from calibration.targets import Target
from calibration.transforms import Array
from calibration.verdict import Verdict


def upgrade_calibration(data: dict[str, Any]) -> dict[str, Any]:
    """The content of a calibration.json of version 1 as one of version 2; `data` is left as it is.

    Its sentences become those of the id AS_WRITTEN; anything unexpected is left for the model to refuse.
    """
    upgraded = {**data, "schema_version": 2}
    verdict = data.get("verdict")
    if isinstance(verdict, dict) and isinstance(verdict.get("findings"), list):
        upgraded["verdict"] = {**verdict, "findings": [_finding(finding) for finding in verdict["findings"]]}
    return upgraded


def _finding(finding: Any) -> Any:
    if not isinstance(finding, dict):
        return finding
    return {**finding, **_as_written(finding.get("message")), "advice": _as_written(finding.get("fix"))}


def _as_written(text: Any) -> dict[str, Any]:
    return {"id": AS_WRITTEN, "params": {"sentence": text}}


TRANSFORM_NAMES = {setup: (f"{MOUNTS[setup]}_T_camera", f"{ANCHORS[setup]}_T_target") for setup in get_args(Setup)}
"""Document keys of `mount_T_camera` and `anchor_T_target` in each set-up."""


class EstimatedCameraDocument(CameraDocument):
    """A camera, and where it came from."""

    source: Literal["given", "estimated"]
    """given or estimated."""


COVARIANCE_ORDER = ("rotation_x_rad", "rotation_y_rad", "rotation_z_rad", "x_mm", "y_mm", "z_mm")
"""Rows and columns of the covariance of X @ exp(.): a small turn about, and a shift along, the camera's axes."""

Six = tuple[float, float, float, float, float, float]


class PlaceDocument(Document):
    """A point that matters."""

    name: str
    """What the point is called."""
    frame: PointFrame
    """base or camera."""
    position_mm: Vector
    """x, y, z in `frame`, mm."""


class PointUncertaintyDocument(PlaceDocument):
    """One of the points that matter; of several views' places of it the most uncertain one."""

    camera_mm: Vector
    """The point in the camera's frame, mm."""
    sigma_mm: float
    """Standard deviation over three axes together, mm."""
    expanded_mm: float
    """U = coverage_factor x sigma_mm, mm."""


class ArmScaleDocument(Document):
    """Lengths by the arm over true ones: the logarithm, its standard deviation, its covariance with X.

    X is in the arm's millimetres, a cloud in the scanner's: a registered point is uncertain by this as well.
    """

    log: float
    """Logarithm of the ratio. No unit."""
    sigma: float
    """Its standard deviation. No unit."""
    covariance_with_x: Six
    """Its covariance with the motion v of X: rad and mm, in covariance_order."""

    def scale(self) -> ArmScale:
        return ArmScale(self.log, self.sigma**2, np.array(self.covariance_with_x))


class UncertaintyDocument(Document):
    """Of X, and of the points that matter; null and empty in a calibration that was written as version 1."""

    translation_mm: Vector
    """One standard deviation along the mount's axes, mm."""
    rotation_deg: Vector
    """One standard deviation about the camera's axes, degrees."""
    point_mm: float
    """One standard deviation of a measured point, mm, RMS over the working volume."""
    covariance: tuple[Six, Six, Six, Six, Six, Six] | None = None
    """6 x 6 of a small motion v after X, X @ exp(v): rad and mm, in covariance_order."""
    covariance_frame: Literal["camera"] = "camera"
    """Axes of the covariance: camera."""
    covariance_order: tuple[str, str, str, str, str, str] = COVARIANCE_ORDER
    """Names of its rows and columns."""
    coverage_factor: float = COVERAGE_FACTOR
    """k: U is k times the standard deviation."""
    points: tuple[PointUncertaintyDocument, ...] = ()
    """Uncertainty at the points that matter."""
    leave_out: LeaveOutDocument | None = None
    """A second estimate, by leaving out groups of views; null below 8 views."""
    arm_scale: ArmScaleDocument | None = None
    """Lengths by the arm over the scanner's; null where it is not estimated."""

    def matrix(self) -> Array | None:
        """The covariance (6, 6) of [rotation rad, translation mm], None in one written as version 1."""
        return None if self.covariance is None else np.array(self.covariance)

    def registered_expanded_mm(self, point: PointUncertaintyDocument) -> float:
        """U (k = 2) of a cloud's point there, in the base: with the scale between scanner and arm."""
        at = np.array(point.camera_mm)
        more = 0.0 if self.arm_scale is None else scale_variance_mm2(self.arm_scale.scale(), at)
        return self.coverage_factor * float(np.sqrt(max(point.sigma_mm**2 + more, 0.0)))

    @property
    def worst_point(self) -> PointUncertaintyDocument | None:
        """The most uncertain of the points that matter, None in one written as version 1."""
        return worst_of(self.points) if self.points else None


class NoiseDocument(Document):
    """Estimated from the data; null where it cannot be."""

    image_px: float | None
    """Noise of a detected point, px, one standard deviation per axis."""
    robot_rotation_deg: float | None
    """Noise of the robot's rotation, degrees, one standard deviation per axis."""
    robot_translation_mm: float | None
    """Noise of the robot's translation, mm, one standard deviation per axis."""
    belief: NoiseBeliefDocument | None = None
    """What is believed of the robot's noise after the session."""


class CorrectionDocument(Document):
    """The estimated error of one robot pose: vectors in mm and degrees."""

    translation_mm: Vector
    """Error of the translation x, y, z, mm."""
    rotation_deg: Vector
    """Error of the rotation as a rotation vector, degrees."""


class SentenceDocument(Document):
    """What a sentence is made of: its id in the table of sentences and its parameters, to be said in any language."""

    id: str
    """Of the sentence, in the table of sentences."""
    params: dict[str, JsonValue]
    """Values of the sentence's places."""

    @staticmethod
    def each_of(texts: Sequence[str]) -> "list[SentenceDocument]":
        """One for each text; of the id "as-written" for those that no table holds."""
        return [SentenceDocument(**as_sentence(text).pair()) for text in texts]


class ReasonDocument(SentenceDocument):
    """A sentence, and what it is made of."""

    message: str
    """A sentence."""

    @classmethod
    def of(cls, text: str) -> "ReasonDocument":
        sentence = as_sentence(text)
        return cls(**sentence.pair(), message=str(sentence))


class ViewResultDocument(Document):
    """How one view fits."""

    index: int
    """Of the view, from 0."""
    image: str | None
    """Name of the view's picture in the session's folder; null where there is none."""
    status: Literal["used", "corrected", "rejected"]
    """used, corrected or rejected."""
    reason: str | None
    """Code of reason_detail."""
    reason_detail: ReasonDocument | None = None
    """Why the view was not used as it came."""
    reprojection_px: float | None
    """RMS distance of points from where they are predicted, px."""
    base_error_mm: float | None
    """RMS distance in the base, mm."""
    robot_correction: CorrectionDocument | None
    """The estimated error of the robot's pose."""
    joints_deg: tuple[float, ...] | None = None
    """Joint angles where they were recorded, degrees."""
    camera_temperature_c: float | None = None
    """Temperature of the camera where it was recorded, degrees Celsius."""


class ObservabilityDocument(Document):
    """The turns of the flange, and what they determine worst."""

    views_used: int
    """Number of views used."""
    max_rotation_deg: float
    """Largest turn between two views, degrees."""
    axis_spread: float
    """0: parallel axes, 1: evenly spread. No unit."""
    weakest_direction: str
    """What the views determine worst, in words."""


class FindingDocument(Document):
    """Something a person should know."""

    code: str
    """Stable code of the finding."""
    severity: Literal["error", "warning", "info"]
    """error, warning or info."""
    message: str
    """A sentence."""
    fix: str
    """What to do, a sentence."""
    effect_mm: float | None = None
    """By how much a measured point moves with the cause taken into account, mm; null where not known."""


class VerdictDocument(Document):
    """May it be used?"""

    accepted: bool
    """Whether the result may be used."""
    findings: list[FindingDocument]
    """What a person should know, the most severe first."""


class CalibrationFindingDocument(FindingDocument):
    """A finding, with what `message` (id, params) and `fix` (advice) are made of."""

    id: str
    """Of the sentence, in the table of sentences."""
    params: dict[str, JsonValue]
    """Values of the sentence's places."""
    advice: SentenceDocument
    """Id and parameters of the fix."""

    @classmethod
    def of(cls, finding: Finding) -> "CalibrationFindingDocument":
        message, fix = as_sentence(finding.message), as_sentence(finding.fix)
        return cls(
            code=finding.code, severity=finding.severity, message=str(message), fix=str(fix), **message.pair(),
            advice=SentenceDocument(**fix.pair()), effect_mm=finding.effect_mm,
        )  # fmt: skip


def errors_of(findings: Sequence[FindingDocument]) -> list[Sentence]:
    """What the errors among them say; where to look when there are none."""
    errors = [
        Sentence(one.id, **one.params) if isinstance(one, CalibrationFindingDocument) and is_known(one.id)
        else as_sentence(one.message) for one in findings if one.severity == "error"
    ]  # fmt: skip
    return errors or [Sentence("see-verdict")]


class CalibrationVerdictDocument(Document):
    """May it be used? Without limits and rule in a calibration that was written as version 1."""

    accepted: bool
    """Whether the calibration may be used."""
    findings: list[CalibrationFindingDocument]
    """What a person should know, the most severe first."""
    limits: LimitsInForceDocument | None = None
    """The limits in force when it was judged."""
    rule: ReasonDocument | None = None
    """The rule by which it was judged."""


class AccuracyDocument(Document):
    """The one number of a calibration, beside what it is judged by; null where it is not known."""

    expanded_mm: float | None = None
    """U (k = 2) at the worst of the points that matter, mm: the number that all places show; with the arm's errors
    where they were identified."""
    worst_point: str | None = None
    """The name of that point."""
    tolerance_mm: float | None = None
    """Largest U that is accepted, mm."""
    tolerance_stated: bool = False
    """Whether somebody stated the tolerance; else it is the default of 1 mm."""
    expected_mm: float | None = None
    """U that was expected of the same views, with the noise assumed before the run, mm."""
    before_mm: float | None = None
    """U of the calibration that was active when this one was made, mm."""
    why: ReasonDocument | None = None
    """Why expanded_mm and expected_mm part by more than a factor of 1.5."""

    def of_uncertainty(self, uncertainty: UncertaintyDocument | None) -> "AccuracyDocument":
        """The same with U by this uncertainty."""
        worst = None if uncertainty is None else uncertainty.worst_point
        now = {"expanded_mm": worst and worst.expanded_mm, "worst_point": worst and worst.name}
        return self.model_copy(update=now)

    def fields(self) -> dict[str, Any]:
        """As JSON values by name, for results and events."""
        return self.model_dump(mode="json")


def _accuracy(uncertainty: UncertaintyDocument | None, verdict: CalibrationVerdictDocument) -> AccuracyDocument:
    limits, accuracy = verdict.limits, AccuracyDocument()
    if limits is not None:
        accuracy = AccuracyDocument(tolerance_mm=limits.tolerance_mm, tolerance_stated=limits.tolerance_stated)
    return accuracy.of_uncertainty(uncertainty)


class CalibrationDocument(Document):
    """The whole of calibration.json. When the motions cannot determine X the transforms are null."""

    heading = "calibrationjson"

    schema_version: Literal[2] = 2
    """Version of the format."""
    id: str
    """Of the calibration; later ones sort later."""
    created_at: str
    """UTC, ISO 8601."""
    software: str
    """handeyed and its version."""
    setup: Setup
    """eye-in-hand: the camera is on the flange; eye-to-hand: the camera stands in the cell."""
    method: str
    """auto (maximum likelihood) or the name of a closed form."""
    flange_T_camera: PoseDocument | None = None
    """Eye-in-hand: the camera on the flange, mm; null where it is not determined."""
    base_T_target: PoseDocument | None = None
    """Eye-in-hand: the target in the base, mm."""
    base_T_camera: PoseDocument | None = None
    """Eye-to-hand: the camera in the base, mm; null where it is not determined."""
    flange_T_target: PoseDocument | None = None
    """Eye-to-hand: the target on the flange, mm."""
    camera: EstimatedCameraDocument | None
    """Intrinsics that the calibration used; null where it used none."""
    uncertainty: UncertaintyDocument | None
    """Of X; null without X."""
    noise: NoiseDocument
    """Noise that was estimated from the data."""
    views: list[ViewResultDocument]
    """One entry for each view."""
    observability: ObservabilityDocument
    """How well the motions determine X."""
    hold_out: HoldOutDocument | None
    """Each view left out in turn; null below 4 views."""
    clock_offset: ClockOffsetDocument | None = None
    """Of a line profiler's clock; null for other sensors."""
    axis_offset: AxisOffset | None = None
    """A coordinate measured along the only axis of rotation of an arm that cannot tilt; else null."""
    external_axis: FoundAxisDocument | None = None
    """A track or turntable that the controller leaves out of its poses; else null."""
    target: TargetDocument | None = None
    """The target as it was described."""
    target_scale: Annotated[float, Field(gt=0)] = 1.0
    """Size of the target over the described one, as found with X. No unit."""
    verdict: CalibrationVerdictDocument
    """Whether it may be used, and why not."""
    accuracy: AccuracyDocument = Field(default_factory=lambda data: _accuracy(data["uncertainty"], data["verdict"]))
    """U (k = 2) at the worst of the points that matter, beside what it is judged by."""

    @property
    def mount_T_camera(self) -> PoseDocument | None:
        """X: of a camera on the flange in the flange, of one beside the robot in the base."""
        return self.flange_T_camera if self.setup == "eye-in-hand" else self.base_T_camera

    @property
    def anchor_T_target(self) -> PoseDocument | None:
        """The target's pose: beside the robot in the base, on the flange in the flange."""
        return self.base_T_target if self.setup == "eye-in-hand" else self.flange_T_target

    def scale_of(self, target: Target) -> float:
        """Size of `target` over the described one: as found with X where this is the target that was looked at."""
        return self.target_scale if self.target is not None and self.target == target else 1.0

    def with_accuracy(self, **known: Any) -> "CalibrationDocument":
        """The same with these fields of its accuracy."""
        return self.model_copy(update={"accuracy": self.accuracy.model_copy(update=known)})

    @model_validator(mode="before")
    @classmethod
    def _read_version_1(cls, data: Any) -> Any:
        return upgrade_calibration(data) if isinstance(data, dict) and data.get("schema_version") == 1 else data


def calibration_document(
    solution: Solution,
    verdict: Verdict,
    *,
    calibration_id: str,
    created_at: str,
    software: str,
    target: Target | None = None,
    expected: Expectation = NOTHING_EXPECTED,
) -> CalibrationDocument:
    """The calibration.json of a solution and its verdict; the transforms are null when they are not determined.

    `target`: that of the session, where it was one.
    """
    camera = solution.camera
    transforms = zip(TRANSFORM_NAMES[solution.setup], (solution.mount_T_camera, solution.anchor_T_target), strict=True)
    document = CalibrationDocument.model_validate(
        {
            "id": calibration_id,
            "created_at": created_at,
            "software": software,
            "setup": solution.setup,
            "method": solution.method,
            **{name: PoseDocument.of(a_T_b) for name, a_T_b in transforms if a_T_b is not None},
            "camera": camera and {**vars(CameraDocument.of(camera)), "source": solution.camera_source},
            "uncertainty": _uncertainty(solution),
            "noise": _noise(solution.noise),
            "views": [_view(view) for view in solution.views],
            "observability": renamed(vars(solution.observability), "_rad", "_deg", degrees),
            "hold_out": solution.hold_out and vars(solution.hold_out),
            "clock_offset": solution.clock_offset and vars(solution.clock_offset),
            "axis_offset": solution.axis_offset and vars(solution.axis_offset),
            "external_axis": solution.external_axis and FoundAxisDocument.of(solution.external_axis),
            "target": None if target is None else document_of_target(target),
            "target_scale": solution.target_scale,
            "verdict": _verdict(verdict),
        }
    )
    return document.with_accuracy(
        expected_mm=expected.expanded_mm, why=None if expected.why is None else ReasonDocument.of(expected.why)
    )


def _verdict(verdict: Verdict) -> dict[str, object]:
    limits = verdict.limits
    rule = "rule" if limits.tolerance_stated else "rule-not-stated"
    by = Sentence(rule, coverage_factor=COVERAGE_FACTOR, tolerance_mm=limits.tolerance_mm)
    return {
        "accepted": verdict.accepted,
        "findings": [CalibrationFindingDocument.of(finding) for finding in verdict.findings],
        "limits": renamed(vars(limits), "_rad", "_deg", lambda angle_rad: round(degrees(angle_rad), 9)),
        "rule": ReasonDocument.of(by),
    }


def _uncertainty(solution: Solution) -> dict[str, object] | None:
    if solution.uncertainty is None:
        return None
    scale = solution.uncertainty.arm_scale
    return {
        "translation_mm": solution.uncertainty.translation_mm.tolist(),
        "rotation_deg": np.degrees(solution.uncertainty.rotation_rad).tolist(),
        "point_mm": solution.uncertainty.point_mm,
        "covariance": solution.uncertainty.covariance.tolist(),
        "points": [{**vars(point), "expanded_mm": point.expanded_mm} for point in solution.uncertainty.points],
        "leave_out": solution.leave_out and vars(solution.leave_out),
        "arm_scale": scale
        and {"log": scale.log, "sigma": float(np.sqrt(scale.variance)), "covariance_with_x": scale.with_x.tolist()},
    }


def _noise(noise: Noise) -> dict[str, object]:
    rotation_rad = noise.robot_rotation_rad
    return {
        "image_px": noise.image_px,
        "robot_rotation_deg": None if rotation_rad is None else float(np.degrees(rotation_rad)),
        "robot_translation_mm": noise.robot_translation_mm,
        "belief": None if noise.belief is None else NoiseBeliefDocument.of(noise.belief),
    }


def _view(view: ViewResult) -> dict[str, object]:
    return {
        "index": view.index,
        "image": view.image,
        "status": view.status,
        "reason": view.reason,
        "reason_detail": view.reason and ReasonDocument.of(_why(view)),
        "reprojection_px": view.reprojection_px,
        "base_error_mm": view.base_error_mm,
        "robot_correction": _correction(view.robot_correction),
        "joints_deg": None if view.joints_rad is None else np.degrees(view.joints_rad).round(6).tolist(),
        "camera_temperature_c": view.camera_temperature_c,
    }


def _why(view: ViewResult) -> str:
    """The sentence of a view's reason."""
    known = f"view-{view.reason}"
    return view.why or (Sentence(known) if is_known(known) else str(view.reason))


def _correction(correction: tuple[Array, Array] | None) -> dict[str, object] | None:
    if correction is None:
        return None
    translation_mm, rotation_rad = correction
    return {"translation_mm": translation_mm.tolist(), "rotation_deg": np.degrees(rotation_rad).tolist()}

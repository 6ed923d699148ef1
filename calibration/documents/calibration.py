"""calibration.json: what `handeyed solve DIR --json` prints and the daemon stores (mm, degrees, w first)."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import Field, JsonValue, model_validator

from calibration.documents.external_axis import FoundAxisDocument
from calibration.documents.knowledge import NoiseBeliefDocument
from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.requirement import LimitsInForceDocument
from calibration.documents.session import AxisOffsetDocument, CameraDocument
from calibration.documents.target import TargetDocument, document_of_target
from calibration.documents.validation import Document
from calibration.likelihood.mapped_points import scale_variance_mm2
from calibration.planning.expectation import NOTHING_EXPECTED, Expectation
from calibration.problem import ANCHORS, MOUNTS, Setup
from calibration.sentences.english import ENGLISH
from calibration.sentences.sentence import AS_WRITTEN, Sentence, as_sentence
from calibration.solution import (
    COVERAGE_FACTOR,
    ArmScale,
    Finding,
    GroupedBy,
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


COVARIANCE_ORDER = ("rotation_x_rad", "rotation_y_rad", "rotation_z_rad", "x_mm", "y_mm", "z_mm")
"""Rows and columns of the covariance of X @ exp(.): a small turn about, and a shift along, the camera's axes."""

Six = tuple[float, float, float, float, float, float]


class PointUncertaintyDocument(Document):
    """One of the points that matter: a standard deviation over its three axes, and U = coverage factor times it.

    `camera_mm`: where it is in the camera's frame; of several views' places the most uncertain one.
    """

    name: str
    frame: PointFrame
    position_mm: Vector
    camera_mm: Vector
    sigma_mm: float
    expanded_mm: float


class LeaveOutDocument(Document):
    """Uncertainty of a mapped point by leaving out groups of views, beside the model's; see `solution.LeaveOut`."""

    point_mm: float
    ratio: float
    redundancy: float
    share: float
    grouped_by: GroupedBy
    groups: int


class ArmScaleDocument(Document):
    """Lengths by the arm over true ones: the logarithm, its standard deviation, its covariance with X.

    X is in the arm's millimetres, a cloud in the scanner's: a registered point is uncertain by this as well.
    """

    log: float
    sigma: float
    covariance_with_x: Six

    def scale(self) -> ArmScale:
        return ArmScale(self.log, self.sigma**2, np.array(self.covariance_with_x))


class UncertaintyDocument(Document):
    """One standard deviation: of X's translation along the mount's axes, of its rotation about the camera's axes, of a
    mapped point (RMS over the working volume).

    `covariance`: of X @ exp(.), in `covariance_frame`, rows and columns in `covariance_order`. `points`: those that
    matter. Null and empty in a calibration that was written as version 1. `leave_out`: null with few views.
    `arm_scale`: between the arm's millimetre and the scanner's, null where it is not estimated.
    """

    translation_mm: Vector
    rotation_deg: Vector
    point_mm: float
    covariance: tuple[Six, Six, Six, Six, Six, Six] | None = None
    covariance_frame: Literal["camera"] = "camera"
    covariance_order: tuple[str, str, str, str, str, str] = COVARIANCE_ORDER
    coverage_factor: float = COVERAGE_FACTOR
    points: tuple[PointUncertaintyDocument, ...] = ()
    leave_out: LeaveOutDocument | None = None
    arm_scale: ArmScaleDocument | None = None

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
    """Estimated from the data; null where it cannot be. `belief`: in the robot's noise after the session."""

    image_px: float | None
    robot_rotation_deg: float | None
    robot_translation_mm: float | None
    belief: NoiseBeliefDocument | None = None


class CorrectionDocument(Document):
    """The estimated error of one robot pose: vectors in mm and degrees."""

    translation_mm: Vector
    rotation_deg: Vector


class SentenceDocument(Document):
    """What a sentence is made of: its id in the table of sentences and its parameters, to be said in any language."""

    id: str
    params: dict[str, JsonValue]

    @staticmethod
    def each_of(texts: Sequence[str]) -> "list[SentenceDocument]":
        """One for each text; of the id "as-written" for those that no table holds."""
        return [SentenceDocument(**as_sentence(text).pair()) for text in texts]


class ReasonDocument(SentenceDocument):
    """A sentence, and what it is made of."""

    message: str

    @classmethod
    def of(cls, text: str) -> "ReasonDocument":
        sentence = as_sentence(text)
        return cls(**sentence.pair(), message=str(sentence))


class ViewResultDocument(Document):
    """How one view fits. `reason`: the code of `reason_detail`. The last two: where they were recorded."""

    index: int
    image: str | None
    status: Literal["used", "corrected", "rejected"]
    reason: str | None
    reason_detail: ReasonDocument | None = None
    reprojection_px: float | None
    base_error_mm: float | None
    robot_correction: CorrectionDocument | None
    joints_deg: tuple[float, ...] | None = None
    camera_temperature_c: float | None = None


class ObservabilityDocument(Document):
    """How well the motions determine X."""

    views_used: int
    max_rotation_deg: float
    axis_spread: float
    weakest_direction: str


class HoldOutDocument(Document):
    """Leave one view out; the document holds null below 4 views, and no pixels without images."""

    base_error_mm: float
    reprojection_px: float | None


class ClockOffsetDocument(Document):
    """The robot's clock minus the sensor's, with one standard deviation."""

    offset_s: float
    sigma_s: float


class FindingDocument(Document):
    """Something a person should know. `effect_mm`: shift of a mapped point with the cause taken into account."""

    code: str
    severity: Literal["error", "warning", "info"]
    message: str
    fix: str
    effect_mm: float | None = None


class VerdictDocument(Document):
    """May it be used?"""

    accepted: bool
    findings: list[FindingDocument]


class CalibrationFindingDocument(FindingDocument):
    """A finding, with what `message` (id, params) and `fix` (advice) are made of."""

    id: str
    params: dict[str, JsonValue]
    advice: SentenceDocument

    @classmethod
    def of(cls, finding: Finding) -> "CalibrationFindingDocument":
        message, fix = as_sentence(finding.message), as_sentence(finding.fix)
        return cls(
            code=finding.code, severity=finding.severity, message=str(message), fix=str(fix), **message.pair(),
            advice=SentenceDocument(**fix.pair()), effect_mm=finding.effect_mm,
        )  # fmt: skip


class CalibrationVerdictDocument(Document):
    """May it be used? `rule`: by which rule it was decided, `limits`: the limits in force then; null in a calibration
    that was written as version 1."""

    accepted: bool
    findings: list[CalibrationFindingDocument]
    limits: LimitsInForceDocument | None = None
    rule: ReasonDocument | None = None

    @classmethod
    def of(cls, verdict: Verdict) -> "CalibrationVerdictDocument":
        rule = "rule" if verdict.limits.tolerance_stated else "rule-not-stated"
        limit = {"coverage_factor": COVERAGE_FACTOR, "tolerance_mm": verdict.limits.tolerance_mm}
        return cls(
            accepted=verdict.accepted,
            findings=[CalibrationFindingDocument.of(finding) for finding in verdict.findings],
            limits=LimitsInForceDocument.of(verdict.limits),
            rule=ReasonDocument.of(Sentence(rule, **limit)),
        )


class AccuracyDocument(Document):
    """The one number of a calibration: U (k = 2) at the worst of the points that matter, beside what it is judged by.

    `tolerance_stated`: by settings, request or command line; else `tolerance_mm` is the default. `expected_mm`: U of
    the same views as predicted by what was known of the noise before the run. `before_mm`: U of the calibration that
    was in force when this one was made. `why`: of a U more than 1.5 times the expected one, or less than that. Null
    where it is not known.
    """

    expanded_mm: float | None = None
    worst_point: str | None = None
    tolerance_mm: float | None = None
    tolerance_stated: bool = False
    expected_mm: float | None = None
    before_mm: float | None = None
    why: ReasonDocument | None = None

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
    """The whole of calibration.json. When the motions cannot determine X the transforms are null.

    `target`: as it was described, null where there was none. `target_scale`: its size over the described one, as found
    with X; 1 where it is as described.
    """

    heading = "calibrationjson"

    schema_version: Literal[2] = 2
    id: str
    created_at: str
    software: str
    setup: Setup
    method: str
    flange_T_camera: PoseDocument | None = None
    base_T_target: PoseDocument | None = None
    base_T_camera: PoseDocument | None = None
    flange_T_target: PoseDocument | None = None
    camera: EstimatedCameraDocument | None
    uncertainty: UncertaintyDocument | None
    noise: NoiseDocument
    views: list[ViewResultDocument]
    observability: ObservabilityDocument
    hold_out: HoldOutDocument | None
    clock_offset: ClockOffsetDocument | None = None
    axis_offset: AxisOffsetDocument | None = None
    external_axis: FoundAxisDocument | None = None
    target: TargetDocument | None = None
    target_scale: Annotated[float, Field(gt=0)] = 1.0
    verdict: CalibrationVerdictDocument
    accuracy: AccuracyDocument = Field(default_factory=lambda data: _accuracy(data["uncertainty"], data["verdict"]))

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
        return self.target_scale if self.target is not None and self.target.target() == target else 1.0

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
    transforms = zip(TRANSFORM_NAMES[solution.setup], (solution.mount_T_camera, solution.anchor_T_target), strict=True)
    document = CalibrationDocument.model_validate(
        {
            "id": calibration_id,
            "created_at": created_at,
            "software": software,
            "setup": solution.setup,
            "method": solution.method,
            **{name: PoseDocument.of(a_T_b) for name, a_T_b in transforms if a_T_b is not None},
            "camera": _camera(solution),
            "uncertainty": _uncertainty(solution),
            "noise": _noise(solution.noise),
            "views": [_view(view) for view in solution.views],
            "observability": {
                "views_used": solution.observability.views_used,
                "max_rotation_deg": float(np.degrees(solution.observability.max_rotation_rad)),
                "axis_spread": solution.observability.axis_spread,
                "weakest_direction": solution.observability.weakest_direction,
            },
            "hold_out": solution.hold_out and vars(solution.hold_out),
            "clock_offset": solution.clock_offset and vars(solution.clock_offset),
            "axis_offset": solution.axis_offset and vars(solution.axis_offset),
            "external_axis": solution.external_axis and FoundAxisDocument.of(solution.external_axis),
            "target": None if target is None else document_of_target(target),
            "target_scale": solution.target_scale,
            "verdict": CalibrationVerdictDocument.of(verdict),
        }
    )
    return document.with_accuracy(
        expected_mm=expected.expanded_mm, why=None if expected.why is None else ReasonDocument.of(expected.why)
    )


def _camera(solution: Solution) -> dict[str, object] | None:
    if solution.camera is None:
        return None
    return {**CameraDocument.of(solution.camera).model_dump(), "source": solution.camera_source}


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
    return view.why or (Sentence(known) if known in ENGLISH else str(view.reason))


def _correction(correction: tuple[Array, Array] | None) -> dict[str, object] | None:
    if correction is None:
        return None
    translation_mm, rotation_rad = correction
    return {"translation_mm": translation_mm.tolist(), "rotation_deg": np.degrees(rotation_rad).tolist()}

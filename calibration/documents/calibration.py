"""calibration.json: what `handeyed solve DIR --json` prints and the daemon stores."""

from typing import Literal

from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.session import CameraDocument
from calibration.documents.validation import Document
from calibration.problem import Setup


class EstimatedCameraDocument(CameraDocument):
    """A camera, and where it came from."""

    source: Literal["given", "estimated"]


class UncertaintyDocument(Document):
    """One standard deviation."""

    translation_mm: Vector
    rotation_deg: Vector
    point_mm: float


class NoiseDocument(Document):
    """Estimated from the data; null where it cannot be."""

    image_px: float | None
    robot_rotation_deg: float | None
    robot_translation_mm: float | None


class CorrectionDocument(Document):
    """The estimated error of one robot pose: vectors in mm and degrees."""

    translation_mm: Vector
    rotation_deg: Vector


class ViewResultDocument(Document):
    """How one view fits."""

    index: int
    image: str | None
    status: Literal["used", "corrected", "rejected"]
    reason: str | None
    reprojection_px: float | None
    base_error_mm: float | None
    robot_correction: CorrectionDocument | None


class ObservabilityDocument(Document):
    """How well the motions determine X."""

    views_used: int
    max_rotation_deg: float
    axis_spread: float
    weakest_direction: str


class HoldOutDocument(Document):
    """Leave one view out; the document holds null below 4 views."""

    base_error_mm: float
    reprojection_px: float


class FindingDocument(Document):
    """Something a person should know."""

    code: str
    severity: Literal["error", "warning", "info"]
    message: str
    fix: str


class VerdictDocument(Document):
    """May it be used?"""

    accepted: bool
    findings: list[FindingDocument]


class CalibrationDocument(Document):
    """The whole of calibration.json. When the motions cannot determine X the transforms are null."""

    schema_version: Literal[1] = 1
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
    verdict: VerdictDocument

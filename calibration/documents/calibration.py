"""calibration.json: what `handeyed solve DIR --json` prints and the daemon stores (mm, degrees, w first)."""

from typing import Literal

import numpy as np

from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.requirement import LimitsInForceDocument
from calibration.documents.session import CameraDocument
from calibration.documents.validation import Document
from calibration.problem import Setup
from calibration.solution import Noise, Solution, ViewResult
from calibration.transforms import Array
from calibration.verdict import Verdict

TRANSFORM_NAMES = {
    "eye-in-hand": ("flange_T_camera", "base_T_target"),
    "eye-to-hand": ("base_T_camera", "flange_T_target"),
}
"""Document keys of `mount_T_camera` and `anchor_T_target` in each set-up."""


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
    limits: LimitsInForceDocument | None = None


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


def calibration_document(
    solution: Solution, verdict: Verdict, *, calibration_id: str, created_at: str, software: str
) -> CalibrationDocument:
    """The calibration.json of a solution and its verdict; the transforms are null when they are not determined."""
    transforms = zip(TRANSFORM_NAMES[solution.setup], (solution.mount_T_camera, solution.anchor_T_target), strict=True)
    return CalibrationDocument.model_validate(
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
            "verdict": {
                "accepted": verdict.accepted,
                "findings": [vars(finding) for finding in verdict.findings],
                "limits": LimitsInForceDocument.of(verdict.limits),
            },
        }
    )


def _camera(solution: Solution) -> dict[str, object] | None:
    if solution.camera is None:
        return None
    return {**CameraDocument.of(solution.camera).model_dump(), "source": solution.camera_source}


def _uncertainty(solution: Solution) -> dict[str, object] | None:
    if solution.uncertainty is None:
        return None
    return {
        "translation_mm": solution.uncertainty.translation_mm.tolist(),
        "rotation_deg": np.degrees(solution.uncertainty.rotation_rad).tolist(),
        "point_mm": solution.uncertainty.point_mm,
    }


def _noise(noise: Noise) -> dict[str, object]:
    rotation_rad = noise.robot_rotation_rad
    return {
        "image_px": noise.image_px,
        "robot_rotation_deg": None if rotation_rad is None else float(np.degrees(rotation_rad)),
        "robot_translation_mm": noise.robot_translation_mm,
    }


def _view(view: ViewResult) -> dict[str, object]:
    return {
        "index": view.index,
        "image": view.image,
        "status": view.status,
        "reason": view.reason,
        "reprojection_px": view.reprojection_px,
        "base_error_mm": view.base_error_mm,
        "robot_correction": _correction(view.robot_correction),
    }


def _correction(correction: tuple[Array, Array] | None) -> dict[str, object] | None:
    if correction is None:
        return None
    translation_mm, rotation_rad = correction
    return {"translation_mm": translation_mm.tolist(), "rotation_deg": np.degrees(rotation_rad).tolist()}

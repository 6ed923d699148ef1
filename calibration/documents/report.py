"""calibration.json from a problem, its solution and its verdict (mm, degrees, w first)."""

import numpy as np

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.pose import PoseDocument
from calibration.documents.session import CameraDocument
from calibration.problem import Problem
from calibration.solution import Noise, Solution, Verdict, ViewResult
from calibration.transforms import Array

TRANSFORM_NAMES = {
    "eye-in-hand": ("flange_T_camera", "base_T_target"),
    "eye-to-hand": ("base_T_camera", "flange_T_target"),
}
"""What `mount_T_camera` and `anchor_T_target` are called in each set-up."""


def calibration_document(
    problem: Problem, solution: Solution, verdict: Verdict, *, calibration_id: str, created_at: str, software: str
) -> CalibrationDocument:
    """The whole of calibration.json; the transforms are null when the motions could not determine them."""
    transforms = zip(TRANSFORM_NAMES[problem.setup], (solution.mount_T_camera, solution.anchor_T_target), strict=True)
    return CalibrationDocument.model_validate(
        {
            "id": calibration_id,
            "created_at": created_at,
            "software": software,
            "setup": problem.setup,
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
            "verdict": {"accepted": verdict.accepted, "findings": [vars(finding) for finding in verdict.findings]},
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

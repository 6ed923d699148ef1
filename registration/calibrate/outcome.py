"""What a calibration from clouds answers, as a Solution, judged, and as calibration.json."""

from collections.abc import Sequence

import numpy as np

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.pose import PoseDocument
from calibration.errors import UndeterminedError
from calibration.likelihood.predicted_uncertainty import point_weights
from calibration.observability import summarise_motion
from calibration.solution import Finding, Noise, Observability, Solution, Uncertainty, Verdict, ViewResult
from calibration.transforms import Array
from calibration.verdict import CONTRADICTIONS, DEFAULT_VERDICT_LIMITS, VerdictLimits

FIX = "add views turned by 30 degrees or more about different axes"


def determined(
    method: str,
    flange_T_camera: Array,
    covariance: Array,
    seen_mm: Array,
    noise: Noise,
    views: Sequence[ViewResult],
    base_T_flange: Array,
    findings: tuple[Finding, ...] = (),
) -> Solution:
    """A Solution of X with its covariance (6, 6), as Uncertainty has it; `seen_mm` (n, 3): where its points are used.

    `base_T_flange` (n, 4, 4): the poses that were used.
    """
    flange_R_camera = flange_T_camera[:3, :3]
    translation = np.diagonal(flange_R_camera @ covariance[3:, 3:] @ flange_R_camera.T)
    uncertainty = Uncertainty(
        translation_mm=np.sqrt(translation),
        rotation_rad=np.sqrt(np.diagonal(covariance)[:3]),
        point_mm=float(np.sqrt(np.sum(point_weights(seen_mm) * covariance))),
        covariance=covariance,
    )
    return Solution(
        setup="eye-in-hand",
        method=method,
        mount_T_camera=flange_T_camera,
        anchor_T_target=None,
        camera=None,
        camera_source="given",
        uncertainty=uncertainty,
        noise=noise,
        views=tuple(views),
        observability=_observability(base_T_flange, _weakest(covariance, seen_mm)),
        hold_out=None,
        findings=findings,
    )


def undetermined(method: str, views: Sequence[ViewResult], base_T_flange: Array, error: UndeterminedError) -> Solution:
    """A Solution without X, and why."""
    return Solution(
        setup="eye-in-hand",
        method=method,
        mount_T_camera=None,
        anchor_T_target=None,
        camera=None,
        camera_source="given",
        uncertainty=None,
        noise=Noise(None, None, None),
        views=tuple(views),
        observability=_observability(base_T_flange, "X"),
        hold_out=None,
        findings=(Finding(error.code, "error", error.what, error.fix),),
    )


def _observability(base_T_flange: Array, weakest: str) -> Observability:
    motion = summarise_motion(base_T_flange)
    return Observability(len(base_T_flange), motion.max_rotation_rad, motion.axis_spread, weakest)


def _weakest(covariance: Array, seen_mm: Array) -> str:
    """The axis about or along which X moves the points it maps most."""
    reach = np.linalg.norm(seen_mm.mean(axis=0))
    deviations = np.sqrt(np.diagonal(covariance)) * np.repeat([reach, 1.0], 3)
    worst = int(np.argmax(deviations))
    return f"{'rotation about' if worst < 3 else 'translation along'} the camera's {'xyz'[worst % 3]}"


def judge_scan(solution: Solution, limits: VerdictLimits = DEFAULT_VERDICT_LIMITS) -> Verdict:
    """May X from clouds be used? The same limits and codes as with images."""
    findings = [*solution.findings]
    if solution.uncertainty is not None:
        point_mm = solution.uncertainty.point_mm
        if not point_mm <= limits.point_warning_mm:
            what = (
                f"a mapped point is uncertain by {point_mm:.2g} mm (limit {limits.point_mm:g}), "
                f"most by {solution.observability.weakest_direction}"
            )
            findings.append(
                Finding("point-uncertain", "error" if not point_mm <= limits.point_mm else "warning", what, FIX)
            )
    noise_mm = solution.noise.robot_translation_mm or 0.0
    if noise_mm > limits.robot_translation_mm:
        what = f"the robot's poses scatter by {noise_mm:.2g} mm"
        findings.append(Finding("robot-noise", "warning", what, "check tool and work object, settling, and the mount"))
    contradicting = sum(view.reason in CONTRADICTIONS for view in solution.views)
    if contradicting > limits.rejected_share * len(solution.views):
        what = f"{contradicting} of {len(solution.views)} views contradict the others"
        findings.append(Finding("many-rejected", "error", what, "check the poses and that the artefact stood still"))
    accepted = solution.mount_T_camera is not None and not any(found.severity == "error" for found in findings)
    return Verdict(accepted, tuple(findings))


def scan_calibration_document(
    solution: Solution, verdict: Verdict, *, calibration_id: str, created_at: str, software: str
) -> CalibrationDocument:
    """calibration.json; `flange_T_camera` is null when the views do not fix X, `camera` always."""
    uncertainty, noise, seen = solution.uncertainty, solution.noise, solution.observability
    rotation_rad = noise.robot_rotation_rad
    return CalibrationDocument.model_validate(
        {
            "id": calibration_id,
            "created_at": created_at,
            "software": software,
            "setup": solution.setup,
            "method": solution.method,
            "flange_T_camera": None if solution.mount_T_camera is None else PoseDocument.of(solution.mount_T_camera),
            "camera": None,
            "uncertainty": uncertainty
            and {
                "translation_mm": uncertainty.translation_mm.tolist(),
                "rotation_deg": np.degrees(uncertainty.rotation_rad).tolist(),
                "point_mm": uncertainty.point_mm,
            },
            "noise": {
                "image_px": None,
                "robot_rotation_deg": None if rotation_rad is None else float(np.degrees(rotation_rad)),
                "robot_translation_mm": noise.robot_translation_mm,
            },
            "views": [_view(view) for view in solution.views],
            "observability": {
                "views_used": seen.views_used,
                "max_rotation_deg": float(np.degrees(seen.max_rotation_rad)),
                "axis_spread": seen.axis_spread,
                "weakest_direction": seen.weakest_direction,
            },
            "hold_out": None,
            "verdict": {"accepted": verdict.accepted, "findings": [vars(finding) for finding in verdict.findings]},
        }
    )


def _view(view: ViewResult) -> dict[str, object]:
    found = view.robot_correction
    correction = found and {"translation_mm": found[0].tolist(), "rotation_deg": np.degrees(found[1]).tolist()}
    return {**vars(view), "robot_correction": correction}

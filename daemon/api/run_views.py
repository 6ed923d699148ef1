"""The views of a run for a screen: what was found in each picture, and how the run's calibration fits it."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.documents.calibration import CalibrationDocument, CorrectionDocument, ViewResultDocument
from calibration.kinematics.arm import Arm, UnreachablePoseError
from calibration.kinematics.stance import Stance
from calibration.monitoring.view_residuals import predict_pixels, root_mean_square
from calibration.targets import Target, outline_mm
from calibration.transforms import Array
from daemon.api.schemas.cell import MissingDocument
from daemon.api.schemas.runs import Corner, RunViewDocument, RunViewsDocument
from daemon.cell.skeleton import skeleton_mm
from daemon.sessions.detections import DetectionDocument, read_detections
from daemon.sessions.session_reader import open_session


def run_views(
    run_id: str, folder: Path, calibration: CalibrationDocument | None, arm: Arm | None, *, own: bool
) -> RunViewsDocument:
    """The views of a run's folder, with residuals by a calibration. Raises DocumentError.

    `own`: the calibration was solved from these views, and has a correction of each robot pose.
    """
    session = open_session(folder)
    target = session.document.described_target()
    seen = {one.index: one for one in read_detections(folder).views}
    results = {view.index: view for view in calibration.views} if calibration is not None and own else {}
    views = []
    for index, view in enumerate(session.document.views):
        found = seen.get(index, DetectionDocument(index=index, at="", configuration=()))
        result, joints_rad, missing = results.get(index), view.stance.joints_rad, None
        if found.missing is not None:
            missing = MissingDocument.of(found.missing.code, found.missing.sentence())
        if joints_rad is None:
            joints_rad = joints_in_posture(arm, view.stance.base_T_flange, found.configuration)
        views.append(
            RunViewDocument(
                index=index,
                at=found.at or None,
                base_T_flange=view.base_T_flange,
                joints_deg=None if joints_rad is None else [round(float(x), 4) for x in np.degrees(joints_rad)],
                skeleton_mm=skeleton_mm(arm, joints_rad),
                status="missed" if missing else "taken" if result is None else result.status,
                reason=None if result is None else result.reason,
                missing=missing,
                **_corners(view.stance, found, target, calibration, result),
                sharpness=found.sharpness,
                camera_temperature_c=view.camera_temperature_c,
                picture=f"/runs/{run_id}/frames/{index}",
            )
        )
    outline = [(float(x), float(y), float(z)) for x, y, z in outline_mm(target.points_mm)]
    calibration_id = None if calibration is None else calibration.id
    return RunViewsDocument(run_id=run_id, calibration_id=calibration_id, target_outline_mm=outline, views=views)


def _corners(
    stance: Stance,
    found: DetectionDocument,
    target: Target,
    calibration: CalibrationDocument | None,
    result: ViewResultDocument | None,
) -> dict[str, Any]:
    """The fields of RunViewDocument that compare what was found with where the calibration predicts it."""
    ids = np.array([corner[0] for corner in found.corners], np.intp)
    pixels = np.array([corner[1:] for corner in found.corners], float).reshape(-1, 2)
    if result is not None and result.reason == "board-turned":
        calibration = None  # its points were numbered anew
    correction = None if result is None else result.robot_correction
    at_zero, axis = stance.base_T_flange, None if calibration is None else calibration.external_axis
    if axis is not None and axis.reading(stance.external_axes) is not None:
        (at_zero,) = axis.place(at_zero[None], [stance])
    reported = _residuals(calibration, target, at_zero, ids, pixels, None)
    free = None if correction is None else _residuals(calibration, target, at_zero, ids, pixels, correction)
    return {
        "corners": _corner_rows(ids, pixels, reported, free),
        "rms_px": None if reported is None else root_mean_square(reported),
        "rms_px_free": None if free is None else root_mean_square(free),
    }


def _residuals(
    calibration: CalibrationDocument | None,
    target: Target,
    base_T_flange: Array,
    ids: NDArray[np.intp],
    pixels: Array,
    correction: CorrectionDocument | None,
) -> Array | None:
    """Predicted minus found (n, 2); None without a calibration."""
    if calibration is None:
        return None
    predicted = predict_pixels(calibration, target, base_T_flange, correction)
    return None if predicted is None else predicted[ids] - pixels


def _corner_rows(ids: NDArray[np.intp], pixels: Array, reported: Array | None, free: Array | None) -> list[Corner]:
    unknown = np.full_like(pixels, np.nan)
    rows = np.column_stack([pixels, unknown if reported is None else reported, unknown if free is None else free])
    corners: list[Corner] = []
    for point, (u, v, *residuals) in zip(ids.tolist(), rows.round(3).tolist(), strict=True):
        du, dv, du_free, dv_free = (value if np.isfinite(value) else None for value in residuals)
        corners.append((point, u, v, du, dv, du_free, dv_free))
    return corners


def joints_in_posture(arm: Arm | None, base_T_flange: Array, configuration: tuple[int, ...]) -> Array | None:
    """The joints (6,) rad of a pose in that posture; None where arm or posture are not known."""
    if arm is None or len(configuration) != 4:
        return None
    cf1, cf4, cf6, cfx = configuration
    try:
        return arm.matching(base_T_flange, (cf1, cf4, cf6, cfx))
    except UnreachablePoseError:
        return None

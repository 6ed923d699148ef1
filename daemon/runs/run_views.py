"""The views of a run for a screen: what was found in each picture, and how the run's calibration fits it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibration.documents.calibration import CalibrationDocument, CorrectionDocument, ViewResultDocument
from calibration.documents.session import ViewDocument
from calibration.kinematics.arm import Arm, UnreachablePoseError
from calibration.monitoring.view_residuals import predict_pixels, root_mean_square
from calibration.targets import Target, outline_mm
from calibration.transforms import Array
from daemon.sessions.detections import DetectionDocument, read_detections
from daemon.sessions.session_reader import open_session

Corner = tuple[int, float, float, float | None, float | None, float | None, float | None]
"""Id, u, v; du, dv predicted minus found by the robot's pose as reported; the same by the corrected pose."""


@dataclass(frozen=True, eq=False)
class RunView:
    """One view. `result`: how the run's own calibration uses it.

    `rms_px`, `rms_px_free`: RMS of the residuals by the robot's pose as reported, and as corrected.
    """

    index: int
    at: str | None
    view: ViewDocument
    joints_rad: Array | None
    result: ViewResultDocument | None
    missing: tuple[str, str] | None
    corners: tuple[Corner, ...]
    rms_px: float | None
    rms_px_free: float | None
    sharpness: float | None


@dataclass(frozen=True, eq=False)
class RunViews:
    """All views, and the target's outline (4, 3) mm in its own frame: the rectangle around its points."""

    views: tuple[RunView, ...]
    target_outline_mm: Array


def run_views(folder: Path, calibration: CalibrationDocument | None, arm: Arm | None, *, own: bool) -> RunViews:
    """The views of a run's folder, with residuals by a calibration. Raises DocumentError.

    `own`: the calibration was solved from these views, and has a correction of each robot pose.
    """
    session = open_session(folder)
    target = session.document.described_target()
    found = {one.index: one for one in read_detections(folder).views}
    results = {view.index: view for view in calibration.views} if calibration is not None and own else {}
    views = []
    for index, view in enumerate(session.document.views):
        views.append(_run_view(index, view, found.get(index), target, calibration, results.get(index), arm))
    return RunViews(tuple(views), outline_mm(target.points_mm))


def _run_view(
    index: int,
    view: ViewDocument,
    found: DetectionDocument | None,
    target: Target,
    calibration: CalibrationDocument | None,
    result: ViewResultDocument | None,
    arm: Arm | None,
) -> RunView:
    joints = view.stance.joints_rad
    if found is None:
        return RunView(index, None, view, joints, result, None, (), None, None, None)
    ids = np.array([corner[0] for corner in found.corners], np.intp)
    pixels = np.array([corner[1:] for corner in found.corners], float).reshape(-1, 2)
    if result is not None and result.reason == "board-turned":
        calibration = None  # its points were numbered anew
    correction = None if result is None else result.robot_correction
    at_zero = _at_zero(view, calibration)
    reported = _residuals(calibration, target, at_zero, ids, pixels, None)
    free = None if correction is None else _residuals(calibration, target, at_zero, ids, pixels, correction)
    return RunView(
        index=index,
        at=found.at,
        view=view,
        joints_rad=joints
        if joints is not None
        else joints_in_posture(arm, view.stance.base_T_flange, found.configuration),
        result=result,
        missing=None if found.missing is None else (found.missing.code, found.missing.sentence()),
        corners=_corners(ids, pixels, reported, free),
        rms_px=None if reported is None else root_mean_square(reported),
        rms_px_free=None if free is None else root_mean_square(free),
        sharpness=found.sharpness,
    )


def _at_zero(view: ViewDocument, calibration: CalibrationDocument | None) -> Array:
    """The view's pose (4, 4), as if the calibration's external axis, where it has one, had stood at its zero."""
    stance, axis = view.stance, None if calibration is None else calibration.external_axis
    if axis is None or axis.reading(stance.external_axes) is None:
        return stance.base_T_flange
    (at_zero,) = axis.place(stance.base_T_flange[None], [stance])
    return np.asarray(at_zero)


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


def _corners(ids: NDArray[np.intp], pixels: Array, reported: Array | None, free: Array | None) -> tuple[Corner, ...]:
    unknown = np.full_like(pixels, np.nan)
    rows = np.column_stack([pixels, unknown if reported is None else reported, unknown if free is None else free])
    corners: list[Corner] = []
    for point, (u, v, *residuals) in zip(ids.tolist(), rows.round(3).tolist(), strict=True):
        du, dv, du_free, dv_free = (value if np.isfinite(value) else None for value in residuals)
        corners.append((point, u, v, du, dv, du_free, dv_free))
    return tuple(corners)


def joints_in_posture(arm: Arm | None, base_T_flange: Array, configuration: tuple[int, ...]) -> Array | None:
    """The joints (6,) rad of a pose in that posture; None where arm or posture are not known."""
    if arm is None or len(configuration) != 4:
        return None
    cf1, cf4, cf6, cfx = configuration
    try:
        return arm.matching(base_T_flange, (cf1, cf4, cf6, cfx))
    except UnreachablePoseError:
        return None

"""Whether what was found is the target: no wrong detection gets through, and a reason is given."""

import numpy as np

from calibration.detection.plane_view import PlaneView, fit_plane_view
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.targets import Target
from calibration.transforms import Array

FEWEST_POINTS = 6
LARGEST_RMS_PX, LARGEST_RMS_OF_PITCH = 0.3, 0.012
"""The gate's width: what blur and noise may do, and what a bent board or the rest of a lens's distortion may."""
LEAST_FORESHORTENING = 0.08
"""Beyond about 85° from frontal the points along the short axis fall together."""
SMALLEST_PITCH_PX = 4.0
STRAY_OF_MEDIAN, LEAST_STRAY_PX, LARGEST_STRAY_SHARE = 6.0, 0.3, 0.25
"""A point is astray (glare, something in front of it) when it lies this many times further off than most do."""


def gate(detection: Detection, target: Target, image_size: tuple[int, int]) -> Detection:
    """The detection without its few stray points.

    Raises DetectionError `too-few-points`, `points-in-a-line`, `edge-on`, `too-far-away`, `not-planar`.
    """
    points, pixels = target.points_mm[detection.ids, :2], detection.corners_px
    keep = np.ones(len(points), bool)
    while True:
        _require_enough(points[keep])
        view, residual_px = fit_plane_view(points[keep], pixels[keep], image_size)
        pitch_px, foreshortening = _scale(view, points[keep])
        strays, rms_px, limit_px = _strays(residual_px, pitch_px)
        if not strays.any():
            break
        keep[np.flatnonzero(keep)[strays]] = False
        if (~keep).sum() > LARGEST_STRAY_SHARE * len(points):
            what = f"the points found miss a plane's by {rms_px:.2f} px RMS, the limit is {limit_px:.2f} px"
            raise DetectionError("not-planar", what, "check the target's columns, rows and kind, and that it is flat")
    if foreshortening < LEAST_FORESHORTENING:
        what = f"the target is seen edge-on ({np.degrees(np.arccos(foreshortening)):.0f}° from frontal)"
        raise DetectionError("edge-on", what, "turn the target towards the camera")
    if pitch_px < SMALLEST_PITCH_PX:
        what = f"the target's points lie {pitch_px:.1f} px apart, the least is {SMALLEST_PITCH_PX:g} px"
        raise DetectionError("too-far-away", what, "bring the camera nearer or use a target with larger squares")
    return Detection(detection.ids[keep], pixels[keep])


def _strays(residual_px: Array, pitch_px: float) -> tuple[Array, float, float]:
    """Which points (n,) do not belong, the RMS and its limit per axis in px."""
    distance = np.hypot(*residual_px.T)
    rms_px, limit_px = float(np.sqrt(np.mean(distance**2) / 2)), LARGEST_RMS_PX + LARGEST_RMS_OF_PITCH * pitch_px
    strays = distance > max(STRAY_OF_MEDIAN * float(np.median(distance)), LEAST_STRAY_PX)
    if rms_px > limit_px and not strays.any():
        strays = distance == distance.max()
    return strays, rms_px, limit_px


def _require_enough(points: Array) -> None:
    if len(points) < FEWEST_POINTS:
        what = f"only {len(points)} points of the target were found, the least is {FEWEST_POINTS}"
        raise DetectionError("too-few-points", what, "bring more of the target into view")
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spread[1] < 1e-6 * spread[0]:
        raise DetectionError(
            "points-in-a-line", "the points found lie in one line", "bring more of the target into view"
        )


def _scale(view: PlaneView, points: Array) -> tuple[float, float]:
    """Distance between neighbouring points in px, and how much shorter the short axis is than the long one."""
    long, short = np.linalg.svd(view.jacobian(points.mean(axis=0)), compute_uv=False)
    away = np.abs(points - points[0]).max(axis=1)
    pitch_mm = float(away[away > 1e-9 * away.max()].min())
    return float(np.sqrt(long * short)) * pitch_mm, float(short / long)

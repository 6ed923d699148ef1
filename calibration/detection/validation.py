"""Whether what was found is the target: no wrong detection gets through, and a reason is given."""

import numpy as np
from numpy.typing import NDArray

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
STRAY_OF_MEDIAN, LEAST_STRAY_PX = 6.0, 0.3
"""A point is astray when it lies this many times further off than most do: glare, something in front of it."""
LARGEST_STRAY_SHARE, LARGEST_STRAY_SHARE_OF_FEW, FEW = 0.4, 0.125, 40
"""Few points have no evidence to spare."""
WRONG_OF_PITCH, LARGEST_WRONG_SHARE = 0.2, 0.08
"""Further off than this it is not that point at all; of those there may be very few."""


def gate(detection: Detection, target: Target, image_size: tuple[int, int]) -> Detection:
    """The detection without its few stray points.

    Raises DetectionError `too-few-points`, `points-in-a-line`, `edge-on`, `too-far-away`, `not-planar`.
    """
    points, pixels = target.points_mm[detection.ids, :2], detection.corners_px
    keep, wrong = np.ones(len(points), bool), 0
    while True:
        _require_enough(points[keep])
        view, residual_px = fit_plane_view(points[keep], pixels[keep], image_size)
        pitch_px, foreshortening = _scale(view, points[keep], pixels[keep])
        strays = _strays(residual_px, pitch_px)
        if not strays.any():
            break
        keep[np.flatnonzero(keep)[strays]] = False
        wrong += int((np.hypot(*residual_px[strays].T) > WRONG_OF_PITCH * pitch_px).sum())
        share = LARGEST_STRAY_SHARE if len(points) >= FEW else LARGEST_STRAY_SHARE_OF_FEW
        if (~keep).sum() > share * len(points) or wrong > LARGEST_WRONG_SHARE * len(points):
            what = f"{(~keep).sum()} of the {len(points)} points found do not lie where a plane would have them"
            raise DetectionError("not-planar", what, "check the target's description, that it is flat, and for glare")
    if foreshortening < LEAST_FORESHORTENING:
        what = f"the target is seen edge-on ({np.degrees(np.arccos(foreshortening)):.0f}° from frontal)"
        raise DetectionError("edge-on", what, "turn the target towards the camera")
    if pitch_px < SMALLEST_PITCH_PX:
        what = f"the target's points lie {pitch_px:.1f} px apart, the least is {SMALLEST_PITCH_PX:g} px"
        raise DetectionError("too-far-away", what, "bring the camera nearer or use a target with larger squares")
    return Detection(detection.ids[keep], pixels[keep])


def _strays(residual_px: Array, pitch_px: float) -> NDArray[np.bool_]:
    """Which points (n,) do not belong."""
    distance = np.hypot(*residual_px.T)
    strays = distance > max(STRAY_OF_MEDIAN * float(np.median(distance)), LEAST_STRAY_PX)
    rms_px = float(np.sqrt(np.mean(distance**2) / 2))
    if rms_px > LARGEST_RMS_PX + LARGEST_RMS_OF_PITCH * pitch_px and not strays.any():
        strays = distance == distance.max()
    return np.asarray(strays)


def _require_enough(points: Array) -> None:
    if len(points) < FEWEST_POINTS:
        what = f"only {len(points)} points of the target were found, the least is {FEWEST_POINTS}"
        raise DetectionError("too-few-points", what, "bring more of the target into view")
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spread[1] < 1e-6 * spread[0]:
        raise DetectionError(
            "points-in-a-line", "the points found lie in one line", "bring more of the target into view"
        )


def _scale(view: PlaneView, points: Array, pixels: Array) -> tuple[float, float]:
    """Distance between neighbouring points in px, and how much shorter the short axis is than the long one."""
    long, short = np.linalg.svd(view.jacobian(points.mean(axis=0)), compute_uv=False)
    away = np.abs(points - points[0]).max(axis=1)
    pitch_mm = float(away[away > 1e-9 * away.max()].min())
    # a homography fitted to nonsense may be of any scale, the points themselves are not
    overall = float(np.hypot(*np.ptp(pixels, axis=0)) / np.hypot(*np.ptp(points, axis=0)))
    return min(float(np.sqrt(long * short)), 2 * overall) * pitch_mm, float(short / long)

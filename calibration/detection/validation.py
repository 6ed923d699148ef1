"""Validation of a detection: enough points, in one plane, not edge-on, not too small. A refusal names the reason."""

import numpy as np
from numpy.typing import NDArray

from calibration.detection.plane_view import PlaneView, fit_plane_view
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.sentences.sentence import Sentence
from calibration.targets import ArucoMarker, Target
from calibration.transforms import Array

MIN_POINTS, MIN_POINTS_OF_A_MARKER = 6, 4
"""Least points: of a target, and of a single marker, whose four corners are numbered by what it shows."""
MAX_RMS_PX, MAX_RMS_OF_PITCH = 0.3, 0.012
"""Largest RMS residual: a constant for blur and noise, plus a share of the pitch for a bent board and the lens."""
MIN_FORESHORTENING = 0.08
"""Least ratio of the short to the long axis, about 85° from frontal; beyond, points along the short axis merge."""
MIN_PITCH_PX = 4.0
OUTLIER_OF_MEDIAN, MIN_OUTLIER_PX = 6.0, 0.3
"""A point is an outlier beyond this many times the median residual, at least: glare, something in front of it."""
MAX_OUTLIER_SHARE, MAX_OUTLIER_SHARE_OF_FEW, FEW_POINTS = 0.4, 0.125, 40
"""Largest share of outliers; smaller below FEW_POINTS points, where the others prove less."""
GROSS_ERROR_OF_PITCH, MAX_GROSS_ERROR_SHARE = 0.2, 0.08
"""A residual beyond this share of the pitch is a gross error, not that point at all; the largest share of those."""


def validate_detection(detection: Detection, target: Target, image_size: tuple[int, int]) -> Detection:
    """The detection without its few outliers.

    Raises DetectionError `too-few-points`, `points-in-a-line`, `edge-on`, `too-far-away`, `not-planar`.
    """
    points, pixels = target.points_mm[detection.ids, :2], detection.corners_px
    keep, gross = np.ones(len(points), bool), 0
    while True:
        _require_enough(points[keep], MIN_POINTS_OF_A_MARKER if isinstance(target, ArucoMarker) else MIN_POINTS)
        view, residual_px = fit_plane_view(points[keep], pixels[keep], image_size)
        pitch_px, foreshortening = _scale(view, points[keep], pixels[keep])
        outliers = _find_outliers(residual_px, pitch_px)
        if not outliers.any():
            break
        keep[np.flatnonzero(keep)[outliers]] = False
        gross += int((np.hypot(*residual_px[outliers].T) > GROSS_ERROR_OF_PITCH * pitch_px).sum())
        share = MAX_OUTLIER_SHARE if len(points) >= FEW_POINTS else MAX_OUTLIER_SHARE_OF_FEW
        if (~keep).sum() > share * len(points) or gross > MAX_GROSS_ERROR_SHARE * len(points):
            what = Sentence("seen-not-planar", outliers=int((~keep).sum()), points=len(points))
            raise DetectionError("not-planar", what, Sentence("see-flat"))
    if foreshortening < MIN_FORESHORTENING:
        what = Sentence("seen-edge-on", angle_deg=float(np.degrees(np.arccos(foreshortening))))
        raise DetectionError("edge-on", what, Sentence("see-frontal"))
    if pitch_px < MIN_PITCH_PX:
        what = Sentence("seen-far-away", pitch_px=pitch_px, least_px=MIN_PITCH_PX)
        raise DetectionError("too-far-away", what, Sentence("see-nearer"))
    return Detection(detection.ids[keep], pixels[keep])


def _find_outliers(residual_px: Array, pitch_px: float) -> NDArray[np.bool_]:
    """Mask (n,) of the outliers; the worst point when the RMS is too large though no point stands out."""
    distance = np.hypot(*residual_px.T)
    outliers = distance > max(OUTLIER_OF_MEDIAN * float(np.median(distance)), MIN_OUTLIER_PX)
    rms_px = float(np.sqrt(np.mean(distance**2) / 2))
    if rms_px > MAX_RMS_PX + MAX_RMS_OF_PITCH * pitch_px and not outliers.any():
        outliers = distance == distance.max()
    return np.asarray(outliers)


def _require_enough(points: Array, min_points: int) -> None:
    """Raises DetectionError `too-few-points`, `points-in-a-line`."""
    if len(points) < min_points:
        what = Sentence("seen-few-points", points=len(points), least=min_points)
        raise DetectionError("too-few-points", what, Sentence("see-more"))
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spread[1] < 1e-6 * spread[0]:
        raise DetectionError("points-in-a-line", Sentence("seen-in-a-line"), Sentence("see-more"))


def _scale(view: PlaneView, points: Array, pixels: Array) -> tuple[float, float]:
    """Distance between neighbouring points in px, and the ratio of the view's short to its long axis."""
    long, short = np.linalg.svd(view.jacobian(points.mean(axis=0)), compute_uv=False)
    away = np.abs(points - points[0]).max(axis=1)
    pitch_mm = float(away[away > 1e-9 * away.max()].min())
    # A homography fitted to wrong points may have any scale; the extent of the points bounds it.
    overall = float(np.hypot(*np.ptp(pixels, axis=0)) / np.hypot(*np.ptp(points, axis=0)))
    return min(float(np.sqrt(long * short)), 2 * overall) * pitch_mm, float(short / long)

"""Detection of a target in an image: picks the target's detector and validates what it finds."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from calibration.detection.charuco import detect_charuco
from calibration.detection.chessboard import detect_chessboard
from calibration.detection.circles import detect_circles
from calibration.detection.image import Grey, downscale, grey_image, to_full_size
from calibration.detection.plane_view import PlaneView, fit_plane_view
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.sentences.sentence import Sentence
from calibration.targets import (
    AprilTagGrid,
    ArucoGrid,
    ArucoMarker,
    Charuco,
    Chessboard,
    CircleGrid,
    MarkerGrid,
    MarkerTarget,
    Target,
    require_markers,
)
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


SEARCH_PIXELS = (2.0e6, np.inf)
"""Pixels of the image that is searched, one after the other until all markers are found."""
EDGE_REACH_OF_MODULE = 0.8
"""Width of the band on either side of an edge that is read, as a share of a module or of the gap, if narrower."""


def detect_markers(image: Grey, target: MarkerTarget) -> Detection:
    """Four corners of every marker in view, ids as in MarkerGrid.

    Raises DetectionError `not-found`, `unknown-dictionary`, `dictionary-too-small`.
    """
    require_markers(target)
    grid = target.markers
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, grid.dictionary))
    markers, rough = _read_markers(image, dictionary, grid)
    if len(markers) == 0:
        raise _not_found(target)
    modules = dictionary.markerSize + 2
    clear = EDGE_REACH_OF_MODULE * min(1 / modules, grid.gap_mm / grid.side_mm)
    ids = 4 * markers[:, None] + np.arange(4)
    corners = refine_squares(image, target.points_mm[ids, :2], rough, clear)
    return Detection(ids.ravel(), corners.reshape(-1, 2))


def _not_found(target: MarkerTarget) -> DetectionError:
    match target:
        case AprilTagGrid():
            what, settings = Sentence("seen-no-tag", family=target.family), "family, columns, rows"
        case ArucoGrid():
            what = Sentence("seen-no-grid-marker", dictionary=target.dictionary)
            settings = "dictionary, first_id, columns, rows"
        case ArucoMarker():
            what = Sentence("seen-no-marker", dictionary=target.dictionary, marker=target.id)
            settings = "dictionary and id"
    return DetectionError("not-found", what, Sentence("see-markers", settings=settings))


def _read_markers(image: Grey, dictionary: Any, grid: MarkerGrid) -> tuple[NDArray[np.intp], Array]:
    """Places (n,) in the grid and rough corners (n, 4, 2) px of its markers in view; one seen twice is left out."""
    detector = cv2.aruco.ArucoDetector(dictionary)
    tags, corners = np.zeros(0, np.intp), np.zeros((0, 4, 2))
    for pixels in SEARCH_PIXELS:
        small, factor = downscale(image, pixels)
        found, numbers, _ = detector.detectMarkers(small)
        if numbers is not None:
            tags, first, times = np.unique(np.ravel(numbers), return_index=True, return_counts=True)
            places = tags - grid.first
            kept = (times == 1) & (places >= 0) & (places < grid.count)
            corners = to_full_size(np.array(found, float).reshape(-1, 4, 2)[first][kept], factor)
            tags = places[kept].astype(np.intp)
        if len(tags) == grid.count or factor == 1:
            break
    return tags, corners


@contextmanager
def silence_opencv() -> Iterator[None]:
    """Context manager: OpenCV writes nothing to standard error inside it."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)


Detector = Callable[[Grey, Any], Detection]

DETECTORS: dict[type, Detector] = {
    Chessboard: detect_chessboard,
    Charuco: detect_charuco,
    CircleGrid: detect_circles,
    AprilTagGrid: detect_markers,
    ArucoGrid: detect_markers,
    ArucoMarker: detect_markers,
}


def detect(image: NDArray[Any], target: Target) -> Detection:
    """The target's points in an 8-bit image (h, w) or (h, w, 3), refined to a fraction of a pixel and validated.

    Raises DetectionError; the codes stand in `grey_image`, each detector and `validate_detection`.
    """
    grey = grey_image(image)
    try:
        with silence_opencv():
            found = DETECTORS[type(target)](grey, target)
    except cv2.error as error:
        what = Sentence("seen-opencv-error", reason=str(error.err))
        raise DetectionError("not-found", what, Sentence("see-description-and-image")) from error
    return validate_detection(found, target, (grey.shape[1], grey.shape[0]))


# Sub-pixel corners of black squares: the crossings of their edges, each fitted along its length. Blur rounds a square's
# corner but does not move its edges. Each edge is measured relative to its place in the plane's view, which includes
# the lens's distortion.

CORNER_MARGIN, MIN_SAMPLES, MAX_SAMPLES = 0.08, 16, 160
REACHES_PX, MIN_REACH_PX = (7.0, 4.0), 1.5
"""Half widths of the profile across an edge: wide to capture it, then as narrow as blur allows, for less noise."""
PLATEAU_OF_REACH = 0.6
"""Beyond this share of the reach the grey value is the ink's on one side, the paper's on the other."""


def refine_squares(image: Grey, plane: Array, corners_px: Array, clear_of_side: float) -> Array:
    """Corners (n, 4, 2) in px of squares with `plane` corners (n, 4, 2), in order around them.

    `clear_of_side`: width of plain ink and of plain paper beside an edge, as a share of the side. Squares too small
    for that are returned as they are.
    """
    corners = corners_px.astype(float)
    side_px = float(np.median(np.hypot(*np.moveaxis(np.roll(corners, -1, axis=1) - corners, -1, 0))))
    if clear_of_side * side_px < MIN_REACH_PX:
        return corners
    along = np.linspace(CORNER_MARGIN, 1 - CORNER_MARGIN, int(np.clip(side_px, MIN_SAMPLES, MAX_SAMPLES)))
    for reach_px in REACHES_PX:
        corners = _refine_once(image, plane, corners, along, min(reach_px, clear_of_side * side_px))
    return corners


def _refine_once(image: Grey, plane: Array, corners: Array, along: Array, reach_px: float) -> Array:
    view, _ = fit_plane_view(plane.reshape(-1, 2), corners.reshape(-1, 2), (image.shape[1], image.shape[0]))
    start, side = plane[:, :, None], (np.roll(plane, -1, axis=1) - plane)[:, :, None]
    on_edge = view.map((start + along[:, None] * side).reshape(-1, 2)).reshape(*plane.shape[:2], len(along), 2)
    tangent = np.gradient(on_edge, axis=2)
    outward = np.stack([tangent[..., 1], -tangent[..., 0]], axis=-1) / np.hypot(*np.moveaxis(tangent, -1, 0))[..., None]
    shift = _edge_shift(image, on_edge, outward, along, reach_px)
    # Four corners do not show the lens's distortion, so the edges of a single square may be bowed.
    if len(plane) == 1:
        start_of, end_of = np.vander([0.0, 1.0], 3) @ np.linalg.pinv(np.vander(along, 3))  # of the fitted parabolas
        at_start, at_end = np.asarray(shift @ start_of), np.asarray(shift @ end_of)
    else:
        slope, middle = _line(along, shift)
        at_start, at_end = middle - slope * 0.5, middle + slope * 0.5
    # A corner is the crossing of the edge that ends in it and the edge that starts in it.
    normals = np.stack([np.roll(outward[:, :, -1], 1, axis=1), outward[:, :, 0]], axis=2)
    shifts = np.stack([np.roll(at_end, 1, axis=1), at_start], axis=2)
    move = np.linalg.solve(normals, shifts[..., None])[..., 0]
    expected = view.map(plane.reshape(-1, 2)).reshape(plane.shape)
    usable = np.isfinite(move).all(axis=(1, 2)) & (np.abs(move).max(axis=(1, 2)) < reach_px)
    return np.where(usable[:, None, None], expected + np.nan_to_num(move), corners)


def _edge_shift(image: Grey, on_edge: Array, outward: Array, along: Array, reach_px: float) -> Array:
    """Outward offset (n, 4, samples) in px of the edge from `on_edge`, from the paper's share of a profile across."""
    count = int(np.ceil(2 * reach_px))
    across = (np.arange(count) + 0.5) / count * 2 * reach_px - reach_px
    at = on_edge[..., None, :] + across[:, None] * outward[..., None, :]
    level = scipy.ndimage.map_coordinates(image, [at[..., 1], at[..., 0]], order=1, mode="nearest", output=float)
    ink = _along_the_edge(along, level[..., across < -PLATEAU_OF_REACH * reach_px].mean(axis=3))[..., None]
    paper = _along_the_edge(along, level[..., across > PLATEAU_OF_REACH * reach_px].mean(axis=3))[..., None]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(paper > ink, (level - ink) / (paper - ink), np.nan).mean(axis=3)
    return np.asarray(reach_px - 2 * reach_px * share)


def _along_the_edge(along: Array, level: Array) -> Array:
    """The line (n, 4, samples) through grey values along each edge: keeps uneven lighting, removes noise."""
    slope, middle = _line(along, level)
    return middle[..., None] + slope[..., None] * (along - 0.5)


def _line(along: Array, value: Array) -> tuple[Array, Array]:
    """Slope and middle (n, 4) of the lines through values (n, 4, samples) along edges, their length being 1."""
    centred = along - 0.5
    return np.asarray(value @ centred / (centred @ centred)), np.asarray(value.mean(axis=2))

"""The target's points in space: found in the intensity image of an organised cloud, measured in its points.

A point's coordinates are smooth functions of the pixel over the target's plane. Around each corner they are fitted by a
quadratic, and evaluated where the corner was found between the pixels.
"""

import numpy as np

from calibration.errors import DetectionError
from calibration.problem import Detection, MeasuredPoints
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array

WINDOW_SHARE = 0.45
"""Half side of a corner's window over the distance to its neighbour: windows do not share pixels."""

MIN_HALF_SIDE_PX, MAX_HALF_SIDE_PX = 2, 20
MIN_SHARE = 0.5
"""Least share of a window's pixels with a point."""

MIN_CORNERS = 4
ROUNDS = 4
OUTLIER_SIGMA = 3.0


def measure_corners(found: Detection, points_mm: Array) -> MeasuredPoints:
    """The corners of a detection in space, from the points (h, w, 3) of the pixels, NaN where there is none.

    Raises DetectionError `no-points` when fewer than four corners have points around them.
    """
    from scipy.spatial import cKDTree  # a daemon begins without scipy's parts

    distances, _ = cKDTree(found.corners_px).query(found.corners_px, k=2)
    half = int(np.clip(WINDOW_SHARE * np.median(distances[:, 1]), MIN_HALF_SIDE_PX, MAX_HALF_SIDE_PX))
    measured = [_point(corner, points_mm, half) for corner in found.corners_px]
    kept = [row for row, point in enumerate(measured) if point is not None]
    if len(kept) < MIN_CORNERS:
        raise DetectionError(
            "no-points",
            Sentence("seen-no-cloud", measured=len(kept), points=len(measured)),
            Sentence("see-cloud"),
        )
    return MeasuredPoints(found.ids[kept], np.array([point for point in measured if point is not None]))


def _point(corner: Array, points_mm: Array, half: int) -> Array | None:
    """The point (3,) at a corner (2,) px, None where too few pixels of its window have one."""
    column, row = np.rint(corner).astype(int)
    height, width = points_mm.shape[:2]
    rows = np.arange(max(row - half, 0), min(row + half + 1, height))
    columns = np.arange(max(column - half, 0), min(column + half + 1, width))
    if not len(rows) or not len(columns):
        return None
    window = points_mm[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].reshape(-1, 3)
    v, u = (axis.reshape(-1) for axis in np.meshgrid(rows - corner[1], columns - corner[0], indexing="ij"))
    measured = np.isfinite(window).all(axis=1)
    if np.count_nonzero(measured) < MIN_SHARE * (2 * half + 1) ** 2:
        return None
    u, v, window = u[measured] / half, v[measured] / half, window[measured]
    terms = np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])
    kept = np.ones(len(u), bool)
    for _ in range(ROUNDS):
        fitted, *_ = np.linalg.lstsq(terms[kept], window[kept], rcond=None)
        apart = np.linalg.norm(terms @ fitted - window, axis=1)
        # Median of the length of three normal errors: 1.54 standard deviations.
        kept = apart <= OUTLIER_SIGMA * max(float(np.median(apart[kept])) * 1.73 / 1.54, 1e-9)
        if np.count_nonzero(kept) < MIN_SHARE * len(u):
            return None
    point: Array = fitted[0]
    return point

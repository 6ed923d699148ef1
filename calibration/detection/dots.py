"""Detection of dark elliptic blobs, the images of a circle grid's dots, of any size.

Outlines come from adaptive thresholds at several window sizes. An outline counts as an ellipse when its area is that
of the ellipse with the same second moments, 4 pi sqrt(det M).
"""

from dataclasses import dataclass

import cv2
import numpy as np
import scipy

from calibration.detection.image import Grey
from calibration.transforms import Array

WINDOWS_OF_SIDE = (0.04, 0.1, 0.25)
"""Side of the threshold's window over the image's shorter side: each suits dots up to about its size."""
LEVELS_BELOW_MEAN = 6
MIN_AREA_PX, MAX_AREA_SHARE = 12.0, 0.05
ELLIPSE_TOLERANCE, ELLIPSE_TOLERANCE_PX = 0.02, 2.0
"""Largest error of the area: a share of it plus px² for small outlines. The share of a square is 0.045."""
CUT_TOLERANCE = 0.12
"""The same share for dots cut by the image's edge: they are not measured, but one may be the origin."""
MIN_AXIS_RATIO = 0.12
"""Least ratio of an ellipse's axes."""
SAME_DOT_RADIUS_RATIO = 0.5
"""Outlines about one centre are one dot above this ratio of radii; below it, the outer one may be the sheet."""


@dataclass(frozen=True, eq=False)
class Dots:
    """`centres` (n, 2) px; `shapes` (n, 2, 2) px²: (x - c)' inverse(shape) (x - c) = 1 on the rim; `areas` (n,) px²."""

    centres: Array
    shapes: Array
    areas: Array


def find_dots(image: Grey) -> Dots:
    """All dark elliptic blobs, the largest first."""
    rows = [row for window in WINDOWS_OF_SIDE for row in _ellipses(image, window)]
    table = np.array(sorted(rows, key=lambda row: -row[2])).reshape(-1, 6)
    table = table[_distinct(table)]
    xx, xy, yy = table[:, 3:].T
    shapes = 4 * np.stack([xx, xy, xy, yy], axis=-1).reshape(-1, 2, 2)
    return Dots(table[:, :2], shapes, table[:, 2])


def _ellipses(image: Grey, window_of_side: float) -> list[tuple[float, ...]]:
    """Rows of x, y, area and the second moments xx, xy, yy about the centre."""
    window = max(11, int(window_of_side * min(image.shape))) | 1
    mean = cv2.blur(image, (window, window))
    dark = cv2.subtract(mean, image)
    _, mask = cv2.threshold(dark, LEVELS_BELOW_MEAN, 255, cv2.THRESH_BINARY)
    outlines, hierarchy = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    found: list[tuple[float, ...]] = []
    for outline, (_, _, _, parent) in zip(outlines, hierarchy[0] if outlines else (), strict=True):
        if len(outline) < 8 or parent >= 0:  # a hole is paper
            continue
        m = cv2.moments(outline)
        area = m["m00"]
        if not MIN_AREA_PX <= area <= MAX_AREA_SHARE * image.size:
            continue
        xx, xy, yy = m["mu20"] / area, m["mu11"] / area, m["mu02"] / area
        determinant, trace = xx * yy - xy * xy, xx + yy
        u, v, width, height = cv2.boundingRect(outline)
        cut = u <= 1 or v <= 1 or u + width >= image.shape[1] - 1 or v + height >= image.shape[0] - 1
        tolerance = (CUT_TOLERANCE if cut else ELLIPSE_TOLERANCE) * area + ELLIPSE_TOLERANCE_PX
        if determinant <= 0 or abs(area - 4 * np.pi * np.sqrt(determinant)) > tolerance:
            continue
        short2_over_long2 = (trace - np.sqrt(max(trace**2 - 4 * determinant, 0))) / trace
        if short2_over_long2 > 2 * MIN_AXIS_RATIO**2:
            found.append((m["m10"] / area, m["m01"] / area, area, xx, xy, yy))
    return found


def _distinct(table: Array) -> Array:
    """Mask (n,) of the rows to keep: of several outlines of one dot the largest, which comes first."""
    keep = np.ones(len(table), bool)
    if len(table) == 0:
        return keep
    radius = np.sqrt(table[:, 2] / np.pi)
    for i, close in enumerate(scipy.spatial.cKDTree(table[:, :2]).query_ball_point(table[:, :2], 0.5 * radius)):
        if keep[i]:
            keep[[j for j in close if j > i and radius[j] > SAME_DOT_RADIUS_RATIO * radius[i]]] = False
    return keep

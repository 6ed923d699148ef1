"""Detection of crossings of two edges, as at a chessboard's inner corners.

Candidates are maxima of the saddle strength Ixy² - Ixx Iyy. Each is kept when the grey values on a ring around it are
bright, dark, bright, dark, and opposite edges lie half a turn apart. Corners are found one by one, so neither whole
squares nor a white margin around the board are needed. Left and right of the columns that vary a strip is not searched.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.detection.image import Grey
from calibration.transforms import Array

MAX_CANDIDATES = 2500
MIN_CONTRAST_LEVELS = 10
"""Least difference of grey levels between bright and dark on the ring."""
RING_SAMPLES = 32
HALF_TURN_TOLERANCE_RAD = 0.45
STRIP_PIXELS, REACH = 200_000, 3
"""Pixels of a strip whose strength fits into a processor's cache, and rows around a maximum that decide on it."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """`points` (n, 2) in px. Going around a point from x to y, the image turns dark at the angle `entering_dark` (n,)
    in [0, pi) and bright at `leaving_dark` (n,), and both again half a turn later; rad."""

    points: Array
    entering_dark: Array
    leaving_dark: Array


def find_crossings(image: Grey, ring_radius_px: float) -> Crossings:
    """All crossings, strongest first; at most MAX_CANDIDATES."""
    smooth = cv2.GaussianBlur(image, (0, 0), 0.3 * ring_radius_px)
    points = _saddle_maxima(np.asarray(smooth, np.uint8), int(np.ceil(ring_radius_px)) + 2)
    angle = np.arange(RING_SAMPLES) * (2 * np.pi / RING_SAMPLES)
    ring = points[:, None] + ring_radius_px * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    levels = _bilinear(np.asarray(smooth, np.uint8), ring)
    brightest, darkest = levels.max(axis=1), levels.min(axis=1)
    levels = levels - (brightest + darkest)[:, None] / 2
    following = np.roll(levels, -1, axis=1)
    changes = (levels > 0) != (following > 0)
    kept = (changes.sum(axis=1) == 4) & (brightest - darkest >= MIN_CONTRAST_LEVELS)
    points, levels, following, changes = points[kept], levels[kept], following[kept], changes[kept]
    at = np.nonzero(changes)[1].reshape(-1, 4)
    here, there = np.take_along_axis(levels, at, 1), np.take_along_axis(following, at, 1)
    edges = (at + here / np.where(here == there, 1.0, here - there)) * (2 * np.pi / RING_SAMPLES)
    off = np.abs(edges[:, 2:] - edges[:, :2] - np.pi)
    kept = np.all(off < HALF_TURN_TOLERANCE_RAD, axis=1)
    lines = (edges[:, :2] + edges[:, 2:] - np.pi) / 2
    first_enters = here[:, 0] > 0
    entering = np.where(first_enters, lines[:, 0], lines[:, 1]) % np.pi
    leaving = np.where(first_enters, lines[:, 1], lines[:, 0])
    return Crossings(points[kept], entering[kept], (entering + (leaving - entering) % np.pi)[kept])


def _saddle_maxima(smooth: Grey, margin: int) -> Array:
    """Sub-pixel maxima (n, 2) of the saddle strength, strongest first."""
    (height, width), strengths, points = smooth.shape, [np.empty(0, np.float32)], [np.empty((0, 2))]
    rows, window = max(1, STRIP_PIXELS // width), np.ones((1, 2 * margin + 1), np.uint8)
    for top in range(margin, height - margin, rows):
        bottom = min(top + rows, height - margin)
        seen = smooth[top - margin : bottom + margin]  # with the rings
        brightest, darkest = cv2.dilate(seen.max(axis=0)[None], window), cv2.erode(seen.min(axis=0)[None], window)
        varied = np.flatnonzero((brightest - darkest)[0, margin : width - margin] >= MIN_CONTRAST_LEVELS) + margin
        if varied.size == 0:
            continue
        left, right = int(varied[0]), int(varied[-1]) + 1
        strip = smooth[top - REACH : bottom + REACH, left - REACH : right + REACH]
        # 16 bits hold the second differences of 8, and single precision their products, without rounding.
        xx, yy, xy = (cv2.Sobel(strip, cv2.CV_16S, a, b, ksize=3) for a, b in ((2, 0), (0, 2), (1, 1)))
        strength = np.asarray(cv2.multiply(xy, xy, dtype=cv2.CV_32F), np.float32)
        strength -= np.asarray(cv2.multiply(xx, yy, dtype=cv2.CV_32F), np.float32)
        is_maximum = strength >= cv2.dilate(strength, np.ones((5, 5), np.uint8))
        is_maximum &= strength > MIN_CONTRAST_LEVELS**2
        is_maximum[:REACH], is_maximum[-REACH:], is_maximum[:, :REACH], is_maximum[:, -REACH:] = 0, 0, 0, 0
        row, column = np.divmod(np.flatnonzero(is_maximum), is_maximum.shape[1])
        x = column + (left - REACH) + _peak(strength, row, column, 0, 1)
        y = row + (top - REACH) + _peak(strength, row, column, 1, 0)
        strengths.append(strength[row, column])
        points.append(np.column_stack([x, y]))
    return np.concatenate(points)[np.argsort(-np.concatenate(strengths), kind="stable")[:MAX_CANDIDATES]]


def _peak(strength: NDArray[np.float32], row: NDArray[np.intp], column: NDArray[np.intp], dv: int, du: int) -> Array:
    """Offset of the parabola's top through three neighbours."""
    before, here, after = (strength[row + k * dv, column + k * du].astype(float) for k in (-1, 0, 1))
    curvature = before - 2 * here + after
    return np.asarray(np.clip((before - after) / np.where(curvature == 0, -1.0, 2 * curvature), -0.5, 0.5))


def _bilinear(image: Grey, points: Array) -> Array:
    """Grey values (n, m) at points (n, m, 2)."""
    base = np.floor(points).astype(np.intp)
    u = np.clip(base[..., 0], 0, image.shape[1] - 2)
    v = np.clip(base[..., 1], 0, image.shape[0] - 2)
    fu, fv = points[..., 0] - u, points[..., 1] - v
    levels, width = image.ravel(), image.shape[1]
    at = v * width + u
    upper_left, upper_right, lower_left, lower_right = (
        levels[at + step].astype(float) for step in (0, 1, width, width + 1)
    )
    upper = upper_left + (upper_right - upper_left) * fu
    lower = lower_left + (lower_right - lower_left) * fu
    return np.asarray(upper + (lower - upper) * fv)

"""Squares around chessboard corners: which are black, and how large a window fits between them."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.detection.image import Grey
from calibration.transforms import Array

HALF_WINDOW_OF_SQUARE = 0.3
MIN_HALF_WINDOW_PX, MAX_HALF_WINDOW_PX = 2, 9
PROBE_OF_SIDE = 0.25
"""Where a square's colour is read: this share of both sides from the corner, clear of blur and ChArUco markers."""

MIN_BLANK = 0.7
"""Least level of a chessboard's white squares in their middle, from black (0) to white (1): a marker is darker."""


def corner_contrast(image: Grey, corners: Array, along_u: Array, along_v: Array) -> Array:
    """Darkest white minus brightest black (n,), in grey levels, of the four squares around each corner (n, 2) px.

    Positive when the square between +u and +v is black, negative when it is white, 0 when the four squares do not
    alternate. `along_u`, `along_v` (n, 2): the sides of the square, in px.
    """
    u, v = PROBE_OF_SIDE * along_u, PROBE_OF_SIDE * along_v
    same = [level_at(image, corners + u + v), level_at(image, corners - u - v)]
    other = [level_at(image, corners + u - v), level_at(image, corners - u + v)]
    black_first = np.minimum(*other) - np.maximum(*same)
    white_first = np.minimum(*same) - np.maximum(*other)
    return np.asarray(np.where(black_first > 0, black_first, np.where(white_first > 0, -white_first, 0.0)))


def level_at(image: Grey, points: Array) -> NDArray[np.float64]:
    """Grey levels (...) of the pixels nearest to points (..., 2)."""
    column = np.clip(np.rint(points[..., 0]).astype(np.intp), 0, image.shape[1] - 1)
    row = np.clip(np.rint(points[..., 1]).astype(np.intp), 0, image.shape[0] - 1)
    return image[row, column].astype(float)


def squares_are_blank(image: Grey, corners: Array) -> bool:
    """Whether the white squares between corners (v, u, 2) px are white in their middle."""
    middles = (corners[:-1, :-1] + corners[1:, :-1] + corners[:-1, 1:] + corners[1:, 1:]) / 4
    levels = level_at(np.asarray(cv2.blur(image, (3, 3)), np.uint8), middles)
    v, u = np.indices(levels.shape)
    one, other = levels[(u + v) % 2 == 0], levels[(u + v) % 2 == 1]
    black, white = sorted((one, other), key=lambda group: float(np.median(group)))
    darkest, brightest = np.percentile(black, 10), np.percentile(white, 90)
    return bool(np.median(white) - darkest > MIN_BLANK * (brightest - darkest) and white.std() < brightest - darkest)


def narrowest_side(along_u: Array, along_v: Array) -> Array:
    """Distance (n,) in px between opposite sides of foreshortened squares, given their sides (n, 2)."""
    area = np.abs(along_u[:, 0] * along_v[:, 1] - along_u[:, 1] * along_v[:, 0])
    return np.asarray(area / np.maximum(np.maximum(np.hypot(*along_u.T), np.hypot(*along_v.T)), 1e-9))


def half_window_px(narrowest_px: Array, clear_of_square: float) -> int:
    """Half the side in px of the window a corner is fitted in: a share of the narrowest square, within bounds."""
    share = min(HALF_WINDOW_OF_SQUARE, clear_of_square)
    return int(np.clip(round(share * float(narrowest_px.min())), MIN_HALF_WINDOW_PX, MAX_HALF_WINDOW_PX))

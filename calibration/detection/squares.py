"""The colours around chessboard corners: which are black, and whether a point is a corner of the board at all."""

import numpy as np
from numpy.typing import NDArray

from calibration.detection.image import Grey
from calibration.transforms import Array

PROBE = 0.25
"""How far along both sides of the square from its corner a colour is read: clear of blur, and of ChArUco markers."""


def corner_contrast(image: Grey, corners: Array, along_u: Array, along_v: Array) -> Array:
    """White minus black (n,) at the darkest white and the brightest black around each corner (n, 2).

    Positive when the square between +u and +v is black, negative when it is white, 0 when the four squares do not
    alternate. `along_u`, `along_v` (n, 2): the sides of the square, in px.
    """
    u, v = PROBE * along_u, PROBE * along_v
    same = [_level(image, corners + u + v), _level(image, corners - u - v)]
    other = [_level(image, corners + u - v), _level(image, corners - u + v)]
    black_first = np.minimum(*other) - np.maximum(*same)
    white_first = np.minimum(*same) - np.maximum(*other)
    return np.asarray(np.where(black_first > 0, black_first, np.where(white_first > 0, -white_first, 0.0)))


def _level(image: Grey, points: Array) -> NDArray[np.float64]:
    column = np.clip(np.rint(points[..., 0]).astype(np.intp), 0, image.shape[1] - 1)
    row = np.clip(np.rint(points[..., 1]).astype(np.intp), 0, image.shape[0] - 1)
    return image[row, column].astype(float)

"""Grey levels of 10, 12, 14 or 16 bits as 8 bits.

Cameras put 10 or 12 bits into a 16-bit file unshifted, so its upper byte alone would hold 4 or 16 grey levels.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

DEPTHS = (8, 10, 12, 14, 16)
"""Bits of a camera's grey levels."""


def content_white(image: NDArray[np.uint16]) -> int:
    """The largest grey level of the least depth in DEPTHS that holds the image's brightest pixel."""
    brightest = int(image.max(initial=0))
    bits = next(bits for bits in DEPTHS if brightest < 1 << bits)
    return (1 << bits) - 1


def to_8_bit(image: NDArray[Any], white: int | None = None) -> NDArray[np.uint8]:
    """uint8 as it is; of uint16 `white`, by default `content_white`, becomes 255, and what is brighter as well."""
    if image.dtype == np.uint8:
        return image
    white = content_white(image) if white is None else white
    return np.asarray(cv2.convertScaleAbs(image, alpha=255 / white), np.uint8)  # 17 times as fast as a table

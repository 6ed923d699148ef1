"""Chessboards: found in a reduced image, refined in the full one."""

import cv2
import numpy as np

from calibration.detection.image import Grey, at_full_size, reduced
from calibration.detection.order import canonical
from calibration.detection.saddle import refine_saddles
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.targets import Chessboard
from calibration.transforms import Array

SEARCH_PIXELS = 1.0e6
WINDOW_OF_SPACING = 0.3
SMALLEST_WINDOW_PX, LARGEST_WINDOW_PX = 2, 9


def detect_chessboard(image: Grey, target: Chessboard) -> Detection:
    """All inner corners. Raises DetectionError `not-found`."""
    small, factor = reduced(image, SEARCH_PIXELS)
    size = (target.columns, target.rows)
    found, corners = cv2.findChessboardCorners(
        small, size, flags=cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    )
    if not found:
        found, corners = cv2.findChessboardCornersSB(small, size)
    if found:
        grid = at_full_size(corners.reshape(-1, 2).astype(float), factor).reshape(target.rows, target.columns, 2)
        refined, inside = refine_saddles(image, grid.reshape(-1, 2), window_px(grid))
        ordered = canonical(refined.reshape(grid.shape), target.columns, target.rows, image)
        if inside.all() and ordered is not None:
            return Detection(np.arange(target.columns * target.rows), ordered.reshape(-1, 2))
    what = f"no chessboard of {target.columns}×{target.rows} inner corners was found"
    raise DetectionError("not-found", what, "bring the whole board into view, without glare; check columns and rows")


def window_px(grid: Array) -> int:
    """Half the window of the saddle fit: inside the squares, and no larger than it pays."""
    spacing = min(float(np.hypot(*np.moveaxis(np.diff(grid, axis=axis), -1, 0)).min()) for axis in (0, 1))
    return int(np.clip(round(WINDOW_OF_SPACING * spacing), SMALLEST_WINDOW_PX, LARGEST_WINDOW_PX))

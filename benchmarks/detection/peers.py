"""OpenCV's detectors, called as in its tutorials."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.detection.charuco import charuco_board
from calibration.targets import Charuco, Chessboard
from calibration.transforms import Array

Grey = NDArray[np.uint8]


def find_chessboard_corners_sb(image: Grey, target: Chessboard) -> Array | None:
    """findChessboardCornersSB."""
    found, corners = cv2.findChessboardCornersSB(image, (target.columns, target.rows), flags=cv2.CALIB_CB_ACCURACY)
    return corners.reshape(-1, 2) if found else None


def corner_sub_pix(image: Grey, target: Chessboard) -> Array | None:
    """findChessboardCorners, then cornerSubPix with the tutorial's window of 11."""
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    found, corners = cv2.findChessboardCorners(image, (target.columns, target.rows), flags=flags)
    if not found:
        return None
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)
    return cv2.cornerSubPix(image, corners, (11, 11), (-1, -1), criteria).reshape(-1, 2)


def charuco_detector(image: Grey, target: Charuco) -> Array | None:
    """CharucoDetector, which refines with cornerSubPix."""
    corners, ids, _, _ = cv2.aruco.CharucoDetector(charuco_board(target)).detectBoard(image)
    return corners.reshape(-1, 2) if ids is not None and len(ids) else None


def circles_grid(image: Grey, target: object) -> Array | None:
    """findCirclesGrid."""
    size = (target.columns, target.rows)  # type: ignore[attr-defined]
    asymmetric = target.layout == "asymmetric"  # type: ignore[attr-defined]
    flag = cv2.CALIB_CB_ASYMMETRIC_GRID if asymmetric else cv2.CALIB_CB_SYMMETRIC_GRID
    found, centres = cv2.findCirclesGrid(image, size, flags=flag)
    return centres.reshape(-1, 2) if found else None

"""The shapes of targets with markers, as OpenCV draws the markers."""

from typing import Any

import cv2
import numpy as np

from calibration.targets import Charuco, MarkerTarget, require_markers
from calibration.transforms import Array
from daemon.tools.target_print.shapes import Artwork, Box, Rectangles, chessboard_squares


def charuco(target: Charuco) -> Artwork:
    """Raises DetectionError for markers that OpenCV does not have."""
    require_markers(target)
    dictionary = _dictionary(target.dictionary)
    board = cv2.aruco.CharucoBoard((target.columns, target.rows), target.square_mm, target.marker_mm, dictionary)
    board.setLegacyPattern(target.legacy)
    corners_mm = [np.asarray(corners, float)[:, :2] for corners in board.getObjPoints()]
    ids = np.asarray(board.getIds()).ravel()
    holds_marker = {tuple((corners.mean(axis=0) // target.square_mm).astype(int)) for corners in corners_mm}
    squares = chessboard_squares(target.columns, target.rows, target.square_mm, origin=0.0)
    black = tuple(box for column, row, box in squares if (column, row) not in holds_marker)
    markers = tuple(
        _marker(dictionary, int(marker), corners.min(axis=0), target.marker_mm)
        for marker, corners in zip(ids, corners_mm, strict=True)
    )
    margin = target.square_mm / 2
    width, height = target.columns * target.square_mm, target.rows * target.square_mm
    return Artwork((Rectangles(black), *markers), Box(-margin, -margin, width + margin, height + margin))


def marker_grid(target: MarkerTarget) -> Artwork:
    """Raises DetectionError for markers that OpenCV does not have."""
    require_markers(target)
    grid, origins = target.markers, target.points_mm[::4, :2]
    dictionary = _dictionary(grid.dictionary)
    markers = tuple(
        _marker(dictionary, number, origin, grid.side_mm) for number, origin in enumerate(origins, start=grid.first)
    )
    (right, bottom), margin = origins.max(axis=0) + grid.side_mm, grid.side_mm / 2
    return Artwork(markers, Box(-margin, -margin, right + margin, bottom + margin))


def _dictionary(name: str) -> Any:
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


def _marker(dictionary: Any, marker: int, corner: Array, edge: float) -> Rectangles:
    """The black cells of a marker, `edge` mm wide with its border; adjacent cells of a row are joined."""
    cells = np.asarray(dictionary.generateImageMarker(marker, dictionary.markerSize + 2))
    left, top = (float(value) for value in corner)
    cell = edge / len(cells)
    boxes = []
    for row, line in enumerate(cells):
        changes = np.flatnonzero(np.diff(np.concatenate([[255], line, [255]]) != 0))
        for start, stop in changes.reshape(-1, 2).tolist():
            boxes.append(Box(left + start * cell, top + row * cell, left + stop * cell, top + (row + 1) * cell))
    return Rectangles(tuple(boxes))

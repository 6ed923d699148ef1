"""The shapes of each kind of target in its own frame (see `calibration.targets`), in mm."""

from functools import singledispatch
from typing import Any

import numpy as np

from calibration.targets import (
    AprilTagGrid,
    ArucoGrid,
    ArucoMarker,
    Charuco,
    Chessboard,
    CircleGrid,
    MarkerTarget,
    Target,
    require_markers,
)
from calibration.transforms import Array
from daemon.tools.target_print.shapes import Artwork, Box, Disc, Rectangles

DOT_RADIUS = 0.25
"""Relative to the distance to the nearest neighbour: dots and gaps are equally wide."""

LARGE_DOT_RADIUS = 0.375
"""The origin dot of a circle grid: 1.5 times the radius of the others."""


@singledispatch
def artwork(target: Target) -> Artwork:
    """The shapes of `target` and the paper it needs. Raises DetectionError for markers that OpenCV does not have."""
    raise TypeError(f"no artwork for {type(target).__name__}")


@artwork.register
def _(target: Chessboard) -> Artwork:
    pitch = target.pitch_mm
    squares = _squares(target.columns + 1, target.rows + 1, pitch, origin=-pitch)
    black = tuple(box for column, row, box in squares if (column + row) % 2 == 0)
    extent = Box(-2 * pitch, -2 * pitch, (target.columns + 1) * pitch, (target.rows + 1) * pitch)
    return Artwork((Rectangles(black),), extent)


@artwork.register
def _(target: Charuco) -> Artwork:
    import cv2

    require_markers(target)
    dictionary = _dictionary(target.dictionary)
    board = cv2.aruco.CharucoBoard((target.columns, target.rows), target.square_mm, target.marker_mm, dictionary)
    board.setLegacyPattern(target.legacy)
    corners_mm = [np.asarray(corners, float)[:, :2] for corners in board.getObjPoints()]
    ids = np.asarray(board.getIds()).ravel()
    holds_marker = {tuple((corners.mean(axis=0) // target.square_mm).astype(int)) for corners in corners_mm}
    squares = _squares(target.columns, target.rows, target.square_mm, origin=0.0)
    black = tuple(box for column, row, box in squares if (column, row) not in holds_marker)
    markers = tuple(
        _marker(dictionary, int(marker), corners.min(axis=0), target.marker_mm)
        for marker, corners in zip(ids, corners_mm, strict=True)
    )
    margin = target.square_mm / 2
    width, height = target.columns * target.square_mm, target.rows * target.square_mm
    return Artwork((Rectangles(black), *markers), Box(-margin, -margin, width + margin, height + margin))


@artwork.register
def _(target: CircleGrid) -> Artwork:
    neighbour = target.pitch_mm if target.layout == "symmetric" else target.pitch_mm / np.sqrt(2)
    points = target.points_mm
    (left, top), (right, bottom) = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    extent = Box(left - neighbour, top - neighbour, right + neighbour, bottom + neighbour)
    ground = (Rectangles((extent,)),) if target.dots == "white" else ()
    dots = tuple(
        Disc(float(x), float(y), (LARGE_DOT_RADIUS if large else DOT_RADIUS) * neighbour, target.dots)
        for large, (x, y, _) in zip(_large(target), points, strict=True)
    )
    return Artwork((*ground, *dots), extent)


@artwork.register(AprilTagGrid)
@artwork.register(ArucoGrid)
@artwork.register(ArucoMarker)
def _(target: MarkerTarget) -> Artwork:
    require_markers(target)
    grid, origins = target.markers, target.points_mm[::4, :2]
    dictionary = _dictionary(grid.dictionary)
    markers = tuple(
        _marker(dictionary, number, origin, grid.side_mm) for number, origin in enumerate(origins, start=grid.first)
    )
    (right, bottom), margin = origins.max(axis=0) + grid.side_mm, grid.side_mm / 2
    return Artwork(markers, Box(-margin, -margin, right + margin, bottom + margin))


def _large(target: CircleGrid) -> list[bool]:
    return [index == 0 and target.origin == "large-dot" for index in range(target.columns * target.rows)]


def _squares(columns: int, rows: int, edge: float, origin: float) -> list[tuple[int, int, Box]]:
    return [
        (
            column,
            row,
            Box(origin + column * edge, origin + row * edge, origin + (column + 1) * edge, origin + (row + 1) * edge),
        )
        for row in range(rows)
        for column in range(columns)
    ]


def _dictionary(name: str) -> Any:
    import cv2

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

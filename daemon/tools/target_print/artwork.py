"""The shapes of each kind of target in its own frame (see `calibration.targets`), in mm.

Those of markers are in `marker_artwork`: only they need OpenCV and numpy, which take long to import.
"""

import math
from functools import singledispatch

from calibration.targets import AprilTagGrid, ArucoGrid, ArucoMarker, Charuco, Chessboard, CircleGrid, Target
from daemon.tools.target_print.shapes import Artwork, Box, Disc, Rectangles, chessboard_squares

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
    squares = chessboard_squares(target.columns + 1, target.rows + 1, pitch, origin=-pitch)
    black = tuple(box for column, row, box in squares if (column + row) % 2 == 0)
    extent = Box(-2 * pitch, -2 * pitch, (target.columns + 1) * pitch, (target.rows + 1) * pitch)
    return Artwork((Rectangles(black),), extent)


@artwork.register
def _(target: CircleGrid) -> Artwork:
    neighbour = target.pitch_mm if target.layout == "symmetric" else target.pitch_mm / math.sqrt(2)
    centres = target.centres_mm
    columns_mm, rows_mm = [x for x, _, _ in centres], [y for _, y, _ in centres]
    extent = Box(
        min(columns_mm) - neighbour, min(rows_mm) - neighbour, max(columns_mm) + neighbour, max(rows_mm) + neighbour
    )
    ground = (Rectangles((extent,)),) if target.dots == "white" else ()
    dots = tuple(
        Disc(x, y, (LARGE_DOT_RADIUS if large else DOT_RADIUS) * neighbour, target.dots)
        for large, (x, y, _) in zip(_large(target), centres, strict=True)
    )
    return Artwork((*ground, *dots), extent)


@artwork.register
def _(target: Charuco) -> Artwork:
    from daemon.tools.target_print.marker_artwork import charuco

    return charuco(target)


@artwork.register(AprilTagGrid)
@artwork.register(ArucoGrid)
@artwork.register(ArucoMarker)
def _(target: AprilTagGrid | ArucoGrid | ArucoMarker) -> Artwork:
    from daemon.tools.target_print.marker_artwork import marker_grid

    return marker_grid(target)


def _large(target: CircleGrid) -> list[bool]:
    return [index == 0 and target.origin == "large-dot" for index in range(target.columns * target.rows)]

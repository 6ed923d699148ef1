"""Planar targets: the coordinates of their points in mm, in the target's frame.

x runs along a row (columns count along it), y runs down the columns, z points into the board, away from the
camera that looks at it. The id of a point is its index, row by row.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from calibration.transforms import Array


def _grid(columns: int, rows: int, pitch_mm: float) -> Array:
    v, u = np.mgrid[:rows, :columns].reshape(2, -1)
    return np.column_stack([u * pitch_mm, v * pitch_mm, np.zeros(u.size)])


@dataclass(frozen=True)
class Chessboard:
    """`columns` × `rows` inner corners; the origin is the first of them."""

    columns: int
    rows: int
    pitch_mm: float

    @cached_property
    def points_mm(self) -> Array:
        """(n, 3)"""
        return _grid(self.columns, self.rows, self.pitch_mm)


@dataclass(frozen=True)
class Charuco:
    """`columns` × `rows` squares; its points are the inner corners, its origin the board's outer corner (as OpenCV)."""

    columns: int
    rows: int
    square_mm: float
    marker_mm: float
    dictionary: str
    legacy: bool = False

    @cached_property
    def points_mm(self) -> Array:
        """(n, 3)"""
        inner = _grid(self.columns - 1, self.rows - 1, self.square_mm)
        points: Array = inner + np.array([self.square_mm, self.square_mm, 0.0])
        return points


@dataclass(frozen=True)
class CircleGrid:
    """Circle centres; asymmetric: OpenCV's, `pitch_mm` between neighbours in a row, odd rows shifted by half."""

    layout: Literal["symmetric", "asymmetric"]
    columns: int
    rows: int
    pitch_mm: float
    dots: Literal["black", "white"] = "black"
    origin: Literal["large-dot"] | None = None

    @cached_property
    def points_mm(self) -> Array:
        """(n, 3)"""
        if self.layout == "symmetric":
            return _grid(self.columns, self.rows, self.pitch_mm)
        v, u = np.mgrid[: self.rows, : self.columns].reshape(2, -1)
        half = self.pitch_mm / 2
        return np.column_stack([(2 * u + v % 2) * half, v * half, np.zeros(u.size)])


@dataclass(frozen=True)
class AprilTagGrid:
    """`columns` × `rows` tags; four corners a tag, id = 4 tag + corner; origin at tag 0's first."""

    columns: int
    rows: int
    tag_mm: float
    gap_mm: float
    family: str = "tag36h11"

    @cached_property
    def points_mm(self) -> Array:
        """(n, 3)"""
        origins = _grid(self.columns, self.rows, self.tag_mm + self.gap_mm)
        corners = self.tag_mm * np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
        points: Array = (origins[:, None] + corners).reshape(-1, 3)
        return points


Target = Chessboard | Charuco | CircleGrid | AprilTagGrid

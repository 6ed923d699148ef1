"""Shapes on a page, in mm; x to the right, y down."""

from dataclasses import dataclass, field, replace
from typing import Literal

Ink = Literal["black", "white"]


@dataclass(frozen=True)
class Box:
    """A rectangle by its edges."""

    left: float
    top: float
    right: float
    bottom: float

    @property
    def width(self) -> float:
        return self.right - self.left

    @property
    def height(self) -> float:
        return self.bottom - self.top

    def translate(self, x: float, y: float) -> "Box":
        return Box(self.left + x, self.top + y, self.right + x, self.bottom + y)


@dataclass(frozen=True)
class Rectangles:
    """Boxes filled as one path, so that touching ones show no seam."""

    boxes: tuple[Box, ...]
    ink: Ink = "black"

    def translate(self, x: float, y: float) -> "Rectangles":
        return replace(self, boxes=tuple(box.translate(x, y) for box in self.boxes))


@dataclass(frozen=True)
class Disc:
    """A filled circle."""

    x: float
    y: float
    radius: float
    ink: Ink = "black"

    def translate(self, x: float, y: float) -> "Disc":
        return replace(self, x=self.x + x, y=self.y + y)


@dataclass(frozen=True)
class TextLine:
    """One line of text; `x`, `y` is the left end of its baseline, `size` its em in mm."""

    x: float
    y: float
    size: float
    text: str


Shape = Rectangles | Disc | TextLine


@dataclass(frozen=True)
class Artwork:
    """A target's shapes in its own frame; `extent` is the area it needs, with its white margin."""

    shapes: tuple[Rectangles | Disc, ...]
    extent: Box


@dataclass(frozen=True)
class Sheet:
    """A finished page. `target_origin` is the origin of the target's frame on it, in mm."""

    width: float
    height: float
    target_origin: tuple[float, float]
    title: str
    shapes: tuple[Shape, ...] = field(default=())


def chessboard_squares(columns: int, rows: int, edge: float, origin: float) -> list[tuple[int, int, Box]]:
    """(column, row, square) of each square; the first one's left upper corner is at (origin, origin)."""
    return [
        (column, row, Box(x, y, x + edge, y + edge))
        for row in range(rows)
        for column in range(columns)
        for x, y in [(origin + column * edge, origin + row * edge)]
    ]


def number_text(value: float) -> str:
    """A length to 0.01 um."""
    return f"{value:.5f}".rstrip("0").rstrip(".")

"""What a page is made of. Millimetres, x to the right, y down."""

from dataclasses import dataclass, field, replace
from typing import Literal

Ink = Literal["black", "white"]


@dataclass(frozen=True)
class Box:
    """Left, top, right and bottom edge."""

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

    def moved(self, x: float, y: float) -> "Box":
        return Box(self.left + x, self.top + y, self.right + x, self.bottom + y)


@dataclass(frozen=True)
class Rectangles:
    """Boxes filled as one path, so that touching edges leave no seam."""

    boxes: tuple[Box, ...]
    ink: Ink = "black"

    def moved(self, x: float, y: float) -> "Rectangles":
        return replace(self, boxes=tuple(box.moved(x, y) for box in self.boxes))


@dataclass(frozen=True)
class Disc:
    """A filled circle."""

    x: float
    y: float
    radius: float
    ink: Ink = "black"

    def moved(self, x: float, y: float) -> "Disc":
        return replace(self, x=self.x + x, y=self.y + y)


@dataclass(frozen=True)
class Words:
    """One line of text; `x`, `y` is the left end of its base line, `size` the height of its em."""

    x: float
    y: float
    size: float
    text: str


Shape = Rectangles | Disc | Words


@dataclass(frozen=True)
class Artwork:
    """A target's shapes in its own frame, and the paper it needs: with the quiet white margin around it."""

    shapes: tuple[Rectangles | Disc, ...]
    extent: Box


@dataclass(frozen=True)
class Sheet:
    """A finished page. `target_origin` is where the target's frame begins on it."""

    width: float
    height: float
    target_origin: tuple[float, float]
    shapes: tuple[Shape, ...] = field(default=())

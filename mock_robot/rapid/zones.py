"""World zones: volumes in the world frame for the active tool's centre point."""

from collections.abc import Callable

import numpy as np

from calibration.transforms import Array
from mock_robot.rapid.types import Atom

Contains = Callable[[Array], bool]
"""Whether a point (3,) in the world, mm, lies in a volume."""


class Shape:
    """A shapedata: a volume, or with `outside` all but the volume."""

    def __init__(self) -> None:
        self.contains: Contains = _nowhere

    def set(self, contains: Contains, outside: bool) -> None:
        """Define the volume."""
        self.contains = (lambda point: not contains(point)) if outside else contains


class Zone:
    """A wztemporary or wzstationary: `end` removes what it does."""

    def __init__(self) -> None:
        self.begin: Callable[[], None] = _idle
        self.end: Callable[[], None] = _idle


def box(low: list[float], high: list[float]) -> Contains:
    """Between two corners."""
    least, most = np.minimum(low, high), np.maximum(low, high)
    return lambda point: bool(np.all((least <= point) & (point <= most)))


def sphere(centre: list[float], radius: float) -> Contains:
    """Within a radius of a point."""
    return lambda point: bool(np.linalg.norm(point - np.array(centre)) <= abs(radius))


def cylinder(centre: list[float], radius: float, height: float) -> Contains:
    """Upright on its bottom centre; a negative height goes down."""
    low, high = sorted((centre[2], centre[2] + height))
    return lambda point: bool(
        low <= point[2] <= high and np.linalg.norm(point[:2] - np.array(centre[:2])) <= abs(radius)
    )


def _nowhere(point: Array) -> bool:
    return False


def _idle() -> None:
    """What a zone does that was not set."""


SHAPEDATA = Atom("shapedata", Shape, device=True)
WZSTATIONARY = Atom("wzstationary", Zone, device=True)
WZTEMPORARY = Atom("wztemporary", Zone, device=True)

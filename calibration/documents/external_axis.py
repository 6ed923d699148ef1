"""A track or turntable as documents have it: readings and zero in mm, of a turntable in degrees, as controllers do."""

from collections.abc import Sequence
from math import degrees
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from calibration.documents.pose import Vector, is_direction
from calibration.documents.validation import Document
from calibration.errors import DocumentError
from calibration.kinematics.external_axis import AxisKind, ExternalAxis, reading_of
from calibration.kinematics.stance import Stance
from calibration.solution import ExternalAxisEstimate
from calibration.transforms import Array

Reading = Annotated[float, Field(ge=-1e6, le=1e6)]
ExternalAxes = Annotated[tuple[Reading | None, ...], Field(min_length=1, max_length=6)]
"""The controller's external axes from the first, mm or degrees; null for one that it does not have."""

UNITS: dict[AxisKind, str] = {"track": "mm", "turntable": "degrees"}

MIN_UNUSED = 8.9e9
"""ABB gives 9E9 for an axis that does not exist."""


def external_axes_of(values: Sequence[float]) -> tuple[float | None, ...] | None:
    """The axes of a pose reading, None where it has none."""
    axes = tuple(None if value >= MIN_UNUSED else round(float(value), 6) for value in values)
    return axes if any(value is not None for value in axes) else None


class ExternalAxisDocument(Document):
    """A track under the arm, or a turntable under the part, that the controller leaves out of the arm's poses."""

    kind: AxisKind
    """track: it moves the base; turntable: it turns the part."""
    number: Annotated[int, Field(ge=1, le=6)] = 1
    """Which of the controller's external axes, 1 to 6."""
    direction: Vector
    """In the base: the base moves that way, or the part turns about it right-handed."""
    point_mm: Vector | None = None
    """On a turntable's axis, in the base, mm; null for a track."""
    zero: Reading = 0.0
    """Reading at which base and part stand where all results have them, mm or degrees."""

    @model_validator(mode="after")
    def _check_geometry(self) -> "ExternalAxisDocument":
        if not is_direction(self.direction):
            raise ValueError("direction is a vector, such as [0, 1, 0]")
        if (self.kind == "turntable") != (self.point_mm is not None):
            raise ValueError("a turntable has point_mm, a point on its axis in the base; a track has none")
        return self

    def axis(self) -> ExternalAxis:
        """As the solver takes it."""
        direction = np.array(self.direction) / np.linalg.norm(self.direction)
        point_mm = np.array(self.point_mm or (0.0, 0.0, 0.0))
        return ExternalAxis(self.kind, self.number, direction, point_mm, reading_of(self.kind, self.zero))

    def reading(self, external_axes: Sequence[float | None] | None) -> float | None:
        """As `ExternalAxis.reading`."""
        return self.axis().reading(external_axes)


Twelve = Annotated[tuple[float, ...], Field(min_length=12, max_length=12)]


class FoundAxisDocument(ExternalAxisDocument):
    """The axis as it was found from the views; direction and point vary across the axis only."""

    direction: Vector
    """As found, of length 1, in the base."""
    point_mm: Vector | None = None
    """On a turntable's axis as found, in the base, mm; null for a track."""
    readings: tuple[float, float]
    """Lowest and highest of the views, mm or degrees."""
    off_deg: float
    """Angle of the direction from the given one, degrees."""
    sigma_mm: float
    """Of a registered point at its worst over the views, over three axes, mm."""
    expanded_mm: float
    """U (k = 2) of it, mm."""
    covariance: Annotated[tuple[Twelve, ...], Field(min_length=12, max_length=12)]
    """12 x 12 of X @ exp(.), rad and mm, direction, and point_mm."""

    @classmethod
    def of(cls, found: ExternalAxisEstimate) -> "FoundAxisDocument":
        axis, outside = found.axis, float if found.axis.kind == "track" else degrees
        low, high = found.readings
        values: dict[str, Any] = {
            "kind": axis.kind,
            "number": axis.number,
            "direction": axis.direction.tolist(),
            "point_mm": None if axis.kind == "track" else axis.point_mm.tolist(),
            "zero": outside(axis.zero),
            "readings": (outside(low), outside(high)),
            "off_deg": degrees(found.off_rad),
            "sigma_mm": found.sigma_mm,
            "expanded_mm": found.expanded_mm,
            "covariance": found.covariance.tolist(),
        }
        return cls.model_validate(values)

    def place(self, base_T_flange: Array, stances: Sequence[Stance]) -> Array:
        """As `Correction`: as if the axis stood at zero. Raises DocumentError for a stance without its reading."""
        axis = self.axis()
        known = [reading for one in stances if (reading := axis.reading(one.external_axes)) is not None]
        if len(known) < len(stances):
            what = (
                f"the calibration has a {self.kind}, external axis {self.number}, and a pose comes without its reading"
            )
            fix = f"give external_axes beside the pose, {UNITS[self.kind]}; or let the pose be read from the robot"
            raise DocumentError.one("pose", "external_axes", what, fix)
        return axis.at_zero(base_T_flange, known)

"""The user's requirement: limits of the verdict, and the points at which the uncertainty counts."""

from collections.abc import Callable, Mapping
from math import degrees, radians
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from calibration.documents.pose import Vector
from calibration.documents.validation import Document
from calibration.likelihood.mapped_points import NamedPoint, box_points
from calibration.solution import PointFrame
from calibration.verdict import DEFAULT_VERDICT_LIMITS as DEFAULT
from calibration.verdict import VerdictLimits

MAX_TOLERANCE_MM = 1000.0

Tolerance = Annotated[float, Field(gt=0, le=MAX_TOLERANCE_MM)]
"""U (k = 2) at the worst of the points that matter."""


class BoundsDocument(Document):
    """The limits of the verdict except the tolerance: beyond `possible_` or `rejected_share` a calibration is rejected;
    beyond the others the verdict warns of a likely cause."""

    point_warning_mm: PositiveFloat = DEFAULT.point_warning_mm
    axis_angle_deg: NonNegativeFloat = round(degrees(DEFAULT.axis_angle_rad), 9)
    robot_translation_mm: PositiveFloat = DEFAULT.robot_translation_mm
    robot_rotation_deg: PositiveFloat = round(degrees(DEFAULT.robot_rotation_rad), 9)
    possible_translation_mm: PositiveFloat = DEFAULT.possible_translation_mm
    possible_rotation_deg: PositiveFloat = round(degrees(DEFAULT.possible_rotation_rad), 9)
    image_px: PositiveFloat = DEFAULT.image_px
    rejected_share: Annotated[float, Field(gt=0, le=1)] = DEFAULT.rejected_share
    hold_out_ratio: PositiveFloat = DEFAULT.hold_out_ratio
    possible_hold_out_mm: PositiveFloat = DEFAULT.possible_hold_out_mm
    negligible_share: Annotated[float, Field(ge=0, le=1)] = DEFAULT.negligible_share
    warning_share: Annotated[float, Field(ge=0, le=1)] = DEFAULT.warning_share
    print_scale_share: Annotated[float, Field(gt=0, le=1)] = DEFAULT.print_scale_share
    lens_share: Annotated[float, Field(gt=0, le=1)] = DEFAULT.lens_share
    points_size_share: Annotated[float, Field(gt=0, le=1)] = DEFAULT.points_size_share
    leave_out_probability: Annotated[float, Field(ge=0, le=1)] = DEFAULT.leave_out_probability
    mount_sigma: PositiveFloat = DEFAULT.mount_sigma


class LimitsInForceDocument(BoundsDocument):
    """All limits by which a verdict was given. `tolerance_mm`: of U (k = 2) at the worst of the points that matter;
    `tolerance_stated`: whether somebody stated it."""

    tolerance_mm: Tolerance
    tolerance_stated: bool = False

    @classmethod
    def of(cls, limits: VerdictLimits) -> "LimitsInForceDocument":
        return cls(**_renamed(vars(limits), "_rad", "_deg", lambda angle_rad: round(degrees(angle_rad), 9)))


class VerdictSettings(BoundsDocument):
    """The limits of the verdict."""

    def limits(self, tolerance_mm: float | None = None) -> VerdictLimits:
        """The limits in force with a stated tolerance, or with DEFAULT_TOLERANCE_MM."""
        return VerdictLimits(**_renamed(self.model_dump(), "_deg", "_rad", radians)).with_tolerance(tolerance_mm)


class NamedPointDocument(Document):
    """A point that matters, in the base's or the camera's frame."""

    name: Annotated[str, Field(min_length=1, max_length=100)]
    position_mm: Vector
    frame: PointFrame = "base"


class PointsDocument(Document):
    """Where the uncertainty counts: the corners of a box in the base, and named points; the working volume without."""

    box_mm: tuple[Vector, Vector] | None = None
    points: Annotated[tuple[NamedPointDocument, ...], Field(max_length=1000)] = ()

    @model_validator(mode="after")
    def _check_box(self) -> "PointsDocument":
        if self.box_mm is not None and any(a > b for a, b in zip(*self.box_mm, strict=True)):
            raise ValueError("box_mm is [[xmin, ymin, zmin], [xmax, ymax, zmax]], no minimum above its maximum")
        return self

    def named_points(self) -> tuple[NamedPoint, ...]:
        corners = () if self.box_mm is None else box_points(np.array(self.box_mm))
        named = (NamedPoint(point.name, point.frame, np.array(point.position_mm)) for point in self.points)
        return (*corners, *named)


class PointsFile(PointsDocument):
    """The file of `solve --at`."""

    heading = "pointsjson"

    schema_version: Literal[1]


def _renamed(values: Mapping[str, Any], suffix: str, other: str, convert: Callable[[float], float]) -> dict[str, Any]:
    """`values` with those whose name ends in `suffix` converted, and their names ending in `other`."""
    return {
        name.removesuffix(suffix) + other if name.endswith(suffix) else name: (
            convert(value) if name.endswith(suffix) else value
        )
        for name, value in values.items()
    }

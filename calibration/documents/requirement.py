"""The user's requirement: limits of the verdict, and the points at which the uncertainty counts."""

from collections.abc import Callable, Mapping
from math import degrees, radians
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from calibration.documents.pose import Vector
from calibration.documents.validation import Document
from calibration.likelihood.mapped_points import box_points
from calibration.solution import NamedPoint, PointFrame
from calibration.verdict import DEFAULT_VERDICT_LIMITS as DEFAULT
from calibration.verdict import VerdictLimits

MAX_TOLERANCE_MM = 1000.0

Tolerance = Annotated[float, Field(gt=0, le=MAX_TOLERANCE_MM)]
"""U (k = 2) at the worst of the points that matter."""


class BoundsDocument(Document):
    """The limits of the verdict except the tolerance: beyond `possible_` or `rejected_share` a calibration is rejected;
    beyond the others the verdict warns of a likely cause."""

    point_warning_mm: PositiveFloat = DEFAULT.point_warning_mm
    """U from which a warning is given, mm."""
    axis_angle_deg: NonNegativeFloat = round(degrees(DEFAULT.axis_angle_rad), 9)
    """Least angle between the motions' axes, degrees."""
    robot_translation_mm: PositiveFloat = DEFAULT.robot_translation_mm
    """Robot noise from which a warning is given, mm."""
    robot_rotation_deg: PositiveFloat = round(degrees(DEFAULT.robot_rotation_rad), 9)
    """Robot noise from which a warning is given, degrees."""
    possible_translation_mm: PositiveFloat = DEFAULT.possible_translation_mm
    """Robot noise that no robot has, mm."""
    possible_rotation_deg: PositiveFloat = round(degrees(DEFAULT.possible_rotation_rad), 9)
    """Robot noise that no robot has, degrees."""
    image_px: PositiveFloat = DEFAULT.image_px
    """Pixel noise from which a warning is given, px."""
    rejected_share: Annotated[float, Field(gt=0, le=1)] = DEFAULT.rejected_share
    """Share of rejected views that is refused, 0 to 1."""
    hold_out_ratio: PositiveFloat = DEFAULT.hold_out_ratio
    """Hold-out error over the predicted one that is refused. No unit."""
    possible_hold_out_mm: PositiveFloat = DEFAULT.possible_hold_out_mm
    """Hold-out error that no calibration in use may have, mm."""
    negligible_share: Annotated[float, Field(ge=0, le=1)] = DEFAULT.negligible_share
    """Share of the tolerance up to which an effect is information, 0 to 1."""
    warning_share: Annotated[float, Field(ge=0, le=1)] = DEFAULT.warning_share
    """Share of the tolerance up to which an effect is a warning, 0 to 1."""
    print_scale_share: Annotated[float, Field(gt=0, le=1)] = DEFAULT.print_scale_share
    """Deviation of the print's size that is a warning, 0 to 1."""
    lens_share: Annotated[float, Field(gt=0, le=1)] = DEFAULT.lens_share
    """Error of distances by the intrinsics that is a warning, 0 to 1."""
    points_size_share: Annotated[float, Field(gt=0, le=1)] = DEFAULT.points_size_share
    """Error of the measured target's size that is a warning, 0 to 1."""
    leave_out_probability: Annotated[float, Field(ge=0, le=1)] = DEFAULT.leave_out_probability
    """Probability below which left-out groups contradict the model, 0 to 1."""
    mount_sigma: PositiveFloat = DEFAULT.mount_sigma
    """Standard deviations by which the mount may differ from the last calibration. No unit."""


class LimitsInForceDocument(BoundsDocument):
    """All limits by which a verdict was given."""

    tolerance_mm: Tolerance
    """Largest U that is accepted, mm."""
    tolerance_stated: bool = False
    """Whether somebody stated the tolerance; else it is the default of 1 mm."""


class VerdictSettings(BoundsDocument):
    """The limits of the verdict."""

    def limits(self, tolerance_mm: float | None = None) -> VerdictLimits:
        """The limits in force with a stated tolerance, or with DEFAULT_TOLERANCE_MM."""
        return VerdictLimits(**renamed(self.model_dump(), "_deg", "_rad", radians)).with_tolerance(tolerance_mm)


class NamedPointDocument(Document):
    """A point that matters, in the base's or the camera's frame."""

    name: Annotated[str, Field(min_length=1, max_length=100)]
    """What the point is called."""
    position_mm: Vector
    """x, y, z in `frame`, mm."""
    frame: PointFrame = "base"
    """base or camera."""


class PointsDocument(Document):
    """Where the uncertainty counts: the corners of a box in the base, and named points; the working volume without."""

    box_mm: tuple[Vector, Vector] | None = None
    """Two opposite corners [[xmin, ymin, zmin], [xmax, ymax, zmax]] in the base, mm."""
    points: Annotated[tuple[NamedPointDocument, ...], Field(max_length=1000)] = ()
    """Named points that matter."""

    @model_validator(mode="after")
    def _check_box(self) -> "PointsDocument":
        if self.box_mm is not None and any(a > b for a, b in zip(*self.box_mm, strict=True)):
            raise ValueError("box_mm is [[xmin, ymin, zmin], [xmax, ymax, zmax]], no minimum above its maximum")
        return self

    def named_points(self) -> tuple[NamedPoint, ...]:
        corners = () if self.box_mm is None else box_points(np.array(self.box_mm))
        return (*corners, *(NamedPoint(**vars(point)) for point in self.points))


class PointsFile(PointsDocument):
    """The file of `solve --at`."""

    heading = "pointsjson"

    schema_version: Literal[1]
    """Version of the format."""


def renamed(values: Mapping[str, Any], suffix: str, other: str, convert: Callable[[float], float]) -> dict[str, Any]:
    """`values` with those whose name ends in `suffix` converted, and their names ending in `other`."""
    return {
        name.removesuffix(suffix) + other if name.endswith(suffix) else name: (
            convert(value) if name.endswith(suffix) else value
        )
        for name, value in values.items()
    }

"""The noise to expect and where to look from: of plan.json, and of a cell's settings."""

from math import radians
from typing import Annotated

import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from calibration.documents.pose import Vector
from calibration.documents.validation import Document
from calibration.kinematics.robot_accuracy import (
    PRIOR_FACTOR,
    PRIOR_NOISE,
    STATED_FACTOR,
    USUAL_BELIEF,
    NoiseBelief,
    RobotNoise,
)
from calibration.likelihood.predicted_uncertainty import ExpectedNoise
from calibration.planning.viewpoints import ViewpointLimits


class NoiseExpectedDocument(Document):
    """What is expected of the noise; of the robot's, good to a factor of two. Left out, the robot's is that of an
    industrial robot as usual, or what the cell has learnt of its own; the camera's is that of a good one."""

    image_px: PositiveFloat = 0.05
    """Noise of a detected point, px, one standard deviation per axis."""
    robot_rotation_deg: PositiveFloat | None = None
    """Noise of the robot's rotation, degrees, one standard deviation per axis."""
    robot_translation_mm: PositiveFloat | None = None
    """Noise of the robot's translation, mm, one standard deviation per axis."""

    @property
    def is_stated(self) -> bool:
        """Whether the robot's noise is stated."""
        return self.robot_rotation_deg is not None or self.robot_translation_mm is not None

    def belief(self) -> NoiseBelief:
        """In the robot's noise, as far as it is stated."""
        if not self.is_stated:
            return USUAL_BELIEF
        rotation_deg, translation_mm = self.robot_rotation_deg, self.robot_translation_mm
        median = RobotNoise(
            PRIOR_NOISE.translation_mm if translation_mm is None else translation_mm,
            PRIOR_NOISE.rotation_rad if rotation_deg is None else radians(rotation_deg),
        )
        stated = (PRIOR_FACTOR if rotation_deg is None else STATED_FACTOR,
                  PRIOR_FACTOR if translation_mm is None else STATED_FACTOR)  # fmt: skip
        return NoiseBelief(median, stated, "stated")

    def noise(self, belief: NoiseBelief | None = None) -> ExpectedNoise:
        """At the median of what is believed; by default of `self.belief()`."""
        median = (belief or self.belief()).median
        return ExpectedNoise(self.image_px, median.rotation_rad, median.translation_mm)


class LimitsDocument(Document):
    """Where the planner may look from; see `calibration.planning.viewpoints.ViewpointLimits`."""

    tilt_deg: Annotated[float, Field(gt=0, le=75)] = 45.0
    """Largest angle between the line of sight and the target's normal, degrees."""
    roll_deg: Annotated[float, Field(ge=0, le=180)] = 180.0
    """Largest turn about the line of sight, degrees."""
    distance_mm: tuple[PositiveFloat, PositiveFloat] = (450.0, 750.0)
    """Least and greatest distance of the camera from the target, mm."""
    box_mm: tuple[Vector, Vector] | None = None
    """Two opposite corners [[xmin, ymin, zmin], [xmax, ymax, zmax]] in the base, mm."""

    @model_validator(mode="after")
    def _check_order(self) -> "LimitsDocument":
        if self.distance_mm[0] > self.distance_mm[1]:
            raise ValueError("distance_mm is [nearest, furthest]")
        if self.box_mm is not None and any(low >= high for low, high in zip(*self.box_mm, strict=True)):
            raise ValueError("box_mm is [[xmin, ymin, zmin], [xmax, ymax, zmax]]")
        return self

    def limits(self) -> ViewpointLimits:
        box = None if self.box_mm is None else np.array(self.box_mm)
        return ViewpointLimits(radians(self.tilt_deg), radians(self.roll_deg), self.distance_mm, box)

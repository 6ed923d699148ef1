"""What an arm's errors depend on as documents have it: the load on the flange in kg and mm, the temperature in °C."""

from typing import Annotated

from pydantic import Field

from calibration.documents.pose import Vector
from calibration.documents.validation import Document
from calibration.kinematics.load import Load

ArmTemperature = Annotated[float, Field(ge=0, le=100)]
"""Of the arm's links, in °C."""


class LoadDocument(Document):
    """What the flange carries, camera and bracket: mass, and centre of gravity from the flange, in its frame."""

    mass_kg: Annotated[float, Field(ge=0.01, le=1000)]
    """Its mass, kg."""
    centre_mm: Vector = (0.0, 0.0, 0.0)
    """Its centre of mass in the frame of the flange, mm."""

    def load(self) -> Load:
        """As the solver takes it."""
        return Load(self.mass_kg, self.centre_mm)

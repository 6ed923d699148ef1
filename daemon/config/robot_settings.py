"""Tables below [robot]: settling, the vibration monitor, outputs, the load on the flange."""

from math import radians
from typing import Annotated

from pydantic import Field

from calibration.documents.arm_conditions import LoadDocument
from calibration.documents.pose import Vector
from calibration.documents.validation import Document


class SettlingSettings(Document):
    """The arm counts as at rest when two readings `gap_s` apart agree within these tolerances."""

    gap_s: Annotated[float, Field(ge=0, le=10)] = 0.1
    translation_mm: Annotated[float, Field(gt=0, le=1)] = 0.02
    rotation_deg: Annotated[float, Field(gt=0, le=1)] = 0.005
    limit_s: Annotated[float, Field(gt=0, le=120)] = 10.0

    @property
    def rotation_rad(self) -> float:
        return radians(self.rotation_deg)


class EgmSettings(Document):
    """The vibration monitor: where the controller sends EGM packets, and how much the flange may vibrate."""

    host: str = "0.0.0.0"  # noqa: S104 - the controller's network is not known here; `robot` names the sender
    port: Annotated[int, Field(ge=0, le=65535)] = 6510
    robot: str | None = None
    window_s: Annotated[float, Field(gt=0, le=5)] = 0.25
    translation_mm: Annotated[float, Field(gt=0, le=5)] = 0.05
    rotation_deg: Annotated[float, Field(gt=0, le=1)] = 0.01


class OutputSettings(Document):
    """Outputs of the controller around each frame, by the names that the robot program has for them.

    `light_s`: a lamp is switched on this long before the frame, and off after it; `trigger_s`: a signal is high for
    this long while the camera waits for its trigger. None leaves one out.
    """

    light_s: Annotated[float, Field(ge=0, le=10)] | None = None
    trigger_s: Annotated[float, Field(ge=0.01, le=1)] | None = None


class LoadSettings(LoadDocument):
    """The load on the flange, camera and bracket: mass, centre of gravity from the flange, moments of inertia."""

    inertia_kg_m2: Vector = (0.0, 0.0, 0.0)

"""touches.json: the points of a touch test, where the camera saw each and in which pose the tip touched it (mm)."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from calibration.documents.external_axis import ExternalAxes
from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.validation import Document
from calibration.kinematics.stance import Stance

Sigma = Annotated[float, Field(ge=0, le=100)]
Joints = Annotated[tuple[Annotated[float, Field(ge=-1e4, le=1e4)], ...], Field(min_length=1, max_length=12)]

STANCES = ("base_T_flange", "joints_deg", "external_axes"), ("seen_from", "seen_joints_deg", "seen_external_axes")
"""Fields of a pose, and those that say more of where the arm stood there."""


class TouchDocument(Document):
    """One point, by `id` or by `camera_mm`, and the pose of the flange in which the tip touched it.

    `miss_mm`: when the tip could not be brought to it and the rest was measured. `base_T_flange` may be left out over
    REST only, where it is read from the arm.
    """

    name: Annotated[str, Field(min_length=1, max_length=64)] | None = None
    """What the point is called."""
    id: Annotated[int, Field(ge=0, le=100_000)] | None = None
    """Of the target's point, where the camera looked at the target."""
    camera_mm: Vector | None = None
    """The point in the camera's frame, mm."""
    sigma_mm: Sigma = 0.0
    """Standard deviation of camera_mm per axis, mm."""
    seen_from: PoseDocument | None = None
    """base_T_flange when the camera saw the point; without it for a camera beside the robot."""
    seen_joints_deg: Joints | None = None
    """The arm's axes then, degrees."""
    seen_external_axes: ExternalAxes | None = None
    """The controller's axes beside the arm then, mm or degrees; a calibration with an external axis needs them."""
    base_T_flange: PoseDocument | None = None
    """The flange in the base (wobj0) when the tip touched the point."""
    joints_deg: Joints | None = None
    """The arm's axes when the tip touched the point, degrees."""
    external_axes: ExternalAxes | None = None
    """The controller's axes beside the arm then, mm or degrees; a calibration with an external axis needs them."""
    miss_mm: Vector = (0.0, 0.0, 0.0)
    """Where the point is less where the tip stands, along the base's axes, mm."""

    @model_validator(mode="after")
    def _check_point(self) -> "TouchDocument":
        if (self.id is None) == (self.camera_mm is None):
            raise ValueError("a point has 'id' or 'camera_mm', one of the two")
        if self.id is not None and (self.seen_from is not None or self.sigma_mm):
            raise ValueError("'seen_from' and 'sigma_mm' belong to 'camera_mm': leave them out beside 'id'")
        for pose, *beside in STANCES:
            given = [name for name in beside if getattr(self, name) is not None]
            if given and getattr(self, pose) is None:
                raise ValueError(f"'{given[0]}' belongs to '{pose}': give the pose, too")
        return self

    @property
    def touched(self) -> Stance | None:
        """Where the arm stood when the tip touched the point."""
        pose = self.base_T_flange
        return None if pose is None else Stance.of_degrees(pose.transform(), self.joints_deg, self.external_axes)

    @property
    def looked(self) -> Stance | None:
        """Where the arm stood when the camera saw it, where that is given."""
        pose, axes = self.seen_from, self.seen_external_axes
        return None if pose is None else Stance.of_degrees(pose.transform(), self.seen_joints_deg, axes)

    @property
    def label(self) -> str:
        """The name, else the id of the point."""
        return self.name or ("" if self.id is None else f"point {self.id}")


class TouchesDocument(Document):
    """The whole of touches.json. `placing_sigma_mm`: by default what the tip's calibration shows."""

    heading = "touchesjson"

    schema_version: Literal[1] = 1
    """Version of the format."""
    placing_sigma_mm: Sigma | None = None
    """Of bringing the tip to a point once, per axis, without the robot's error, mm."""
    touches: Annotated[tuple[TouchDocument, ...], Field(min_length=1, max_length=100)]
    """The points, each with the pose in which the tip touched it."""

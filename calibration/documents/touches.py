"""touches.json: the points of a touch test, where the camera saw each and in which pose the tip touched it (mm)."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.validation import Document

Sigma = Annotated[float, Field(ge=0, le=100)]


class TouchDocument(Document):
    """One point and the pose of the flange in which the tip touched it.

    `id`: of the target's point, where the camera looked at the target; or `camera_mm`: in the camera's frame, seen from
    the flange's pose `seen_from` (left out for a camera beside the robot), with `sigma_mm` per axis.
    `miss_mm`: where the point is less where the tip stands, along the base's axes, when the tip could not be brought to
    it and the rest was measured. `base_T_flange` may be left out over REST only, where it is read from the arm.
    """

    name: Annotated[str, Field(min_length=1, max_length=64)] | None = None
    id: Annotated[int, Field(ge=0, le=100_000)] | None = None
    camera_mm: Vector | None = None
    sigma_mm: Sigma = 0.0
    seen_from: PoseDocument | None = None
    base_T_flange: PoseDocument | None = None
    miss_mm: Vector = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _check_point(self) -> "TouchDocument":
        if (self.id is None) == (self.camera_mm is None):
            raise ValueError("a point has 'id' or 'camera_mm', one of the two")
        if self.id is not None and (self.seen_from is not None or self.sigma_mm):
            raise ValueError("'seen_from' and 'sigma_mm' belong to 'camera_mm': leave them out beside 'id'")
        return self

    @property
    def label(self) -> str:
        """The name, else the id of the point."""
        return self.name or ("" if self.id is None else f"point {self.id}")


class TouchesDocument(Document):
    """The whole of touches.json. `placing_sigma_mm`: of bringing the tip to a point, per axis, without the robot's
    error; by default what the tip's calibration shows."""

    heading = "touchesjson"

    schema_version: Literal[1] = 1
    placing_sigma_mm: Sigma | None = None
    touches: Annotated[tuple[TouchDocument, ...], Field(min_length=1, max_length=100)]

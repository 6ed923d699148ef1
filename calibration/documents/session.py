"""session.json: robot poses and images or detections of a calibration run, in the folder with its images."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from calibration.camera import CameraModel
from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.target import TargetDocument
from calibration.documents.validation import Document
from calibration.problem import Setup

Pixels = Annotated[int, Field(ge=16, le=65536)]


class CameraDocument(Document):
    """Pinhole and Brown distortion k1, k2, p1, p2, k3."""

    matrix: tuple[Vector, Vector, Vector]
    distortion: tuple[float, float, float, float, float]
    image_size: tuple[Pixels, Pixels]

    def camera(self) -> CameraModel:
        return CameraModel(np.array(self.matrix), np.array(self.distortion), self.image_size)

    @classmethod
    def of(cls, camera: CameraModel) -> "CameraDocument":
        return cls.model_validate(
            {
                "matrix": camera.matrix.tolist(),
                "distortion": camera.distortion.tolist(),
                "image_size": list(camera.image_size),
            }
        )


class ViewDocument(Document):
    """One station: an image, or the detection already made."""

    base_T_flange: PoseDocument
    image: str | None = None
    corners_px: list[tuple[int, float, float]] | None = None

    @model_validator(mode="after")
    def _image_or_corners(self) -> "ViewDocument":
        if (self.image is None) == (self.corners_px is None):
            raise ValueError("a view has either 'image' or 'corners_px'")
        return self


class SessionDocument(Document):
    """The whole of session.json."""

    schema_version: Literal[1]
    source: str = ""
    setup: Setup
    target: TargetDocument
    camera: CameraDocument | None
    image_size: tuple[Pixels, Pixels] | None = None
    views: list[ViewDocument]

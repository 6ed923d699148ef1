"""tip.json: the tip of a tool in the flange's frame, as `handeyed tip` writes it and the touch test reads it (mm)."""

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field

from calibration.documents.pose import Vector
from calibration.documents.validation import Document

MAX_VARIANCE_MM2 = 1e12

Matrix = tuple[Vector, Vector, Vector]


def _covariance(matrix: Matrix) -> Matrix:
    values = np.array(matrix)
    if not np.all(np.abs(values) <= MAX_VARIANCE_MM2):
        raise ValueError(f"a variance is at most {MAX_VARIANCE_MM2:g} mm²")
    symmetric = np.allclose(values, values.T, rtol=1e-6, atol=1e-12)
    if not (symmetric and np.linalg.eigvalsh(values)[0] >= -1e-9 * abs(float(np.trace(values)))):
        raise ValueError("a covariance is symmetric and has no negative variance in any direction")
    return matrix


Covariance = Annotated[Matrix, AfterValidator(_covariance)]


class TipPoseDocument(Document):
    """One pose."""

    name: str
    """Name or number of the pose."""
    used: bool
    """false for an outlier, which was left out."""
    base_residual_mm: Vector
    """Where the pose puts the tip less the fixed point, in the base, mm."""


class TipDocument(Document):
    """The whole of tip.json; by hand `flange_tip_mm`, `covariance` and `placing_sigma_mm` are enough."""

    heading = "tipjson"

    schema_version: Literal[1] = 1
    """Version of the format."""
    flange_tip_mm: Vector
    """The tip in the flange's frame, mm."""
    covariance: Covariance
    """3 x 3 of flange_tip_mm, mm²."""
    placing_sigma_mm: Annotated[float, Field(ge=0, le=100)]
    """Of bringing the tip to a point once, per axis, with the robot's error, mm."""
    expanded_mm: float | None = None
    """U (k = 2) of the tip over three axes, mm."""
    base_point_mm: Vector | None = None
    """The fixed point in the base, mm."""
    poses: tuple[TipPoseDocument, ...] = ()
    """The poses that it was calibrated from."""

    @property
    def outliers(self) -> tuple[str, ...]:
        """Names of the poses that were left out."""
        return tuple(pose.name for pose in self.poses if not pose.used)

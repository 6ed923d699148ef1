"""tip.json: the tip of a tool in the flange's frame, as `handeyed tip` writes it and the touch test reads it (mm)."""

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field

from calibration.documents.pose import Vector
from calibration.documents.validation import Document
from calibration.transforms import Array

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
    """One pose: where it puts the tip less the fixed point, in the base; `used` false for an outlier."""

    name: str
    used: bool
    base_residual_mm: Vector


class TipDocument(Document):
    """The whole of tip.json; by hand `flange_tip_mm`, `covariance` and `placing_sigma_mm` are enough.

    `covariance`: of flange_tip_mm in the flange's frame, mm². `expanded_mm`: U (k = 2) over three axes.
    `placing_sigma_mm`: of bringing the tip to a point once, per axis, with the robot's error.
    """

    heading = "tipjson"

    schema_version: Literal[1] = 1
    flange_tip_mm: Vector
    covariance: Covariance
    placing_sigma_mm: Annotated[float, Field(ge=0, le=100)]
    expanded_mm: float | None = None
    base_point_mm: Vector | None = None
    poses: tuple[TipPoseDocument, ...] = ()

    def covariance_matrix(self) -> Array:
        """(3, 3) in mm²."""
        return np.array(self.covariance)

    @property
    def outliers(self) -> tuple[str, ...]:
        """Names of the poses that were left out."""
        return tuple(pose.name for pose in self.poses if not pose.used)

"""The document of a pose: {"translation_mm": [x, y, z], "quaternion_wxyz": [w, x, y, z]}."""

import math
from collections.abc import Sequence
from typing import Annotated, Self

from pydantic import AfterValidator

from calibration.documents.validation import Document
from calibration.transforms import QUATERNION_NORM_TOLERANCE, Array, quaternion_from_rotation, transform_from_quaternion

Vector = tuple[float, float, float]
MIN_DIRECTION, MAX_DIRECTION = 1e-3, 1e6
"""Length of a vector that gives a direction; the square of a much longer one is infinite."""


def _unit(quaternion: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    norm = math.hypot(*quaternion)
    if not abs(norm - 1.0) <= QUATERNION_NORM_TOLERANCE:
        raise ValueError(f"norm {norm:.4g} is not 1: a quaternion is w, x, y, z with w first and norm 1")
    return quaternion


Quaternion = Annotated[tuple[float, float, float, float], AfterValidator(_unit)]


def round_vector(values: Sequence[float] | Array) -> Vector:
    """x, y, z with six digits after the point."""
    x, y, z = (round(float(value), 6) for value in values)
    return x, y, z


def is_direction(vector: Vector) -> bool:
    """Whether a direction can be taken from it, whatever its length."""
    return MIN_DIRECTION < math.hypot(*vector) < MAX_DIRECTION


class PoseDocument(Document):
    """A rigid transform; its field's name (`a_T_b`) says between which frames."""

    translation_mm: Vector
    """Translation x, y, z in mm."""
    quaternion_wxyz: Quaternion
    """Unit quaternion w, x, y, z."""

    def transform(self) -> Array:
        """(4, 4)"""
        return transform_from_quaternion(self.translation_mm, self.quaternion_wxyz)

    @classmethod
    def of(cls, a_T_b: Array) -> Self:
        """The document of a (4, 4) transform."""
        return cls.model_validate(
            {
                "translation_mm": a_T_b[:3, 3].tolist(),
                "quaternion_wxyz": quaternion_from_rotation(a_T_b[:3, :3]).tolist(),
            }
        )

"""A track under the arm or a turntable under the part, whose motion the controller leaves out of the arm's poses.

All results are in one frame: the base with the axis at its `zero`. A pose reported at reading e is moved into it by

    track        translation by direction * (e - zero)
    turntable    rotation by -(e - zero) about the axis: the part is seen as it lay at zero

so that solvers and registration see an arm on one base and a part that stands. An axis that the controller knows
(integrated, coordinated) is in its poses already and needs nothing of this.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import radians
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from calibration.transforms import Array, inverse, rotation_from_vector, transform, vector_from_transform

AxisKind = Literal["track", "turntable"]

STEPS = np.array([1e-5, 1e-5, 1e-2, 1e-2])
"""rad, mm: of the differences by which the poses' derivatives are taken."""


def reading_of(kind: AxisKind, value: float) -> float:
    """A reading, mm or rad, of the controller's value, mm or degrees."""
    return value if kind == "track" else radians(value)


@dataclass(frozen=True, eq=False)
class ExternalAxis:
    """An axis beside the arm, in the frame of its base.

    kind : a "track" moves the base along `direction`, a "turntable" turns the part about it, right-handed.
    number : which of the controller's external axes, 1 to 6.
    direction : (3,) of length 1.
    point_mm : (3,) on a turntable's axis; of no meaning for a track.
    zero : reading, mm or rad, at which base and part stand where results have them.
    """

    kind: AxisKind
    number: int
    direction: Array
    point_mm: Array
    zero: float = 0.0

    @property
    def unknowns(self) -> int:
        """Two of the direction, of a turntable two more of the point, across the axis."""
        return 2 if self.kind == "track" else 4

    @property
    def tangents(self) -> Array:
        """Two unit vectors (3, 2) across the direction."""
        return np.asarray(np.linalg.svd(self.direction[None])[2][1:].T)

    def reading(self, external_axes: Sequence[float | None] | None) -> float | None:
        """This axis's reading, mm or rad, of the controller's axes in mm or degrees; None where they do not hold it."""
        if external_axes is None or len(external_axes) < self.number:
            return None
        value = external_axes[self.number - 1]
        return None if value is None else reading_of(self.kind, value)

    def motion(self, readings: ArrayLike) -> Array:
        """(..., 4, 4) from base coordinates measured at the readings (...), mm or rad, to those at zero."""
        off = np.asarray(readings, float)[..., None] - self.zero
        if self.kind == "track":
            return transform(np.broadcast_to(np.eye(3), (*off.shape[:-1], 3, 3)), off * self.direction)
        turn = rotation_from_vector(-off * self.direction)
        return transform(turn, self.point_mm - turn @ self.point_mm)

    def at_zero(self, base_T_flange: Array, readings: ArrayLike) -> Array:
        """Poses (..., 4, 4) reported at the readings (...), as if the axis stood at zero."""
        moved: Array = self.motion(readings) @ base_T_flange
        return moved

    def apply_step(self, step: Array) -> "ExternalAxis":
        """The axis changed by its unknowns (2,) or (4,): rad along the tangents, then mm along them."""
        across = self.tangents
        direction = self.direction + across @ step[:2]
        point_mm = self.point_mm if self.kind == "track" else self.point_mm + across @ step[2:]
        return replace(self, direction=direction / np.linalg.norm(direction), point_mm=point_mm)

    def jacobian(self, base_T_flange: Array, readings: Array) -> Array:
        """Derivative (n, 6, k) by the unknowns of the corrections that take the poses (n, 4, 4), at zero, along.

        A correction is [rotation vector, translation] in the flange's frame.
        """
        back = inverse(self.motion(readings)) @ base_T_flange
        here, columns = inverse(base_T_flange), []
        for place in range(self.unknowns):
            step = np.zeros(self.unknowns)
            step[place] = STEPS[place]
            ahead, behind = (self.apply_step(s).motion(readings) @ back for s in (step, -step))
            columns.append((vector_from_transform(here @ ahead) - vector_from_transform(here @ behind)) / 2)
        derivative: Array = np.stack(columns, axis=-1) / STEPS[: self.unknowns]
        return derivative

    def by_vectors(self) -> Array:
        """Derivative (6, k) of [direction, point_mm] by the unknowns."""
        by = np.zeros((6, self.unknowns))
        by[:3, :2] = self.tangents
        if self.kind == "turntable":
            by[3:, 2:] = self.tangents
        return by

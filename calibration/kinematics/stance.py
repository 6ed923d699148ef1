"""Where an arm stands by its controller, and what a cell knows that corrects it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from calibration.transforms import Array


@dataclass(frozen=True, eq=False)
class Stance:
    """A pose base_T_flange (4, 4) as the controller reports it, and what else it reported there, where that is known.

    joints_rad : (n,) the arm's axes.
    external_axes : the controller's axes beside it from the first, mm or degrees; None for one that it does not have.
    confdata : ABB's cf1, cf4, cf6, cfx.
    """

    base_T_flange: Array
    joints_rad: Array | None = None
    external_axes: tuple[float | None, ...] | None = None
    confdata: tuple[int, int, int, int] | None = None

    @classmethod
    def of_degrees(
        cls,
        base_T_flange: Array,
        joints_deg: Sequence[float] | None,
        external_axes: tuple[float | None, ...] | None,
        confdata: tuple[int, int, int, int] | None = None,
    ) -> "Stance":
        """As documents have it."""
        joints_rad = None if joints_deg is None else np.radians(joints_deg)
        return cls(base_T_flange, joints_rad, external_axes, confdata)


class Correction(Protocol):
    """What moves the flange beside the reported poses: the arm as built, a track, a turntable."""

    def place(self, base_T_flange: Array, stances: Sequence[Stance]) -> Array:
        """The poses (n, 4, 4) of these stances, corrected. Raises CalibrationError."""
        ...

"""What a hand-eye solver is given.

Two set-ups, one mathematics. The camera is fixed in its *mount*, the target in its *anchor*:

    eye-in-hand    mount = flange    anchor = base      anchor_T_mount = base_T_flange
    eye-to-hand    mount = base      anchor = flange    anchor_T_mount = flange_T_base

    anchor_T_target = anchor_T_mount @ mount_T_camera @ camera_T_target        for every view

so a solver sees `anchor_T_mount` only, and X is `mount_T_camera`. (The seed's X is its inverse, `camera_T_flange`.)
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.targets import Target
from calibration.transforms import Array, inverse

Setup = Literal["eye-in-hand", "eye-to-hand"]


@dataclass(frozen=True, eq=False)
class Detection:
    """Target points seen in one image: `ids` (n,) index into `target.points_mm`, `corners_px` (n, 2)."""

    ids: NDArray[np.intp]
    corners_px: Array


@dataclass(frozen=True, eq=False)
class View:
    """One station: the robot's pose and what the camera saw there.

    `detection` is None when the target was not found; `missing` then says why (a code and a sentence).
    """

    index: int
    base_T_flange: Array
    detection: Detection | None
    image: str | None = None
    missing: tuple[str, str] | None = None


@dataclass(frozen=True, eq=False)
class Problem:
    """A calibration session. `camera` None: the intrinsics are estimated with the rest, from `image_size`."""

    setup: Setup
    target: Target
    camera: CameraModel | None
    image_size: tuple[int, int]
    views: tuple[View, ...]

    def anchor_T_mount(self, view: View) -> Array:
        """(4, 4), see the module's table."""
        return view.base_T_flange if self.setup == "eye-in-hand" else inverse(view.base_T_flange)

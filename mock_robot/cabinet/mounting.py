"""Where the arm stands: its base in the world frame, on a pedestal, upside down, or on a track."""

from dataclasses import dataclass, field

import numpy as np

from calibration.kinematics.external_axis import ExternalAxis, reading_of
from calibration.transforms import Array, inverse, transform


@dataclass
class Mounting:
    """Base frame (4, 4) in the world, mm, as MOC's base_frame_pos and _orient.

    `track`: direction in the world of a track that the first external axis (mm) moves the base along; None without
    one. `integrated`: the controller knows it (base_frame_coordinated) and reports poses that include it; otherwise
    only the arm moves with it, and the reported pose does not. `beside`: a track or turntable as built, that the
    controller leaves out of its poses.
    """

    world_T_base: Array = field(default_factory=lambda: np.eye(4))
    track: tuple[float, float, float] | None = None
    integrated: bool = True
    beside: ExternalAxis | None = None

    def true_world_T_base(self, external_axes: tuple[float, ...]) -> Array:
        """Where the base stands."""
        return self._moved(external_axes)

    def reported_world_T_base(self, external_axes: tuple[float, ...]) -> Array:
        """Where the controller believes it to stand."""
        return self._moved(external_axes) if self.integrated else self.world_T_base

    def start_T_base(self, external_axes: tuple[float, ...]) -> Array:
        """The base now, where the track is at 0 and as a turntable sees it: what camera and target see."""
        start_T_base = inverse(self.world_T_base) @ self.true_world_T_base(external_axes)
        if self.beside is None:
            return start_T_base
        reading = reading_of(self.beside.kind, external_axes[self.beside.number - 1])
        moved: Array = self.beside.motion(reading) @ start_T_base
        return moved

    def _moved(self, external_axes: tuple[float, ...]) -> Array:
        if self.track is None or external_axes[0] >= 8.9e9:
            return self.world_T_base
        return transform(np.eye(3), external_axes[0] * np.array(self.track)) @ self.world_T_base


UPSIDE_DOWN = np.diag([1.0, -1.0, -1.0, 1.0])
"""A base turned by 180 deg about its x axis: an arm that hangs from a gantry."""

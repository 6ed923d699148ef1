"""The coordinate along the only axis of rotation that closes what such motions leave open (docs/decisions/0043).

A shift of camera and target together along the axis changes no view, whatever the turns: the likelihood is flat in that
direction, and in no other. So the coordinate is held at its given value by a further observation, nearly exact, and the
variance of the value is added along the direction afterwards. That is the posterior of a Gaussian prior on it.
"""

from dataclasses import dataclass

import numpy as np

from calibration.problem import AxisOffset
from calibration.transforms import Array

WEIGHT = 100.0
"""px² / mm² of the further observation: with 0.1 px noise it holds the coordinate within 0.01 mm of its value."""


@dataclass(frozen=True, eq=False)
class GivenCoordinate:
    """An offset along an axis, given as one direction (3,) in the mount's and in the anchor's frame."""

    offset: AxisOffset
    axis_mount: Array
    axis_anchor: Array

    @classmethod
    def along(cls, offset: AxisOffset, axis_mount: Array, anchor_T_mount: Array) -> "GivenCoordinate":
        """Of the axis (3,) of turns between poses (n, 4, 4), on which all of them nearly agree in the anchor."""
        in_anchor = (anchor_T_mount[:, :3, :3] @ axis_mount).mean(axis=0)
        return cls(offset, axis_mount, in_anchor / np.linalg.norm(in_anchor))

    def squares(self, mount_T_camera: Array, anchor_T_target: Array, unknowns: int) -> Array:
        """[A, y]' [A, y] (p + 1, p + 1) of the coordinate's difference from its value, for p unknowns."""
        row = np.zeros(unknowns + 1)
        axis, place = self._of(mount_T_camera, anchor_T_target)
        first = 3 if self.offset.of == "camera" else 9
        row[first : first + 3] = place[:3, :3].T @ axis
        row[-1] = axis @ place[:3, 3] - self.offset.coordinate_mm
        return WEIGHT * np.outer(row, row)

    def covariance(self, mount_T_camera: Array, anchor_T_target: Array) -> Array:
        """What the value's uncertainty adds to the covariance (12, 12) of X and the target's pose."""
        together = np.zeros(12)
        together[3:6] = mount_T_camera[:3, :3].T @ self.axis_mount
        together[9:] = anchor_T_target[:3, :3].T @ self.axis_anchor
        return self.offset.sigma_mm**2 * np.outer(together, together)

    def _of(self, mount_T_camera: Array, anchor_T_target: Array) -> tuple[Array, Array]:
        """The axis, positive at its largest component, and the pose (4, 4) whose origin the coordinate is of."""
        camera = self.offset.of == "camera"
        axis, place = (self.axis_mount, mount_T_camera) if camera else (self.axis_anchor, anchor_T_target)
        return axis * np.sign(axis[np.argmax(np.abs(axis))]), place

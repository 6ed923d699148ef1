"""Paths between two sets of joints, parametrised from 0 to 1: joint interpolation (MoveJ), straight line (MoveL).

A path can be followed up to its `reachable_fraction` (1: all of it).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calibration.kinematics.arm import UnreachablePoseError
from calibration.kinematics.seven_axes import AnyArm
from calibration.transforms import Array, rotation_from_vector, transform, vector_from_rotation

LINE_STEPS = 24
"""Number of points at which a line is checked before the move starts."""
WRIST_JUMP_RAD = np.radians(60.0)
"""A joint that moves further than this between two checked points passes a singularity."""


@dataclass(frozen=True, eq=False)
class JointPath:
    """All axes interpolated linearly from `start` to `end`."""

    start: Array
    end: Array
    reachable_fraction: float = 1.0

    def joints_at(self, along: float) -> Array:
        """Joints at the fraction `along` of the path."""
        return self.start + along * (self.end - self.start)


@dataclass(frozen=True, eq=False)
class LinePath:
    """The flange moves on a straight line and rotates about one fixed axis; blocked where the arm cannot follow."""

    arm: AnyArm
    start: Array
    end: Array

    def base_T_flange_at(self, along: float) -> Array:
        """Flange pose (4, 4) at the fraction `along` of the path."""
        first, last = self._ends
        turn = vector_from_rotation(first[:3, :3].T @ last[:3, :3])
        position = (1 - along) * first[:3, 3] + along * last[:3, 3]
        return transform(first[:3, :3] @ rotation_from_vector(along * turn), position)

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        return self.arm.forward(self.start), self.arm.forward(self.end)

    @cached_property
    def _reachable_joints(self) -> list[Array]:
        """Joints at each checked point, up to the first that cannot be reached."""
        followed = [self.start]
        for along in np.linspace(0.0, 1.0, LINE_STEPS + 1)[1:]:
            try:
                joints = self.arm.nearest(self.base_T_flange_at(float(along)), followed[-1])
            except UnreachablePoseError:
                break
            if np.abs(joints - followed[-1]).max() > WRIST_JUMP_RAD:
                break
            followed.append(joints)
        return followed

    @property
    def reachable_fraction(self) -> float:
        """Fraction of the path that can be followed; below 1 also when it would end in another configuration."""
        whole = len(self._reachable_joints) == LINE_STEPS + 1
        if whole and np.abs(self._reachable_joints[-1] - self.end).max() > WRIST_JUMP_RAD:
            return (LINE_STEPS - 1) / LINE_STEPS
        return (len(self._reachable_joints) - 1) / LINE_STEPS

    def joints_at(self, along: float) -> Array:
        """Joints at the fraction `along` of the path; raises PoseRefused beyond `reachable_fraction`."""
        if along >= 1.0:
            return self.end
        before = self._reachable_joints[min(int(along * LINE_STEPS), len(self._reachable_joints) - 1)]
        return self.arm.nearest(self.base_T_flange_at(along), before)


Path = JointPath | LinePath

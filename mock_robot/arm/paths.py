"""Paths between two postures: joint interpolation (MoveJ) and a straight line (MoveL), from 0 to 1."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from calibration.kinematics.arm import Arm, UnreachablePoseError
from calibration.transforms import Array, rotation_from_vector, transform, vector_from_rotation

LINE_STEPS = 24
"""Points at which a line is checked before it begins."""
WRIST_JUMP_RAD = np.radians(60.0)
"""A joint that turns further than this between two points of a line is passing a singularity."""


class Path(Protocol):
    """Joints (6,) along the way; `blocked_at` is how far it can be followed (1 when to its end)."""

    @property
    def blocked_at(self) -> float: ...

    def joints_at(self, along: float) -> Array: ...


@dataclass(frozen=True, eq=False)
class JointPath:
    """All axes in step from `start` to `end`."""

    start: Array
    end: Array
    blocked_at: float = 1.0

    def joints_at(self, along: float) -> Array:
        """Joints after the part `along` of the way."""
        return self.start + along * (self.end - self.start)


@dataclass(frozen=True, eq=False)
class LinePath:
    """The flange on a straight line, turning about one axis; blocked where the arm cannot follow."""

    arm: Arm
    start: Array
    end: Array

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        return self.arm.forward(self.start), self.arm.forward(self.end)

    def base_T_flange_at(self, along: float) -> Array:
        """The flange after the part `along` of the way."""
        first, last = self._ends
        turn = vector_from_rotation(first[:3, :3].T @ last[:3, :3])
        rotation = first[:3, :3] @ rotation_from_vector(along * turn)
        return transform(rotation, (1 - along) * first[:3, 3] + along * last[:3, 3])

    @cached_property
    def _followed(self) -> list[Array]:
        """Joints at each checked point, as far as they go."""
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
    def blocked_at(self) -> float:
        """The part of the way that can be followed; less than 1, too, when it ends in another posture."""
        whole = len(self._followed) == LINE_STEPS + 1
        if whole and np.abs(self._followed[-1] - self.end).max() > WRIST_JUMP_RAD:
            return (LINE_STEPS - 1) / LINE_STEPS
        return (len(self._followed) - 1) / LINE_STEPS

    def joints_at(self, along: float) -> Array:
        """Joints after the part `along` of the way; raises PoseRefused beyond `blocked_at`."""
        if along >= 1.0:
            return self.end
        before = self._followed[min(int(along * LINE_STEPS), len(self._followed) - 1)]
        return self.arm.nearest(self.base_T_flange_at(along), before)

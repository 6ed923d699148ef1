"""The flange's pose at any time between the poses that the robot reported along its path."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibration.transforms import Array, rotation_from_vector, transform, vector_from_rotation
from registration.errors import MotionError, PathError, PathGap
from registration.points.rigid_motion import MAX_TRANSLATION_MM, RIGID_TOLERANCE, RigidMotion

MAX_GAP_S = 0.1
"""Poses further apart are not interpolated: braking at 10 m/s² deviates by 12 mm from a straight line in 0.1 s."""

STANDING_MM = 0.02
"""Least motion of an arm in a sweep, in the elements of its pose."""


@dataclass(frozen=True, eq=False)
class RobotPath:
    """`base_T_flange` (n, 4, 4) in mm at `times_s` (n,) of the robot's clock, n >= 2, strictly increasing."""

    times_s: Array
    base_T_flange: Array

    @classmethod
    def of(cls, times_s: ArrayLike, base_T_flange: ArrayLike) -> "RobotPath":
        """Checked copies. Raises PathError."""
        times, poses = np.array(times_s, float), np.array(base_T_flange, float)
        fix = "give one pose with its time in s for each sample of the robot, in the order in which they were taken"
        if times.ndim != 1 or poses.shape != (len(times), 4, 4):
            raise PathError(f"times {times.shape} and poses {poses.shape} do not belong together", fix)
        if len(times) < 2:
            raise PathError(f"{len(times)} poses are no path", "record two poses or more along the sweep")
        if not np.isfinite(times).all():
            raise PathError(f"the time of pose {int(np.argmin(np.isfinite(times)))} is not finite", fix)
        backward = np.flatnonzero(np.diff(times) <= 0)
        if len(backward):
            raise PathError(f"pose {int(backward[0]) + 1} is not later than the one before it", fix)
        _require_rigid(poses)
        return cls(times, poses)

    @property
    def stands(self) -> bool:
        """Whether the arm stood: no element of its pose changes by STANDING_MM."""
        return bool(np.abs(self.base_T_flange - self.base_T_flange[0]).max() < STANDING_MM)

    def at(self, times_s: ArrayLike, max_gap_s: float = MAX_GAP_S, max_beyond_s: float = 0.0) -> Array:
        """base_T_flange (..., 4, 4) at times (...) of the robot's clock: translation linear, rotation by SLERP.

        Up to `max_beyond_s` before the first and after the last pose the outermost motion goes on. Raises PathGap
        where that is exceeded, or where the poses around a time are more than `max_gap_s` apart.
        """
        times = np.asarray(times_s, float)
        before = np.clip(np.searchsorted(self.times_s, times, side="right") - 1, 0, len(self.times_s) - 2)
        self._require_covered(times, before, max_gap_s, max_beyond_s)
        fraction = (times - self.times_s[before]) / np.diff(self.times_s)[before]
        turns, shifts = self._segments
        rotation = self.base_T_flange[before, :3, :3] @ rotation_from_vector(turns[before] * fraction[..., None])
        return transform(rotation, self.base_T_flange[before, :3, 3] + shifts[before] * fraction[..., None])

    @cached_property
    def _segments(self) -> tuple[Array, Array]:
        """Rotation vectors (n - 1, 3) in the flange's frame and shifts (n - 1, 3) in base from pose to pose."""
        rotations, places = self.base_T_flange[:, :3, :3], self.base_T_flange[:, :3, 3]
        return vector_from_rotation(np.swapaxes(rotations[:-1], -1, -2) @ rotations[1:]), np.diff(places, axis=0)

    def _require_covered(self, times: Array, before: NDArray[np.intp], max_gap_s: float, max_beyond_s: float) -> None:
        beyond = np.maximum(self.times_s[0] - times, times - self.times_s[-1])
        gaps = np.diff(self.times_s)[before]
        outside, apart = ~(beyond <= max_beyond_s), (gaps > max_gap_s) & (beyond < 0)
        for wrong, by_s, most_s in ((outside, beyond, max_beyond_s), (apart, gaps, max_gap_s)):
            if wrong.any():
                worst = np.flatnonzero(wrong.ravel())[0]
                at_s, off_s = float(times.ravel()[worst]), float(by_s.ravel()[worst])
                raise PathGap(at_s, off_s, most_s, outside=wrong is outside)


def _require_rigid(poses: Array) -> None:
    """All at once; only a pose that looks wrong is examined by itself, for its message. Raises PathError."""
    rotations = poses[:, :3, :3]
    with np.errstate(invalid="ignore", over="ignore"):
        squares = np.swapaxes(rotations, -1, -2) @ rotations
        rigid = np.abs(squares - np.eye(3)).max(axis=(1, 2)) <= RIGID_TOLERANCE
        rigid &= (np.linalg.det(rotations) > 0) & (np.abs(poses[:, :3, 3]).max(axis=1) <= MAX_TRANSLATION_MM)
        rigid &= (poses[:, 3] == [0, 0, 0, 1]).all(axis=1)
    for index in np.flatnonzero(~rigid):
        try:
            RigidMotion.of(poses[index], "mm")
        except MotionError as error:
            raise PathError(f"pose {index}: {error.what}", error.fix) from error

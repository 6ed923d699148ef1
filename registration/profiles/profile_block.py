"""Profiles of a laser line: points (x, z) of the sensor's plane with the time at which each profile was taken.

Profiler frame: x along the laser line, z along the light, away from the sensor or towards it as its maker has it, y
perpendicular to both (right-handed); the laser plane is y = 0.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibration.transforms import Array
from registration.errors import ProfileError

MAX_POINTS = 1 << 16
"""Points of one profile: sensors have 640 to 4,096."""


@dataclass(frozen=True, eq=False)
class ProfileBlock:
    """`x_mm`, `z_mm` (n, m) of n profiles in the laser plane, NaN where there is no point; `times_s` (n,) of the
    sensor's clock, not decreasing.
    """

    times_s: Array
    x_mm: NDArray[Any]
    z_mm: NDArray[Any]

    @classmethod
    def of(cls, times_s: ArrayLike, x_mm: ArrayLike, z_mm: ArrayLike) -> "ProfileBlock":
        """Checked arrays; `x_mm` may be (m,), the same for every profile. Raises ProfileError."""
        times, z = np.asarray(times_s, float), np.asarray(z_mm)
        fix = "give times (n,) in s, z (n, m) in mm, and x (n, m) or (m,) in mm"
        if z.ndim != 2 or times.shape != z.shape[:1]:
            raise ProfileError(f"times {times.shape} and z {z.shape} do not belong together", fix)
        if z.shape[1] > MAX_POINTS:
            raise ProfileError(f"{z.shape[1]} points a profile are more than {MAX_POINTS}", fix)
        x = np.asarray(x_mm)
        if x.shape not in (z.shape, z.shape[1:]):
            raise ProfileError(f"x {x.shape} and z {z.shape} do not belong together", fix)
        if x.dtype.kind not in "iuf" or z.dtype.kind not in "iuf":
            raise ProfileError("x or z are not numbers", fix)
        if not np.isfinite(times).all():
            raise ProfileError(f"the time of profile {int(np.argmin(np.isfinite(times)))} is not finite", fix)
        backward = np.flatnonzero(np.diff(times) < 0)
        if len(backward):
            what = f"profile {int(backward[0]) + 1} was taken before the one that precedes it"
            raise ProfileError(what, "give the profiles in the order of their times")
        return cls(times, np.broadcast_to(x, z.shape), z)

    def __len__(self) -> int:
        return len(self.times_s)

    def __getitem__(self, rows: slice) -> "ProfileBlock":
        return ProfileBlock(self.times_s[rows], self.x_mm[rows], self.z_mm[rows])

    def points_in(self, base_T_profiler: Array) -> NDArray[np.float32]:
        """The finite points (k, 3) in base, mm; `base_T_profiler` (n, 4, 4): the pose at each profile.

        Float32 arithmetic loses less than float32 storage within 20 m. Columns are computed one by one: NumPy handles
        rows of three many times more slowly.
        """
        with np.errstate(invalid="ignore", over="ignore"):
            x, z = (np.asarray(values, np.float32) for values in (self.x_mm, self.z_mm))
            rows = base_T_profiler[:, :3].astype(np.float32)
            planes, along_z = np.empty((3, *z.shape), np.float32), np.empty(z.shape, np.float32)
            for axis in range(3):
                np.multiply(x, rows[:, axis, 0, None], out=planes[axis])
                planes[axis] += np.multiply(z, rows[:, axis, 2, None], out=along_z)
                planes[axis] += rows[:, axis, 3, None]
            whole = bool(np.isfinite(planes.sum(dtype=np.float32)))
        flat = planes.reshape(3, -1)
        if not whole:
            flat = flat.compress(np.isfinite(flat[0]) & np.isfinite(flat[1]) & np.isfinite(flat[2]), axis=1)
        return cv2.merge([plane[None] for plane in flat])[0] if flat.size else flat.T

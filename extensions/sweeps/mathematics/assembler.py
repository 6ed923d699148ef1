"""Puts profiles into the base frame while they arrive: base_T_flange(t + offset) @ flange_T_profiler @ (x, 0, z)."""

from collections import deque
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibration.transforms import Array
from registration.errors import PathGap, PathTooCoarse, ProfileError
from registration.points.rigid_motion import RigidMotion
from registration.profiles.profile_block import ProfileBlock
from registration.profiles.robot_path import RobotPath

MAX_WAITING_PROFILES = 20_000
"""Profiles that wait for the robot's poses: 10 s at 2,000 a second."""
MAX_WAITING_POSES_S = 10.0
"""Poses older than this are forgotten where no profiles come."""
MAX_BEND_MM = 0.25
"""By which the sensor may leave the straight line between two poses."""
BLOCK_PROFILES = 256


class SweepAssembler:
    """Profiles and poses in, each in its own order of time; points in the base frame out, as soon as both are there.

    `clock_offset_s`: the robot's clock minus the sensor's, at the same moment.
    """

    def __init__(self, flange_T_profiler: Array, clock_offset_s: float = 0.0) -> None:
        """Raises MotionError, ProfileError."""
        RigidMotion.of(flange_T_profiler, "mm")
        if not np.isfinite(clock_offset_s):
            raise ProfileError(f"a clock offset of {clock_offset_s} s is not possible", "give it in s")
        self._flange_T_profiler = np.asarray(flange_T_profiler, float)
        self._offset_s = float(clock_offset_s)
        self._times: Array = np.empty(0)
        self._poses: Array = np.empty((0, 4, 4))
        self._waiting: deque[ProfileBlock] = deque()
        self._last_s = -np.inf

    def add_poses(self, times_s: ArrayLike, base_T_flange: ArrayLike) -> None:
        """Poses (n, 4, 4) of the flange at times (n,) of the robot's clock, in their order.

        Raises PathError, and PathTooCoarse where they are too far apart for what the arm does.
        """
        new_s = np.atleast_1d(np.asarray(times_s, float))
        times = np.concatenate([self._times, new_s])
        poses = np.concatenate([self._poses, np.asarray(base_T_flange, float).reshape(-1, 4, 4)])
        if len(times) >= 2 and len(new_s):
            newest = slice(max(len(self._times) - 1, 0), None)
            RobotPath.of(times[newest], poses[newest])
        bent = slice(max(len(self._times) - 2, 0), None)
        self._require_straight(times[bent], poses[bent])
        recent = int(np.searchsorted(times, times[-1] - MAX_WAITING_POSES_S)) if len(times) else 0
        self._times, self._poses = times[recent:], poses[recent:]

    def add_profiles(self, block: ProfileBlock) -> None:
        """Profiles later than those before. Raises ProfileError, also when too many wait for poses."""
        if len(block) and block.times_s[0] < self._last_s:
            raise ProfileError(
                f"a profile at {block.times_s[0]:.6f} s follows one at {self._last_s:.6f} s",
                "give the profiles in the order of their times",
            )
        waiting = sum(map(len, self._waiting)) + len(block)
        if waiting > MAX_WAITING_PROFILES:
            what = f"{waiting} profiles wait for the robot's poses, more than {MAX_WAITING_PROFILES}"
            raise ProfileError(what, "give the poses of the path along with the profiles")
        if len(block):
            self._waiting.append(block)
            self._last_s = float(block.times_s[-1])

    def blocks(self) -> Iterator[NDArray[np.float32]]:
        """Points (k, 3) in base, mm, of the profiles that lie on the path so far. Raises PathGap."""
        if len(self._times) < 2:
            return
        path = RobotPath(self._times, self._poses)
        while self._waiting:
            block = self._waiting.popleft()
            ready = int(np.searchsorted(block.times_s + self._offset_s, self._times[-1], side="right"))
            if ready < len(block):
                self._waiting.appendleft(block[ready:])
            if ready:
                flange = path.at(block.times_s[:ready] + self._offset_s)
                yield block[:ready].points_in(flange @ self._flange_T_profiler)
            if ready < len(block):
                break
        # Poses before the one that precedes the next profile are needed no more.
        next_s = self._waiting[0].times_s[0] if self._waiting else self._last_s
        first = int(np.searchsorted(self._times, next_s + self._offset_s, side="right")) - 1
        if first > 0:
            first = min(first, len(self._times) - 2)
            self._times, self._poses = self._times[first:], self._poses[first:]

    def require_finished(self) -> None:
        """Raises PathGap when profiles are left that no pose follows."""
        if self._waiting:
            time_s = float(self._waiting[0].times_s[0]) + self._offset_s
            beyond_s = time_s - float(self._times[-1]) if len(self._times) else np.inf
            raise PathGap(time_s, beyond_s, 0.0, outside=True)

    def _require_straight(self, times: Array, poses: Array) -> None:
        """Raises PathTooCoarse. A parabola leaves its chord between two poses by a quarter of what it leaves by that
        of twice the length at the pose in the middle."""
        if len(times) < 3:
            return
        at = poses[:, :3, :3] @ self._flange_T_profiler[:3, 3] + poses[:, :3, 3]
        along = ((times[1:-1] - times[:-2]) / (times[2:] - times[:-2]))[:, None]
        bends_mm = np.linalg.norm(at[1:-1] - at[:-2] - along * (at[2:] - at[:-2]), axis=1) / 4
        if bends_mm.max() > MAX_BEND_MM:
            worst = int(np.argmax(bends_mm))
            raise PathTooCoarse(float(times[worst + 1]), float(bends_mm[worst]), MAX_BEND_MM)


def assemble_sweep(
    block: ProfileBlock,
    path: RobotPath,
    flange_T_profiler: Array,
    clock_offset_s: float = 0.0,
) -> Iterator[NDArray[np.float32]]:
    """Points (k, 3) in base, mm, of BLOCK_PROFILES at a time. Raises PathGap, MotionError, ProfileError."""
    RigidMotion.of(flange_T_profiler, "mm")
    for start in range(0, len(block), BLOCK_PROFILES):
        part = block[start : start + BLOCK_PROFILES]
        yield part.points_in(path.at(part.times_s + clock_offset_s) @ flange_T_profiler)

"""The flange's path while somebody else moves the arm: from EGM where the cell has it, else by reading poses."""

import numpy as np

from calibration.transforms import Array, inverse
from daemon.runtime.clock import Clock
from drivers.interfaces import PathRecorder, Robot

MAX_ROUND_TRIP_S = 0.05
"""A pose whose answer took longer was taken at a time that is too uncertain, and is left out."""


class PolledPath:
    """drivers.interfaces.PathRecorder of a robot that answers when asked: a pose is taken midway of its round trip."""

    def __init__(self, robot: Robot, clock: Clock) -> None:
        self._robot, self._clock, self._last_s = robot, clock, -np.inf

    async def read(self) -> tuple[Array, Array]:
        """One pose; none when its answer came late, or where the clock has not moved on. Raises DeviceError."""
        reading = await self._robot.read_pose()
        took_s = self._clock.monotonic_s() - reading.taken_at_s
        time_s = reading.taken_at_s + took_s / 2
        if took_s > MAX_ROUND_TRIP_S or time_s <= self._last_s:
            return np.empty(0), np.empty((0, 4, 4))
        self._last_s = time_s
        return np.array([time_s]), reading.base_T_flange[None]


class PathInBase:
    """A recorder whose poses are in the world frame, moved to the base frame."""

    def __init__(self, recorder: PathRecorder, world_T_base: Array) -> None:
        self._recorder, self._base_T_world = recorder, inverse(world_T_base)

    async def read(self) -> tuple[Array, Array]:
        """As the recorder."""
        times_s, world_T_flange = await self._recorder.read()
        return times_s, self._base_T_world @ world_T_flange

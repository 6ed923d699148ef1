"""The flange's path from EGM: poses with the times at which the controller took them."""

import numpy as np

from calibration.transforms import Array, transform_from_quaternion
from drivers.clock_mapping import ClockMapping
from drivers.robots.abb.egm_vibration import SILENT_AFTER_S, EgmMonitor, ReceivedSample

LEARNING_S = 5.0
"""Samples of this time before the sweep give the offset of the clocks."""


class EgmPath:
    """drivers.interfaces.PathRecorder. The clocks' offset stays as it is at the start: 0.25 ms in 5 s at the most."""

    def __init__(self, monitor: EgmMonitor) -> None:
        """Raises DeviceTimeout when the controller sends nothing."""
        self._monitor, mapping = monitor, ClockMapping()
        for arrival in monitor.arrivals(LEARNING_S):
            mapping.note(_stamp_s(arrival), arrival.received_at_s)
            self._newest_s = arrival.received_at_s
        self._offset_s = mapping.offset_s

    async def read(self) -> tuple[Array, Array]:
        """Times (n,) in s of the driver's clock and world_T_flange (n, 4, 4) since the last call.

        Raises DeviceTimeout when the controller sends nothing.
        """
        new = [one for one in self._monitor.arrivals(SILENT_AFTER_S) if one.received_at_s > self._newest_s]
        if not new:
            return np.empty(0), np.empty((0, 4, 4))
        self._newest_s = new[-1].received_at_s
        times_s = np.array([_stamp_s(one) for one in new]) + self._offset_s
        positions = np.array([one.sample.position_mm for one in new])
        quaternions = np.array([one.sample.quaternion_wxyz for one in new])
        quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
        return times_s, transform_from_quaternion(positions, quaternions)


def _stamp_s(arrival: ReceivedSample) -> float:
    """Time of a sample by the controller's clock: the finer one, where the controller sends it."""
    sample = arrival.sample
    return sample.time_us * 1e-6 if sample.time_us else sample.robot_ms * 1e-3

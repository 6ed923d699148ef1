"""The flange's path from EGM: the controller's stamps, on this machine's clock by the least delay."""

from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from drivers.errors import DeviceTimeout
from drivers.robots.abb.egm_vibration import EgmMonitor, EgmPath, ReceivedSample
from protocols.egm.messages import RobotSample

SAMPLE = RobotSample(0, 0, (0.0,) * 6, (0.0, 0.0, 0.0), (2.0, 0.0, 0.0, 0.0))
AHEAD_S = 70_000.0
"""The controller's clock minus this machine's."""
DELAYS_S = (0.003, 0.001, 0.004, 0.002)


class SentSamples:
    """Sample k is taken at 0.004 k s of this machine's clock, at x = k mm, and arrives after one of DELAYS_S."""

    def __init__(self) -> None:
        self.sent: list[ReceivedSample] = []

    def send(self, count: int, *, in_microseconds: bool = False) -> None:
        for k in range(len(self.sent), len(self.sent) + count):
            stamp_s = AHEAD_S + 0.004 * k
            sample = replace(SAMPLE, seqno=k, robot_ms=round(stamp_s * 1e3), position_mm=(float(k), 0.0, 0.0))
            if in_microseconds:
                sample = replace(sample, robot_ms=0, time_us=round(stamp_s * 1e6))
            self.sent.append(ReceivedSample(0.004 * k + DELAYS_S[k % 4], sample))

    def arrivals(self, window_s: float) -> list[ReceivedSample]:
        if not self.sent:
            raise DeviceTimeout("robot", "0 samples came", "start the stream")
        return self.sent


@pytest.mark.parametrize("in_microseconds", [False, True])
async def test_a_pose_has_the_time_at_which_the_controller_took_it(in_microseconds: bool) -> None:
    samples = SentSamples()
    samples.send(40, in_microseconds=in_microseconds)
    path = EgmPath(cast(EgmMonitor, samples))
    assert [len(part) for part in await path.read()] == [0, 0]
    samples.send(20, in_microseconds=in_microseconds)
    times_s, poses = await path.read()
    numbers = np.arange(40, 60)
    np.testing.assert_allclose(times_s, 0.004 * numbers + min(DELAYS_S), atol=1e-5)
    np.testing.assert_allclose(poses[:, 0, 3], numbers)
    np.testing.assert_allclose(poses[:, :3, :3], np.broadcast_to(np.eye(3), (20, 3, 3)))
    assert len((await path.read())[0]) == 0


async def test_a_controller_that_sends_nothing_is_named() -> None:
    with pytest.raises(DeviceTimeout):
        EgmPath(cast(EgmMonitor, SentSamples()))

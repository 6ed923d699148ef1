"""A line profiler in the scanner's place: sends what its laser sees along the arm's true path, as a Gocator does."""

import asyncio
import math
from collections.abc import Callable

import numpy as np

from calibration.transforms import Array, inverse
from mock_robot.devices.tcp_server import TcpServer
from mock_robot.scene.scanner_view import ProfilerModel, profile_door
from mock_robot.truth.truth import CellTruth
from protocols.gocator.data_channel import NO_VALUE, ProfileGroup, RawProfiles, Stamp, encode

PROFILES_HZ = 100.0
SENSOR_AHEAD_S = 12_345.678
"""The sensor's clock minus the mock's."""
STEP_NM = 10_000
"""Of the numbers that are sent: 0.01 mm."""
MIDDLE_UM = 500_000
"""z that is sent as 0."""
POLL_S = 0.005


class MockProfiler(TcpServer):
    """A TCP server; whoever connects gets the profiles from then on, at times of the mock's clock."""

    def __init__(self, truth: CellTruth, flange_at: Callable[[float], Array], clock: Callable[[], float]) -> None:
        """`flange_at`: true base_T_flange at a time of the clock, during the current move."""
        super().__init__()
        self._truth, self._flange_at, self._clock = truth, flange_at, clock
        self._model, self._rng = ProfilerModel(), np.random.default_rng([truth.seed, 0x9A0F])

    async def _converse(self, _task: object, _reader: object, writer: asyncio.StreamWriter) -> None:
        """Profiles are taken every 1 / PROFILES_HZ s of the clock, those that are due at once."""
        sent = self._taken()
        while True:
            due: Array = np.arange(sent + 1, self._taken() + 1, dtype=float)
            if len(due):
                poses = np.array([self._flange_at(float(n / PROFILES_HZ)) for n in due])
                writer.write(await asyncio.to_thread(self._measure, due, poses))
                await writer.drain()
                sent = int(due[-1])
            await asyncio.sleep(POLL_S)

    def _taken(self) -> int:
        """Number of the last profile. That of 4.35 s is 435, though 4.35 * 100 is a little less."""
        return math.floor(self._clock() * PROFILES_HZ + 1e-6)

    def _measure(self, numbers: Array, base_T_flange: Array) -> bytes:
        """The groups of profiles with these numbers, taken from these poses."""
        part_T_profiler = inverse(self._truth.base_T_part) @ base_T_flange @ self._truth.flange_T_scanner
        x, z = profile_door(self._model, part_T_profiler, self._rng)
        missing = np.isnan(z)
        values = np.stack([x * 1e6 / STEP_NM, (z * 1e3 - MIDDLE_UM) * 1e3 / STEP_NM], axis=-1)
        steps = np.where(missing[..., None], NO_VALUE, np.round(np.nan_to_num(values))).astype("<i2")
        return b"".join(
            encode(
                ProfileGroup(
                    (Stamp(int(number), round((number / PROFILES_HZ + SENSOR_AHEAD_S) * 1e6)),),
                    RawProfiles(False, 1, len(row), STEP_NM, STEP_NM, 0, MIDDLE_UM, row.tobytes()),
                )
            )
            for number, row in zip(numbers, steps, strict=True)
        )

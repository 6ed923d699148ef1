"""A line profiler that sends its profiles over TCP, by the protocol of the Gocator's data channel."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray

from drivers.backoff import Backoff
from drivers.clock_mapping import ClockMapping
from drivers.errors import AddressNotUnderstood, ClocksApart, DeviceError, GarbledAnswer, LinkLost
from drivers.scanners.line_profiler import LineProfiler
from drivers.timing import Timing
from protocols.gocator.data_channel import NO_VALUE, PORT, DataChannel, NotGocator, ProfileGroup, RawProfiles
from registration.errors import ProfileError
from registration.profiles.profile_block import MAX_POINTS, ProfileBlock

ADDRESS_FIX = "write profiles://host, profiles://host:port or profiles:/folder"


@dataclass(frozen=True)
class ProfilerHost:
    """A sensor, or a program that speaks for it."""

    host: str
    port: int = PORT


def parse_profiler_address(address: str) -> ProfilerHost | Path:
    """Raises AddressNotUnderstood."""
    rest = address.partition(":")[2]
    if not rest.startswith("//") or rest.startswith("///"):
        folder = rest.removeprefix("//") if rest.startswith("///") else rest
        if not folder:
            raise AddressNotUnderstood(address, "host or folder is missing", ADDRESS_FIX)
        return Path(folder)
    try:
        parts = urlsplit(address)
        host, port = parts.hostname or "", parts.port if parts.port is not None else PORT
    except ValueError as error:
        raise AddressNotUnderstood(address, str(error), ADDRESS_FIX) from error
    if not host or not port or parts.path or parts.query:
        raise AddressNotUnderstood(address, "it is not a host and a port", ADDRESS_FIX)
    return ProfilerHost(host, port)


LIMIT_S = 60.0
CONNECT_LIMIT_S = 5.0
CHUNK_BYTES = 1 << 20
GATHER_S = 0.005
"""Between two looks at the socket: ten profiles at 2,000 a second are converted at once."""
MAX_APART_S = 0.02
"""By which the offset of the clocks may change within a sweep: 2 mm at 100 mm/s."""
FIX = "check address and cable, that the sensor runs, and that its Ethernet output sends profiles with stamps"


class GocatorProfiler(LineProfiler):
    """Connected from `start` on, so that the sensor's clock is known before a sweep begins."""

    lag_s, fix = 0.5, FIX

    def __init__(self, address: ProfilerHost, timing: Timing | None = None, *, limit_s: float = LIMIT_S) -> None:
        super().__init__(f"scanner profiles://{address.host}:{address.port}", timing or Timing(), limit_s)
        self._address = address
        self._clock = ClockMapping()

    async def _look(self) -> None:
        backoff = Backoff(self._timing.chance)
        while True:
            try:
                async with asyncio.timeout(CONNECT_LIMIT_S):
                    reader, writer = await asyncio.open_connection(
                        self._address.host, self._address.port, limit=4 * CHUNK_BYTES
                    )
            except TimeoutError:
                self._report.down(f"no answer to a connection in {CONNECT_LIMIT_S:g} s")
            except OSError as error:
                self._report.down(f"no connection ({error.strerror or error})")
            else:
                backoff.reset()
                self._report.up("connected")
                try:
                    await self._receive(reader)
                except DeviceError as error:
                    self._report.down(error.what)
                    await self._deliver(error)
                finally:
                    writer.transport.abort()
            await self._timing.sleep(backoff.next_wait_s())

    async def _receive(self, reader: asyncio.StreamReader) -> None:
        """Raises LinkLost, GarbledAnswer, ClocksApart."""
        channel, self._clock, self.lost_profiles = DataChannel(), ClockMapping(), 0
        frame_index: int | None = None
        while True:
            try:
                data = await reader.read(CHUNK_BYTES)
            except OSError as error:
                raise LinkLost(self.device, f"the connection broke ({error.strerror or error})", FIX) from error
            if not data:
                raise LinkLost(self.device, "the sensor closed the connection", FIX)
            received_at_s = self._timing.clock()
            try:
                groups = list(channel.receive(data))
            except NotGocator as error:
                what = f"the bytes are not of the data channel ({error})"
                raise GarbledAnswer(self.device, what, "check the port, and that it is a Gocator's protocol") from error
            for group in groups:
                first, last = group.stamps[0].frame_index, group.stamps[-1].frame_index
                self.lost_profiles += max(first - frame_index - 1, 0) if frame_index is not None else 0
                frame_index = last
            if groups:
                self._clock.note(groups[-1].stamps[-1].time_us * 1e-6, received_at_s)
                self._report.up(f"profiles of {groups[-1].profiles.width} points come")
                await self._hand_over(groups)
            await self._timing.sleep(GATHER_S)

    async def _hand_over(self, groups: Sequence[ProfileGroup]) -> None:
        """Deliver the groups as blocks, to a sweep that wants them. Raises ClocksApart."""
        if not self.wanted:
            return
        if self._offset_s is None:
            self._offset_s = self._clock.offset_s
        if abs(self._clock.offset_s - self._offset_s) > MAX_APART_S:
            raise ClocksApart(self.device, self._clock.offset_s - self._offset_s)
        start = 0
        for end in range(1, len(groups) + 1):
            if end == len(groups) or _layout(groups[end].profiles) != _layout(groups[start].profiles):
                await self._deliver(self._block(groups[start:end], self._offset_s))
                start = end

    def _block(self, groups: Sequence[ProfileGroup], offset_s: float) -> ProfileBlock | DeviceError:
        """The profiles of groups of one layout, or what is wrong with them."""
        times_s = np.array([stamp.time_us for group in groups for stamp in group.stamps]) * 1e-6 + offset_s
        try:
            return ProfileBlock.of(times_s, *coordinates_mm([group.profiles for group in groups]))
        except ProfileError as error:
            return GarbledAnswer(self.device, error.what, error.fix)


def coordinates_mm(profiles: Sequence[RawProfiles]) -> tuple[NDArray[Any], NDArray[Any]]:
    """x (n, width), or (width,) of uniform ones, and z (n, width), float32, of profiles of one layout."""
    first = profiles[0]
    raw = np.frombuffer(b"".join(one.values for one in profiles), "<i2")
    raw = raw.reshape(-1, first.width) if first.uniform else raw.reshape(-1, first.width, 2)
    depth = raw if first.uniform else raw[..., 1]
    z = depth * np.float32(first.z_scale_nm * 1e-6) + np.float32(first.z_offset_um * 1e-3)
    z[depth == NO_VALUE] = np.nan
    across = np.arange(first.width) if first.uniform else raw[..., 0]
    x = across * np.float32(first.x_scale_nm * 1e-6) + np.float32(first.x_offset_um * 1e-3)
    return x, z


def _layout(profiles: RawProfiles) -> tuple[bool, int, int, int, int, int]:
    return (
        profiles.uniform,
        min(profiles.width, MAX_POINTS + 1),
        profiles.x_scale_nm,
        profiles.z_scale_nm,
        profiles.x_offset_um,
        profiles.z_offset_um,
    )

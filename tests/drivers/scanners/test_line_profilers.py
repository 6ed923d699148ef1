"""Line profilers at the daemon's end: a sensor on a socket, and a folder that fills."""

import asyncio
from contextlib import aclosing, asynccontextmanager

import numpy as np
import pytest

from drivers.clock_mapping import WINDOW_S, ClockMapping
from drivers.errors import (
    AddressNotUnderstood,
    ClocksApart,
    DeviceTaken,
    DeviceUnreachable,
    GarbledAnswer,
    LinkLost,
    StreamStalled,
    SweepNeeded,
)
from drivers.interfaces import ProfileSource, Scanner
from drivers.registry import check_scanner_address, open_scanner
from drivers.scanners.folder_profiler import FolderProfiler
from drivers.scanners.gocator_profiler import GocatorProfiler, ProfilerHost, coordinates_mm, parse_profiler_address
from drivers.timing import Timing
from protocols.gocator.data_channel import NO_VALUE, ProfileGroup, RawProfiles, Stamp, encode
from registration.profiles.profile_block import ProfileBlock
from tests.support.profile_files import write_npz
from tests.support.waiting import LIMIT_S, SkippableTime, eventually


def group(index, time_us, width=3, count=1):
    values = np.arange(2 * width * count, dtype="<i2").tobytes()
    stamps = tuple(Stamp(index + n, time_us + 500 * n) for n in range(count))
    return encode(ProfileGroup(stamps, RawProfiles(False, count, width, 1_000_000, 500_000, 0, 300_000, values)))


class Sensor:
    """A server that sends what the test says, to whom connects."""

    def __init__(self):
        self.writers = []

    async def start(self):
        self.server = await asyncio.start_server(self._accept, "127.0.0.1", 0)
        self.port = self.server.sockets[0].getsockname()[1]

    async def _accept(self, reader, writer):
        self.writers.append(writer)

    async def send(self, data):
        self.writers[-1].write(data)
        await self.writers[-1].drain()

    def hang_up(self):
        self.writers[-1].close()

    async def close(self):
        for writer in self.writers:
            writer.transport.abort()
        self.server.close()
        await self.server.wait_closed()


class Now:
    """A clock that stands unless the test moves it; sleeping takes no time of it."""

    def __init__(self, at_s=1000.0):
        self.at_s = at_s
        self.timing = Timing(lambda: self.at_s, self._sleep, lambda: 0.5)

    async def _sleep(self, duration_s):
        await asyncio.sleep(0.001 if duration_s < LIMIT_S else LIMIT_S)


@asynccontextmanager
async def sensor_and_driver(now, limit_s=LIMIT_S):
    sensor = Sensor()
    await sensor.start()
    driver = GocatorProfiler(ProfilerHost("127.0.0.1", sensor.port), now.timing, limit_s=limit_s)
    driver.start()
    try:
        await eventually(lambda: driver.link.connected and sensor.writers)
        yield sensor, driver
    finally:
        await driver.close()
        await sensor.close()


async def first_of(driver, sensor, *sent):
    """The next block of a sweep during which these bytes are sent."""
    async with aclosing(driver.profiles()) as blocks:
        reading = asyncio.ensure_future(anext(blocks))
        await eventually(lambda: driver.wanted)
        for data in sent:
            await sensor.send(data)
        return await reading


async def test_profiles_come_with_times_of_this_machines_clock():
    now = Now(at_s=1000.0)
    async with sensor_and_driver(now) as (sensor, driver):
        await sensor.send(group(1, 5_000_000))
        await eventually(lambda: "3 points" in driver.link.detail)
        now.at_s = 1000.5
        block = await first_of(driver, sensor, group(2, 5_450_000, count=2))
    assert block.times_s == pytest.approx([1000.45, 1000.4505])
    assert block.x_mm[0] == pytest.approx([0, 2, 4])
    assert block.z_mm[1] == pytest.approx([300 + 0.5 * n for n in (7, 9, 11)])


async def test_profiles_of_another_width_are_another_block():
    async with sensor_and_driver(Now()) as (sensor, driver), aclosing(driver.profiles()) as blocks:
        reading = asyncio.ensure_future(anext(blocks))
        await eventually(lambda: driver.wanted)
        await sensor.send(group(1, 10) + group(2, 20) + group(3, 30, width=5))
        widths = [(await reading).z_mm.shape[1]]
        while widths[-1] != 5:
            widths.append((await anext(blocks)).z_mm.shape[1])
    assert set(widths) == {3, 5}


async def test_profiles_that_the_sensor_did_not_send_are_counted():
    async with sensor_and_driver(Now()) as (sensor, driver):
        await first_of(driver, sensor, group(1, 10) + group(2, 20) + group(7, 70))
        await eventually(lambda: driver.lost_profiles == 4)


@pytest.mark.parametrize(
    ("sent", "error"),
    [
        (group(1, 1_000_000) + group(2, 999_000), GarbledAnswer),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", GarbledAnswer),
    ],
    ids=["times that go back", "another protocol"],
)
async def test_what_is_wrong_ends_the_sweep(sent, error):
    async with sensor_and_driver(Now()) as (sensor, driver):
        with pytest.raises(error):
            await first_of(driver, sensor, sent)


async def test_a_lost_link_ends_the_sweep_and_is_made_again():
    async with sensor_and_driver(Now()) as (sensor, driver):
        async with aclosing(driver.profiles()) as blocks:
            reading = asyncio.ensure_future(anext(blocks))
            await eventually(lambda: driver.wanted)
            sensor.hang_up()
            with pytest.raises(LinkLost, match="closed the connection"):
                await reading
        await eventually(lambda: len(sensor.writers) == 2 and driver.link.connected)


async def test_clocks_that_run_apart_are_named():
    now = Now()
    async with sensor_and_driver(now) as (sensor, driver), aclosing(driver.profiles()) as blocks:
        reading = asyncio.ensure_future(anext(blocks))
        await eventually(lambda: driver.wanted)
        await sensor.send(group(1, 1_000_000))
        await reading
        await sensor.send(group(2, 1_500_000))
        with pytest.raises(ClocksApart, match="-500 ms"):
            await anext(blocks)


async def test_a_sensor_that_is_silent_is_named():
    time = SkippableTime()
    async with sensor_and_driver(Now()) as (_, other), aclosing(other.profiles()) as blocks:
        other._timing, other._limit_s = time.timing, 0.0
        with pytest.raises(StreamStalled, match="no profile came"):
            await anext(blocks)


async def test_one_sweep_at_a_time_and_no_whole_clouds():
    async with sensor_and_driver(Now()) as (sensor, driver), aclosing(driver.profiles()) as blocks:
        reading = asyncio.ensure_future(anext(blocks))
        await eventually(lambda: driver.wanted)
        with pytest.raises(DeviceTaken):
            await anext(driver.profiles())
        with pytest.raises(SweepNeeded, match="POST /sweeps"):
            await driver.scan(0.0)
        await sensor.send(group(1, 1))
        await reading


async def test_a_sweep_that_reads_slowly_holds_the_sensor_back_and_may_leave():
    async with sensor_and_driver(Now()) as (sensor, driver):
        async with aclosing(driver.profiles()) as blocks:
            reading = asyncio.ensure_future(anext(blocks))
            await eventually(lambda: driver.wanted)
            await sensor.send(b"".join(group(n, 1000 * n, width=3 + n % 2) for n in range(400)))
            await reading
            await eventually(driver._queue.full)
        await eventually(lambda: not driver.wanted)
        await first_of(driver, sensor, group(1000, 500_000))


async def test_without_a_sensor_there_is_no_sweep():
    driver = GocatorProfiler(ProfilerHost("127.0.0.1", 1), Now().timing)
    with pytest.raises(DeviceUnreachable):
        await anext(driver.profiles())


def test_uniform_profiles_have_one_x_for_all():
    values = np.array([[1, 2], [NO_VALUE, 4]], "<i2").tobytes()
    x, z = coordinates_mm([RawProfiles(True, 2, 2, 250_000, 1_000_000, -1000, 0, values)])
    assert x == pytest.approx([-1.0, -0.75])
    assert z[0] == pytest.approx([1.0, 2.0])
    assert np.isnan(z[1, 0])


async def test_a_folder_gives_the_files_of_the_sweep_in_their_order(tmp_path):
    block = ProfileBlock.of([1_000_000.5, 1_000_000.6], [1.0, 2.0], [[3.0, 4.0], [5.0, 6.0]])
    write_npz(tmp_path / "old.npz", block)
    driver = FolderProfiler(tmp_path, Timing(lambda: 50.0), limit_s=LIMIT_S, wall_clock=lambda: 1_000_001.0)
    driver.start()
    try:
        await eventually(lambda: driver.link.connected)
        async with aclosing(driver.profiles()) as blocks:
            reading = asyncio.ensure_future(anext(blocks))
            await eventually(lambda: driver.wanted)
            write_npz(tmp_path / "new.npz", block)
            found = await reading
            assert found.times_s == pytest.approx([49.5, 49.6])
            assert found.z_mm.tolist() == [[3.0, 4.0], [5.0, 6.0]]
            (tmp_path / "other.csv").write_text("a,b\n")
            with pytest.raises(GarbledAnswer, match=r"other\.csv: the first line"):
                await anext(blocks)
    finally:
        await driver.close()


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ("profiles://10.0.0.4", ("10.0.0.4", 3196)),
        ("profiles://10.0.0.4:4000", ("10.0.0.4", 4000)),
        ("profiles:/data/sweeps", "/data/sweeps"),
        ("profiles:///data/sweeps", "/data/sweeps"),
    ],
)
def test_addresses(address, expected):
    found = parse_profiler_address(address)
    assert ((found.host, found.port) if isinstance(found, ProfilerHost) else str(found)) == expected


@pytest.mark.parametrize(
    "address", ["profiles:", "profiles://", "profiles://h:0", "profiles://h:99999", "profiles://h/x"]
)
def test_addresses_that_are_none(address):
    with pytest.raises(AddressNotUnderstood):
        check_scanner_address(address)


async def test_the_registry_opens_both(tmp_path):
    for address in (f"profiles:{tmp_path}", "profiles://127.0.0.1:1"):
        opened: Scanner = open_scanner(address, Now().timing)
        assert isinstance(opened, ProfileSource)
        await opened.close()


def test_the_least_delay_gives_the_offset_and_old_delays_are_forgotten():
    clock = ClockMapping()
    for stamp_s, received_at_s in ((1.0, 101.5), (2.0, 102.1), (3.0, 103.4)):
        clock.note(stamp_s, received_at_s)
    assert clock.offset_s == pytest.approx(100.1)
    for n in range(1, 4):
        clock.note(3.0 + n * (WINDOW_S + 1), 103.3 + n * (WINDOW_S + 1))
    assert clock.offset_s == pytest.approx(100.3)
    clock.note(1.0, 500.0)
    assert clock.offset_s == 499.0

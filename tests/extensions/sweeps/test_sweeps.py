"""POST /sweeps: a line profiler's profiles in base, over a socket, while a fake arm moves along a straight line."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.external_axis import ExternalAxisDocument
from calibration.transforms import transform
from daemon.cli.checks import _check_scanner
from daemon.errors import NotStill
from daemon.model.records import AppliedCalibration, CalibrationRecord
from drivers.errors import DeviceError, LinkLost, StreamStalled, SweepNeeded
from drivers.interfaces import LinkHealth, PoseReading, ScannedCloud
from extensions.sweeps.errors import NothingOnPath
from extensions.sweeps.service import SweepService
from registration.profiles.profile_block import ProfileBlock
from tests.daemon.calibrations import beside, document_with_covariance
from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.fakes import FakeRobot
from tests.support.waiting import LIMIT_S, eventually

SPEED_MM_S = 100.0


@dataclass
class MovingRobot(FakeRobot):
    """At x = 100 mm/s * t; each reading is taken at the next time of `times_s`, and the last one again and again."""

    step_s: float = 0.02
    now_s: float = 0.0
    hold: bool = False

    async def read_pose(self) -> PoseReading:
        self._alive()
        if not self.hold:
            self.now_s += self.step_s
        pose = transform(np.eye(3), [SPEED_MM_S * self.now_s, 0.0, 500.0])
        return PoseReading(pose, (0, 0, 0, 0), self.external_axes, self.hold, self.now_s)


@dataclass
class FakeProfiler:
    """Gives the blocks that a test puts."""

    lag_s: float = 0.0
    lost_profiles: int = 0
    blocks: asyncio.Queue[ProfileBlock | DeviceError] = field(default_factory=asyncio.Queue)

    @property
    def link(self) -> LinkHealth:
        return LinkHealth(True, "connected", 0.0)

    def start(self) -> None:
        pass

    async def close(self) -> None:
        pass

    async def scan(self, newer_than_s: float) -> ScannedCloud:
        raise SweepNeeded("profiler fake")

    async def profiles(self) -> AsyncIterator[ProfileBlock]:
        while True:
            block = await self.blocks.get()
            if isinstance(block, DeviceError):
                raise block
            yield block

    def measure(self, *times_s: float) -> None:
        z = np.tile([200.0, 201.0, np.nan], (len(times_s), 1))
        self.blocks.put_nowait(ProfileBlock.of(times_s, [-5.0, 0.0, 5.0], z))


@dataclass
class Sweeping:
    """A daemon whose clock is that of the robot, and what a test moves."""

    bench: Bench
    robot: MovingRobot
    profiler: FakeProfiler

    async def begin(self) -> dict[str, Any]:
        answer = await self.bench.client.post("/sweeps", json={})
        assert answer.status_code == 201, answer.text
        begun: dict[str, Any] = answer.json()
        await self.until(begun, lambda sweep: sweep.poses > 2)
        return begun

    async def until(self, begun: dict[str, Any], holds: Callable[[Any], bool]) -> None:
        sweep = self.bench.application.service(SweepService).get(begun["id"])
        await eventually(lambda: holds(sweep) or sweep.state != "running")

    async def end(self, begun: dict[str, Any]) -> dict[str, Any]:
        ended: dict[str, Any] = (await self.bench.client.post(begun["links"]["end"])).json()
        return ended


@pytest.fixture
async def sweeping(tmp_path: Path) -> AsyncIterator[Sweeping]:
    async with a_cell(tmp_path) as found:
        yield found


@asynccontextmanager
async def a_cell(
    folder: Path, calibration: CalibrationDocument | None = None, **scanner: Any
) -> AsyncIterator[Sweeping]:
    robot, profiler, parts = MovingRobot(), FakeProfiler(), Parts()
    parts.robot, parts.scanner = robot, profiler  # type: ignore[assignment]
    async with serving(settings_for(folder, scanner=scanner), parts) as bench:
        object.__setattr__(bench.application.service(SweepService).clock, "monotonic_s", lambda: robot.now_s)
        document, store = calibration or document_with_covariance(), bench.application.store
        await store.save_calibration(CalibrationRecord("cal-1", None, document.created_at, True, document))
        await store.apply(AppliedCalibration("cal-1", document.created_at, "test"))
        yield Sweeping(bench, robot, profiler)


async def test_profiles_come_out_in_base_while_the_sweep_runs(sweeping: Sweeping) -> None:
    begun = await sweeping.begin()
    robot, client = sweeping.robot, sweeping.bench.client
    at_s = np.array([robot.now_s + 0.05, robot.now_s + 0.0625])
    async with client.stream("GET", begun["links"]["points"]) as answer:
        pieces = answer.aiter_bytes()
        sweeping.profiler.measure(-5.0)  # before the first pose: it belongs to no sweep
        sweeping.profiler.measure(*at_s)
        first = await anext(pieces)
        while len(first) < 48:
            first += await anext(pieces)
        assert (await sweeping.end(begun))["state"] == "done"
        rest = b"".join([piece async for piece in pieces])
    assert rest == b""
    base_T_flange = [transform(np.eye(3), [SPEED_MM_S * t, 0.0, 500.0]) for t in at_s]
    document = document_with_covariance().flange_T_camera
    assert document is not None
    expected = [
        (pose @ document.transform() @ point)[:3]
        for pose in base_T_flange
        for point in ([-5.0, 0.0, 200.0, 1.0], [0.0, 0.0, 201.0, 1.0])
    ]
    assert np.frombuffer(first, "<f4").reshape(-1, 3) == pytest.approx(np.array(expected), abs=1e-3)
    found = (await client.get(begun["links"]["self"])).json()
    assert (found["profiles"], found["points"], found["left_out_profiles"], found["problem"]) == (3, 4, 1, None)
    assert found["largest_gap_s"] == pytest.approx(0.02)


@pytest.mark.slow
async def test_the_cell_is_held_and_free_again(sweeping: Sweeping) -> None:
    begun = await sweeping.begin()
    second = await sweeping.bench.client.post("/sweeps", json={})
    assert (second.status_code, second.json()["code"]) == (409, "cell-busy")
    await sweeping.end(begun)
    assert sweeping.bench.application.cell.holder is None
    assert (await sweeping.end(begun))["state"] == "done"


async def _lose_the_sensor(cell: Sweeping) -> None:
    cell.profiler.blocks.put_nowait(LinkLost("profiler fake", "the connection broke", "look at the cable"))


async def _lose_the_robot(cell: Sweeping) -> None:
    cell.robot.lost = True


async def _go_back_in_time(cell: Sweeping) -> None:
    now_s = cell.robot.now_s
    cell.profiler.measure(now_s + 0.5)
    cell.profiler.measure(now_s + 0.4)


async def _leave_poses_out(cell: Sweeping) -> None:
    cell.profiler.measure(cell.robot.now_s + 0.3)
    cell.robot.step_s = 0.5


async def _move_unevenly(cell: Sweeping) -> None:
    cell.robot.step_s = 0.09
    cell.robot.base_T_flange = np.eye(4)

    async def read_pose() -> PoseReading:
        cell.robot.now_s += 0.09
        pose = transform(np.eye(3), [0.0, 50.0 * np.sin(8.0 * cell.robot.now_s), 500.0])
        return PoseReading(pose, (0, 0, 0, 0), (), False, cell.robot.now_s)

    cell.robot.read_pose = read_pose  # type: ignore[method-assign]


@pytest.mark.parametrize(
    ("trouble", "code"),
    [
        (_lose_the_sensor, "link-lost"),
        (_lose_the_robot, "link-lost"),
        (_go_back_in_time, "profiles-unusable"),
        (_leave_poses_out, "path-gap"),
        (_move_unevenly, "path-too-coarse"),
    ],
    ids=["sensor lost", "robot lost", "times go back", "poses missing", "too fast for the poses"],
)
async def test_what_goes_wrong_ends_the_sweep_with_its_name(
    sweeping: Sweeping, trouble: Any, code: str, caplog: pytest.LogCaptureFixture
) -> None:
    begun = await sweeping.begin()
    await trouble(sweeping)
    with pytest.raises(httpx.RemoteProtocolError):
        await sweeping.bench.client.get(begun["links"]["points"])
    found = (await sweeping.bench.client.get(begun["links"]["self"])).json()
    assert (found["state"], found["problem"]["code"]) == ("failed", code)
    assert sweeping.bench.application.cell.holder is None
    assert not [record for record in caplog.records if record.exc_info]


async def test_clocks_that_do_not_overlap_are_named(sweeping: Sweeping) -> None:
    begun = await sweeping.begin()
    sweeping.profiler.measure(-100.0, -99.0)
    await sweeping.until(begun, lambda sweep: sweep.profiles == 2)
    ended = await sweeping.end(begun)
    assert (ended["state"], ended["problem"]["code"]) == ("failed", "nothing-on-path")


@pytest.mark.parametrize(
    ("left_out", "first"), [(4, "check that the part is within"), (1100, "check the sensor's clock")]
)
def test_profiles_that_are_empty_are_told_from_a_clock_that_is_off(left_out: int, first: str) -> None:
    error = NothingOnPath(1104, left_out)
    assert f"{1104 - left_out} were taken on it and are empty, {left_out} before or after it" in error.what
    assert error.fix.startswith(first)


async def test_a_sweep_ends_before_it_takes_the_room_of_a_run(sweeping: Sweeping) -> None:
    begun = await sweeping.begin()
    store = sweeping.bench.application.store
    store.run_bytes = store.free_bytes() + 10**12
    await sweeping.until(begun, lambda sweep: False)
    found = (await sweeping.bench.client.get(begun["links"]["self"])).json()
    assert (found["state"], found["problem"]["code"]) == ("failed", "storage-full")


async def test_a_sweep_that_nobody_ends_is_broken_off(sweeping: Sweeping) -> None:
    begun = await sweeping.begin()
    sweeping.robot.now_s += 1000.0
    await sweeping.until(begun, lambda sweep: False)
    found = (await sweeping.bench.client.get(begun["links"]["self"])).json()
    assert found["problem"]["code"] == "sweep-too-long"


async def test_the_offset_of_the_settings_is_the_robots_clock_minus_the_sensors(tmp_path: Path) -> None:
    async with a_cell(tmp_path, clock_offset_s=0.25) as cell:
        begun = await cell.begin()
        at_s = cell.robot.now_s
        cell.profiler.measure(at_s)
        await cell.until(begun, lambda sweep: sweep.points == 2)
        await cell.end(begun)
        octets = (await cell.bench.client.get(begun["links"]["points"])).content
    document = document_with_covariance().flange_T_camera
    assert document is not None
    place = transform(np.eye(3), [SPEED_MM_S * (at_s + 0.25), 0.0, 500.0]) @ document.transform()
    expected = (place @ [-5.0, 0.0, 200.0, 1.0])[:3]
    assert np.frombuffer(octets, "<f4")[:3] == pytest.approx(expected, abs=1e-3)


async def test_a_scanner_of_whole_clouds_makes_no_sweep_and_a_profiler_no_cloud(
    tmp_path: Path, sweeping: Sweeping
) -> None:
    client = sweeping.bench.client
    scan = (await client.post("/scans", json={"name": "door"})).json()
    sweeping.robot.hold = True
    refused = await client.post(f"/scans/{scan['id']}/views")
    assert (refused.status_code, refused.json()["code"]) == (409, "sweep-needed")
    assert (await client.get("/sweeps/none")).status_code == 404
    async with serving(settings_for(tmp_path / "other")) as other:
        document, store = document_with_covariance(), other.application.store
        await store.save_calibration(CalibrationRecord("cal-1", None, document.created_at, True, document))
        await store.apply(AppliedCalibration("cal-1", document.created_at, "test"))
        answer = await other.client.post("/sweeps", json={})
    assert (answer.status_code, answer.json()["code"]) == (409, "no-profiler")


async def test_stopping_the_daemon_breaks_a_sweep_off(tmp_path: Path) -> None:
    async with a_cell(tmp_path) as cell:
        begun = await cell.begin()
        sweep = cell.bench.application.service(SweepService).get(begun["id"])
    async with asyncio.timeout(LIMIT_S):
        await eventually(lambda: sweep.state == "failed")


async def test_check_waits_for_a_profile() -> None:
    profiler = FakeProfiler()
    profiler.measure(0.0)
    found = await _check_scanner("laser", profiler)
    assert (found.ok, found.what) == (True, "a line profiler: 3 points a profile")


async def test_check_of_a_line_profiler_that_sends_nothing_raises_its_cause() -> None:
    profiler = FakeProfiler()
    profiler.blocks.put_nowait(StreamStalled("laser", "no profile came in 5 s", "check the trigger"))
    with pytest.raises(StreamStalled, match="no profile came"):
        await _check_scanner("laser", profiler)


async def test_check_of_files_of_profiles_waits_for_no_sweep() -> None:
    found = await _check_scanner("laser", FakeProfiler(lag_s=3.0))
    assert (found.ok, found.what) == (True, "a line profiler: connected; its files are read during a sweep")


async def test_points_of_a_sweep_on_a_track_lie_as_from_its_zero(tmp_path: Path) -> None:
    track = ExternalAxisDocument(kind="track", direction=(0.0, 1.0, 0.0))
    async with a_cell(tmp_path, beside(document_with_covariance(), track)) as cell:
        cell.robot.external_axes = (300.0,)
        begun = await cell.begin()
        cell.profiler.measure(cell.robot.now_s + 0.05)
        await cell.until(begun, lambda sweep: sweep.points > 0)
        assert (await cell.end(begun))["state"] == "done"
        content = (await cell.bench.client.get(begun["links"]["points"])).content
        y_mm = np.frombuffer(content, "<f4").reshape(-1, 3)[:, 1]
        document = document_with_covariance().flange_T_camera
        assert document is not None
        there = document.transform() @ [[-5.0, 0.0], [0.0, 0.0], [200.0, 201.0], [1.0, 1.0]]
        assert y_mm == pytest.approx(300.0 + there[1], abs=1e-3)

        begun = await cell.begin()
        cell.robot.external_axes = (310.0,)
        sweep = cell.bench.application.service(SweepService).get(begun["id"])
        await eventually(lambda: sweep.state != "running")
        assert (sweep.state, type(sweep.failure)) == ("failed", NotStill)

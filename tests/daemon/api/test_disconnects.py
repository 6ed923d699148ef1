"""A client that hangs up costs nothing further: its waits, readings and queued work end; a run goes on."""

import asyncio
import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from drivers.interfaces import PoseReading, RobotStatus
from tests.daemon.api.raw_requests import RawRequest
from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.fakes import FakeRobot, Gate
from tests.support.waiting import LIMIT_S, eventually

HUNG_UP = 20


class SilentRobot(FakeRobot):
    """Answers requests for its status or pose when `answers` is set."""

    def __init__(self) -> None:
        super().__init__()
        self.waiting, self.most_waiting, self.answers = 0, 0, asyncio.Event()
        self.answers.set()

    async def read_status(self) -> RobotStatus:
        await self._wait()
        return await super().read_status()

    async def read_pose(self) -> PoseReading:
        await self._wait()
        return await super().read_pose()

    async def _wait(self) -> None:
        self.waiting += 1
        self.most_waiting = max(self.most_waiting, self.waiting)
        try:
            await self.answers.wait()
        finally:
            self.waiting -= 1


@pytest.fixture
async def silent(tmp_path: Path) -> AsyncIterator[tuple[Bench, SilentRobot]]:
    robot = SilentRobot()
    async with serving(settings_for(tmp_path), Parts(robot)) as bench:
        yield bench, robot


async def run_that_stays(bench: Bench) -> tuple[str, Gate]:
    """The path of a run held in its second move, and the gate that holds it."""
    bench.robot.before_move = gate = Gate(at_move=2)
    location = (await bench.client.post("/calibrate")).headers["location"]
    await gate.reached.wait()
    return location, gate


async def test_waits_for_a_run_end_with_their_clients(bench: Bench) -> None:
    location, gate = await run_that_stays(bench)
    before = len(asyncio.all_tasks())
    waits = [await RawRequest.send(bench, f"GET {location}?wait=3600") for _ in range(HUNG_UP)]
    await eventually(lambda: len(asyncio.all_tasks()) >= before + HUNG_UP)
    for wait in waits:
        await wait.hang_up()
    await eventually(lambda: len(asyncio.all_tasks()) <= before)
    gate.open.set()
    assert (await bench.run_over(location))["state"] == "finished"


async def test_those_who_hang_up_leave_one_request_to_a_device(silent: tuple[Bench, SilentRobot]) -> None:
    bench, robot = silent
    robot.answers.clear()
    before = len(asyncio.all_tasks())
    for _ in range(HUNG_UP):
        asked = await RawRequest.send(bench, "GET /robot")
        await eventually(lambda: robot.waiting == 1)
        await asked.hang_up()
    await eventually(lambda: len(asyncio.all_tasks()) <= before + 1)
    assert robot.waiting == 1
    robot.answers.set()
    assert (await bench.client.get("/robot")).status_code == 200


async def test_uploads_seen_from_where_the_arm_stands_ask_the_robot_one_at_a_time(
    silent: tuple[Bench, SilentRobot],
) -> None:
    bench, robot = silent
    location = (await bench.client.post("/scans", json={"name": "part"})).headers["location"]
    before = len(asyncio.all_tasks())
    robot.answers.clear()
    robot.most_waiting = 0
    head = f"POST {location}/views?pose=now\nContent-Type: model/ply"
    uploads = [await RawRequest.send(bench, head, b"ply\n", length=10_000_000) for _ in range(HUNG_UP)]
    await eventually(lambda: len(asyncio.all_tasks()) >= before + HUNG_UP and robot.waiting == 1)
    for upload in uploads:
        await upload.hang_up()
    assert robot.most_waiting == 1
    robot.answers.set()
    await eventually(lambda: len(asyncio.all_tasks()) <= before)
    assert (await bench.client.get("/robot")).status_code == 200
    assert (await bench.client.get(location)).json()["views"] == []


async def test_a_run_goes_on_when_its_client_hangs_up(bench: Bench) -> None:
    bench.robot.before_move = gate = Gate(at_move=2)
    started = await RawRequest.send(bench, "POST /calibrate?wait=3600\nIdempotency-Key: k", b'{"count": 3}')
    await gate.reached.wait()
    await started.hang_up()
    same: dict[str, Any] = {"content": b'{"count": 3}', "headers": {"idempotency-key": "k"}}
    async with asyncio.timeout(LIMIT_S):
        while (again := await bench.client.post("/calibrate?wait=0", **same)).status_code == 409:
            assert again.json()["code"] == "request-in-flight"
    assert again.headers["idempotency-replayed"] == "true"
    gate.open.set()
    assert (await bench.run_over(f"/runs/{again.json()['id']}"))["state"] == "finished"
    assert len((await bench.client.get("/runs")).json()["runs"]) == 1


async def test_half_a_body_is_no_error_of_the_daemon(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    for path in ("/setup", "/scans", "/calibrate"):
        half = await RawRequest.send(bench, f"POST {path}", b"{", length=100)
        await asyncio.sleep(0)
        await half.hang_up()
    metrics = (await bench.client.get("/metrics")).text
    assert 'handeyed_http_requests_total{method="POST",status="500"} 0' in metrics
    assert not [record for record in caplog.records if record.levelname == "ERROR"]


@pytest.mark.parametrize("path", ["/robot", "/events", "/metrics", "/runs?limit=500", "/camera/frame.png"])
async def test_whoever_hangs_up_at_once_leaves_nothing_behind(
    bench: Bench, caplog: pytest.LogCaptureFixture, path: str
) -> None:
    assert (await bench.client.get("/health")).status_code == 200
    before = len(asyncio.all_tasks())
    for _ in range(HUNG_UP):
        await (await RawRequest.send(bench, f"GET {path}")).hang_up()
    await eventually(lambda: len(asyncio.all_tasks()) <= before)
    assert not [record for record in caplog.records if record.levelname == "ERROR"]


async def test_a_get_with_a_body_is_answered(bench: Bench) -> None:
    asked = await RawRequest.send(bench, "GET /robot\nConnection: close", json.dumps({"x": 1}).encode())
    async with asyncio.timeout(LIMIT_S):
        assert b" 200 " in await asked.reader.readline()
    await asked.hang_up()

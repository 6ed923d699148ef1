"""GET /live: one poller reads the cell for all listeners, and each hears a beat every second."""

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from calibration.transforms import Array
from daemon.api.http_errors import TooManyListeners
from daemon.api.live.live_feed import MAX_LISTENERS, LiveFeed, message_of
from drivers.errors import DeviceTimeout, DeviceUnreachable
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.fakes import Gate
from tests.daemon.named_cameras import two_cameras
from tests.support.waiting import LIMIT_S, eventually

KEYS = {"at", "software", "robot", "run", "devices", "ready", "ready_of", "holder", "look"}


class Listening:
    """The messages of one listener, one after the other."""

    def __init__(self, lines: AsyncIterator[str]) -> None:
        self._lines = lines
        self.now: dict[str, Any] = {}
        self.bytes: list[int] = []

    async def next(self) -> dict[str, Any]:
        """The next message; `now` holds everything that was told so far."""
        async with asyncio.timeout(LIMIT_S):
            async for line in self._lines:
                if line.startswith("data: "):
                    message: dict[str, Any] = json.loads(line.removeprefix("data: "))
                    self.now |= message
                    self.bytes.append(len(line) + len("event: live\n\n"))
                    return message
        raise EOFError

    async def until(self, key: str, value: Any) -> dict[str, Any]:
        """Everything that is known once `key` is `value`."""
        while self.now.get(key) != value:
            await self.next()
        return self.now


@asynccontextmanager
async def listening(bench: Bench) -> AsyncIterator[Listening]:
    async with bench.client.stream("GET", "/live") as answer:
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith("text/event-stream")
        yield Listening(answer.aiter_lines())


def feed_of(bench: Bench) -> LiveFeed:
    feed: LiveFeed = bench.server._routes.state.live
    return feed


async def test_the_first_message_is_whole_and_the_next_have_what_has_changed(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, robot={"model": "IRB 1600-6/1.45"})) as bench, listening(bench) as heard:
        first = await heard.next()
        assert set(first) == KEYS
        assert first["run"] is first["holder"] is None
        assert first["ready"]["calibrate"] == {"ready": True, "reasons": [], "reason_details": []}
        assert first["robot"]["mode"] == "automatic"
        assert first["robot"]["model"] == "IRB 1600-6/1.45"
        assert first["robot"]["skeleton_mm"][0] == [0.0, 0.0, 0.0]
        flange = first["robot"]["base_T_flange"]["translation_mm"]
        assert all(abs(a - b) < 0.01 for a, b in zip(first["robot"]["skeleton_mm"][4], flange, strict=True))
        assert [device["name"] for device in first["devices"]] == ["robot", "camera", "scanner"]
        bench.robot.status["motors_on"] = False
        changed = {}
        while "robot" not in changed:
            changed = await heard.next()
        assert not changed["robot"]["motors_on"]
        assert "software" not in changed
        await heard.until("run", None)


async def test_each_camera_has_its_own_readiness(tmp_path: Path) -> None:
    async with two_cameras(tmp_path) as bench, listening(bench) as heard:
        first = await heard.next()
        assert first["ready"]["calibrate"]["ready"] and first["ready_of"]["wrist"]["calibrate"]["ready"]
        bench.camera.failing = DeviceUnreachable("camera", "it does not answer", "switch it on")
        changed = await heard.next()
        while "ready" not in changed:
            changed = await heard.next()
        assert not changed["ready"]["calibrate"]["ready"]
        assert "ready_of" not in changed


async def test_an_idle_cell_costs_few_bytes_and_one_reading_a_beat(bench: Bench) -> None:
    async with listening(bench) as one, listening(bench) as other, listening(bench) as third:
        for heard in (one, other, third):
            await heard.next()
        before, messages = bench.robot.reads, 0
        while messages < 3:
            for heard in (one, other, third):
                await heard.next()
            messages += 1
        assert bench.robot.reads - before <= messages + 1
        assert max(one.bytes[1:]) < 2000
        assert bench.camera.pictures == 0


@pytest.mark.slow
async def test_a_run_is_followed_and_its_holder_named(bench: Bench) -> None:
    bench.robot.before_move = gate = Gate(at_move=2)
    async with listening(bench) as heard:
        await heard.next()
        run = (await bench.client.post("/calibrate")).json()
        await gate.reached.wait()
        assert (await heard.until("holder", f"run {run['id']}"))["run"]["id"] == run["id"]
        while heard.now["run"]["station"] != 1:
            await heard.next()
        assert heard.now["run"]["started_by"] == "local"
        gate.open.set()
        await heard.until("run", None)


async def test_a_robot_that_fails_is_null_and_the_beat_goes_on(bench: Bench) -> None:
    async with listening(bench) as heard:
        await heard.next()
        bench.robot.broken_with = DeviceTimeout("robot fake", "it did not answer", "look at the cable")
        await heard.until("robot", None)
        device = next(device for device in heard.now["devices"] if device["name"] == "robot")
        assert device["last_error"]["code"] == "device-timeout"
        assert heard.now["ready"]["calibrate"]["ready"] is False
        bench.robot.broken_with = None
        while heard.now["robot"] is None:
            await heard.next()


async def test_a_device_that_is_lost_is_an_event_with_what_to_do(bench: Bench) -> None:
    async with listening(bench) as heard:
        await heard.next()
        bench.robot.lost = True
        while heard.now["devices"][0]["connected"]:
            await heard.next()
        assert heard.now["devices"][0]["last_error"]["fix"]
    await eventually(lambda: any(event.kind == "device" for event in bench.application.events._kept))


async def test_nobody_reads_the_cell_when_nobody_listens(bench: Bench) -> None:
    feed = feed_of(bench)
    async with listening(bench) as heard:
        await heard.next()
    await eventually(lambda: feed._poller is None)
    assert not feed._listeners


async def test_a_reading_that_nobody_waited_for_is_not_shown_to_the_next_as_new(bench: Bench) -> None:
    feed, gate, ask = feed_of(bench), asyncio.Event(), bench.robot.read_joints

    async def late() -> Array:
        await gate.wait()
        return await ask()

    bench.robot.read_joints = late  # type: ignore[method-assign]
    async with listening(bench) as heard:
        assert (await heard.next())["robot"] is None
    await eventually(lambda: feed._poller is None)
    gate.set()
    readings = bench.application.readings.robot
    before = await readings.read()
    bench.robot.base_T_flange[0, 3] += 100.0
    await eventually(lambda: readings._is_old(readings._reading))  # type: ignore[arg-type]
    async with listening(bench) as heard:
        shown = (await heard.next())["robot"]["base_T_flange"]["translation_mm"][0]
    assert shown == pytest.approx(before.pose.base_T_flange[0, 3] + 100.0)


async def test_as_many_listen_as_may_and_the_next_is_refused(bench: Bench) -> None:
    feed = feed_of(bench)
    places = [feed.admit(f"192.0.2.{at}") for at in range(MAX_LISTENERS)]
    answer = await bench.client.get("/live")
    assert (answer.status_code, answer.json()["code"]) == (503, "too-many-listeners")
    assert "retry-after" in answer.headers
    for place in places:
        feed.release(place)
    async with listening(bench) as heard:
        await heard.next()


async def test_one_address_takes_half_of_the_places_at_most(bench: Bench) -> None:
    feed = feed_of(bench)
    places = [feed.admit("192.0.2.1") for _ in range(MAX_LISTENERS // 2)]
    with pytest.raises(TooManyListeners):
        feed.admit("192.0.2.1")
    async with listening(bench) as heard:
        await heard.next()
    for place in places:
        feed.release(place)


async def test_the_end_of_the_daemon_ends_the_stream(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench, listening(bench) as heard:
        await heard.next()
        bench.application.begin_stop("the test")
        try:
            while True:
                await heard.next()
        except EOFError:
            pass


def test_a_message_has_the_time_and_what_differs() -> None:
    snapshot = {"at": '"t2"', "run": "null", "holder": '"a"'}
    assert message_of(snapshot, {"at": '"t2"', "run": "null"}) == b'event: live\ndata: {"at":"t2","holder":"a"}\n\n'
    assert message_of(snapshot, snapshot) == b'event: live\ndata: {"at":"t2"}\n\n'

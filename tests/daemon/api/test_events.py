"""Events keep their numbers over a restart; a listener catches up, or is told what it missed."""

import asyncio
import json
from collections.abc import Sequence
from pathlib import Path

from daemon.errors import StorageError
from daemon.runtime.event_bus import MAX_EVENTS, RESTART_GAP, BusEvent, EventBus
from tests.daemon.api.event_stream import read_events
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.records import a_run
from tests.support.waiting import LIMIT_S


async def heard(log: EventBus, after: int, until: int) -> list[BusEvent]:
    events: list[BusEvent] = []
    async with asyncio.timeout(LIMIT_S):
        async for event in log.listen(after):
            assert event is not None
            events.append(event)
            if event.number >= until:
                break
    return events


class FailingKeeper:
    """A disk that is full."""

    async def last(self) -> list[BusEvent]:
        return []

    async def keep(self, events: Sequence[BusEvent]) -> None:
        raise StorageError("full", "free some space")


async def test_what_the_disk_refuses_is_reported_all_the_same() -> None:
    log = EventBus(FailingKeeper())
    log.publish("run", {"n": 1})
    assert await heard(log, 0, 1) == [BusEvent(1, "run", {"n": 1})]


async def test_a_listener_that_comes_too_late_learns_what_it_lost() -> None:
    log = EventBus()
    for k in range(MAX_EVENTS + 10):
        log.publish("run", {"n": k})
    events = await heard(log, 5, MAX_EVENTS + 10)
    assert events[0] == BusEvent(10, "lost", {"after": 5, "until": 10})
    assert [event.number for event in events[1:]] == list(range(11, MAX_EVENTS + 11))
    assert (await heard(log, 10, 11))[0].kind == "run"


async def test_silence_is_broken_by_a_comment() -> None:
    log = EventBus()
    async for event in log.listen(0, idle_s=0.01):
        assert event is None
        break


async def test_what_was_missed_over_a_restart_is_reported_with_numbers_that_only_grow(tmp_path: Path) -> None:
    settings = settings_for(tmp_path)
    async with serving(settings) as bench:
        first = await calibrate(bench)
        await bench.application.events.flush()
        last = bench.application.events.last
    async with serving(settings) as bench:
        second = await calibrate(bench)
        events = await read_events(bench.client, until="finished", last_event_id=str(last - 2))
        assert [int(event["id"]) for event in events] == [last - 1, last]
        assert {json.loads(event["data"])["id"] for event in events if event["event"] == "run"} == {first}
        later = await read_events(bench.client, until="finished", last_event_id=str(last))
        assert int(later[0]["id"]) == last + RESTART_GAP + 1
        assert {json.loads(event["data"])["id"] for event in later if event["event"] == "run"} == {second}


async def calibrate(bench: Bench) -> str:
    run: str = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()["id"]
    return run


async def test_a_run_that_a_killed_daemon_left_is_an_event_of_the_next(tmp_path: Path) -> None:
    from daemon.store.store import Store

    store = Store(tmp_path)
    await store.save_run(a_run("r1"))
    await store.close()
    async with serving(settings_for(tmp_path)) as bench:
        events = await read_events(bench.client, until="failed", last_event_id="0")
        assert json.loads(events[-1]["data"])["id"] == "r1"

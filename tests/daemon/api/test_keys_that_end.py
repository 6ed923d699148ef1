"""A key's end ends what it is used for: event streams and waits, also those from before there were keys."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from daemon.access.roles import Role
from daemon.runtime.clock import Clock
from daemon.store.access_keys import AccessKeys, KeyService
from daemon.store.key_watch import CHECK_S
from daemon.store.opening import open_offline
from tests.daemon.access_keys import TEST, bearer
from tests.daemon.api.raw_requests import RawRequest
from tests.daemon.cell_under_test import Bench
from tests.daemon.fakes import Gate
from tests.support.waiting import LIMIT_S


def test_the_keys_are_read_often_enough() -> None:
    assert CHECK_S <= 0.5


async def revoke(bench: Bench, folder: Path) -> None:
    await bench.application.key_service.revoke("Ann", TEST)


async def expire(bench: Bench, folder: Path) -> None:
    await bench.application.key_service.rotate("Ann", TEST, overlap_h=0)


async def revoke_by_command(bench: Bench, folder: Path) -> None:
    with open_offline(folder) as database:
        await KeyService(AccessKeys(database), Clock()).revoke("Ann", TEST)


ENDS: dict[str, Callable[[Bench, Path], Awaitable[None]]] = {
    "revoked": revoke,
    "rotated out": expire,
    "revoked by a command": revoke_by_command,
}


async def stay_in_a_run(bench: Bench, headers: dict[str, str]) -> tuple[str, Gate]:
    bench.robot.before_move = gate = Gate(at_move=2)
    started = await bench.client.post("/calibrate", headers=headers)
    await gate.reached.wait()
    return started.headers["location"], gate


async def rest_of(request: RawRequest) -> bytes:
    async with asyncio.timeout(LIMIT_S):
        rest = await request.reader.read()
    await request.hang_up()
    return rest


@pytest.mark.parametrize("end", ENDS.values(), ids=ENDS)
async def test_streams_and_waits_of_a_key_end_with_it(
    bench: Bench, tmp_path: Path, end: Callable[[Bench, Path], Awaitable[None]]
) -> None:
    desk = bench.application.key_service
    ann = f"Authorization: Bearer {(await desk.add('Ann', Role.OPERATOR, TEST))[0]}"
    bob = (await desk.add("Bob", Role.OPERATOR, TEST))[0]
    location, gate = await stay_in_a_run(bench, bearer(bob))
    stream = await RawRequest.send(bench, f"GET /events\n{ann}\nConnection: close")
    assert b" 200 " in await stream.reader.readline()
    wait = await RawRequest.send(bench, f"GET {location}?wait=3600\n{ann}")
    bobs = await RawRequest.send(bench, f"GET /events\nAuthorization: Bearer {bob}")
    await end(bench, tmp_path)
    assert (await rest_of(stream)).endswith(b"0\r\n\r\n")
    answer = await rest_of(wait)
    assert b" 401 " in answer.splitlines()[0]
    assert b"'Ann' is " in answer
    bench.application.events.publish("test", {})
    async with asyncio.timeout(LIMIT_S):
        await bobs.reader.readuntil(b"event: test")
    await bobs.hang_up()
    gate.open.set()
    run = (await bench.client.get(location, params={"wait": LIMIT_S}, headers=bearer(bob))).json()
    assert run["state"] == "finished"


async def test_a_start_that_waits_is_answered_and_the_run_goes_on(bench: Bench) -> None:
    desk = bench.application.key_service
    ann = f"Authorization: Bearer {(await desk.add('Ann', Role.OPERATOR, TEST))[0]}"
    bob = bearer((await desk.add("Bob", Role.OPERATOR, TEST))[0])
    bench.robot.before_move = gate = Gate(at_move=2)
    start = await RawRequest.send(bench, f"POST /calibrate?wait=3600\n{ann}\nConnection: close", b"{}")
    await gate.reached.wait()
    await desk.revoke("Ann", TEST)
    assert b" 401 " in (await rest_of(start)).splitlines()[0]
    gate.open.set()
    (run,) = (await bench.client.get("/runs", headers=bob)).json()["runs"]
    over = await bench.client.get(f"/runs/{run['id']}", params={"wait": LIMIT_S}, headers=bob)
    assert over.json()["state"] == "finished"


async def test_streams_from_before_the_first_key_end(bench: Bench) -> None:
    stream = await RawRequest.send(bench, "GET /events\nConnection: close")
    assert b" 200 " in await stream.reader.readline()
    await bench.application.key_service.add("Ann", Role.ADMIN, TEST)
    assert (await rest_of(stream)).endswith(b"0\r\n\r\n")

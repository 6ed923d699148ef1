"""What the tests' own clock counts."""

import asyncio
import time

from tests.support.patience import MAX_TURN_S


async def test_no_limit_passes_while_the_loop_is_kept_from_running() -> None:
    before_s = time.monotonic()
    async with asyncio.timeout(0.5):
        time.sleep(1.0)  # noqa: ASYNC251 - as a machine that gives the process no processor
        await asyncio.sleep(0.1)
    assert time.monotonic() - before_s < 0.5


async def test_a_limit_passes_in_a_loop_that_waits() -> None:
    began_s, before_s = time.perf_counter(), time.monotonic()
    await asyncio.sleep(3 * MAX_TURN_S)
    passed_s = time.monotonic() - before_s
    assert 3 * MAX_TURN_S <= passed_s <= time.perf_counter() - began_s


def test_without_a_loop_time_is_the_machines() -> None:
    began_s, before_s = time.perf_counter(), time.monotonic()
    time.sleep(2 * MAX_TURN_S)
    assert 2 * MAX_TURN_S <= time.monotonic() - before_s <= time.perf_counter() - began_s

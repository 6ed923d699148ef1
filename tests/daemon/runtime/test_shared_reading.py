"""One reading serves all who ask at the same time, and is begun after each of them asked."""

import asyncio

import pytest

from daemon.runtime.shared_reading import SharedReading


class Source:
    """Counts its readings; each ends when `allowed` is set."""

    def __init__(self) -> None:
        self.begun = 0
        self.allowed = asyncio.Event()

    async def __call__(self) -> int:
        self.begun += 1
        number = self.begun
        await self.allowed.wait()
        return number


async def settle() -> None:
    for _ in range(5):
        await asyncio.sleep(0)


async def test_a_thousand_who_ask_during_a_reading_share_the_next() -> None:
    source = Source()
    shared = SharedReading(source)
    first = asyncio.create_task(shared.read())
    await settle()
    others = [asyncio.create_task(shared.read()) for _ in range(1000)]
    await settle()
    assert source.begun == 1
    source.allowed.set()
    assert await first == 1
    assert set(await asyncio.gather(*others)) == {2}
    assert await shared.read() == 3


async def test_a_caller_that_is_cancelled_ends_no_reading() -> None:
    source = Source()
    shared = SharedReading(source)
    gone, stays = asyncio.create_task(shared.read()), asyncio.create_task(shared.read())
    await settle()
    gone.cancel()
    await settle()
    source.allowed.set()
    assert await stays == 1


async def test_an_error_reaches_all_and_the_next_reading_is_begun_anew() -> None:
    answers = [OSError("gone"), 7]

    async def source() -> int:
        answer = answers.pop(0)
        if isinstance(answer, OSError):
            raise answer
        return answer

    shared = SharedReading(source)
    both = await asyncio.gather(shared.read(), shared.read(), return_exceptions=True)
    assert all(isinstance(error, OSError) for error in both)
    assert await shared.read() == 7


async def test_a_reading_whose_every_caller_left_is_no_trouble() -> None:
    shared = SharedReading(Source())
    asking = asyncio.create_task(shared.read())
    await settle()
    asking.cancel()
    with pytest.raises(asyncio.CancelledError):
        await asking

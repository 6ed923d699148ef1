"""Two serial ports joined by a cable, made of two pseudo terminals."""

import asyncio
import os
import tty
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress


@asynccontextmanager
async def cable() -> AsyncIterator[tuple[str, str]]:
    """The paths of both ends; what is written to one can be read from the other."""
    loop = asyncio.get_running_loop()
    ends = [os.openpty(), os.openpty()]
    for master, slave in ends:
        tty.setraw(slave)
        os.set_blocking(master, False)
    (a, _), (b, _) = ends
    for here, there in ((a, b), (b, a)):
        loop.add_reader(here, _pass_on, here, there)
    try:
        yield os.ttyname(ends[0][1]), os.ttyname(ends[1][1])
    finally:
        for master, slave in ends:
            loop.remove_reader(master)
            os.close(slave)
            os.close(master)


def _pass_on(here: int, there: int) -> None:
    with suppress(OSError):
        os.write(there, os.read(here, 4096))

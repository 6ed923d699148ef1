"""Freed memory goes back to the system: asked for in a thread, again and again, until the service stops."""

import asyncio
import threading
from pathlib import Path

import numpy as np

from daemon.runtime.memory_trim import MemoryTrim
from tests.support.waiting import LIMIT_S


def resident_pages() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1])


async def test_it_trims_in_a_thread_until_it_is_stopped() -> None:
    threads: list[int] = []
    twice = asyncio.Event()
    loop = asyncio.get_running_loop()

    def trim(pad: int) -> int:
        assert pad == 0
        threads.append(threading.get_ident())
        if len(threads) == 2:
            loop.call_soon_threadsafe(twice.set)
        return 1

    service = MemoryTrim(trim, period_s=0.001)
    await service.start()
    await asyncio.wait_for(twice.wait(), LIMIT_S)
    await service.stop()
    assert threading.get_ident() not in threads
    assert service._task is not None
    assert service._task.done()


def test_freed_blocks_leave_the_process() -> None:
    trim = MemoryTrim()._trim
    assert trim is not None
    trim(0)
    blocks = [np.ones(10_000) for _ in range(2000)]  # 160 MB in pieces that come from the heap
    kept, full = blocks[::200], resident_pages()
    del blocks
    trim(0)
    assert full - resident_pages() > 30_000
    assert len(kept) == 10

"""Worker threads for computations that would block the event loop: detection, solving, encoding, merging."""

import asyncio
import os
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import BinaryIO, ParamSpec, TypeVar

from daemon.errors import WorkersBusy
from daemon.runtime.clock import Clock

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")

THREADS = 2
"""Two, so that a long job does not delay the next; numpy and OpenCV use threads of their own."""

MAX_WAITING = 4
"""Jobs that may wait in a pool when `run_if_free` is called."""


class Workers:
    """A pool of threads that knows how long its oldest job has been running, to detect one that hangs.

    A job whose caller is cancelled before the job has begun is dropped.
    """

    def __init__(self, clock: Clock, threads: int = THREADS, niceness: int = 0) -> None:
        """`niceness` is of these threads alone: the rest of the process goes before them."""
        self._clock, self._max_jobs = clock, threads + MAX_WAITING
        self._threads = ThreadPoolExecutor(threads, "worker", _be_nice, (niceness,))
        self._began_s: dict[int, float] = {}
        self._waiting: set[int] = set()
        self._jobs = 0

    async def run(self, work: Callable[Arguments, Answer], *args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
        """Run `work` in a thread; returns its result or raises its exception."""
        self._jobs += 1
        job = self._jobs

        def run_timed() -> Answer:
            self._began_s[job] = self._clock.monotonic_s()
            self._waiting.discard(job)
            try:
                return work(*args, **kwargs)
            finally:
                del self._began_s[job]

        self._waiting.add(job)
        try:
            return await asyncio.get_running_loop().run_in_executor(self._threads, run_timed)
        finally:
            self._waiting.discard(job)

    async def run_if_free(
        self, work: Callable[Arguments, Answer], *args: Arguments.args, **kwargs: Arguments.kwargs
    ) -> Answer:
        """Like `run`; raises WorkersBusy when MAX_WAITING jobs wait already."""
        if len(self._began_s) + len(self._waiting) >= self._max_jobs:
            raise WorkersBusy(MAX_WAITING)
        return await self.run(work, *args, **kwargs)

    @asynccontextmanager
    async def opened(self, open_file: Callable[[Path], BinaryIO], path: Path) -> AsyncIterator[BinaryIO]:
        """The file that `open_file` opens in a thread. It is closed when the block ends, or the wait for it does."""
        files: list[BinaryIO] = []
        left = False

        def open_unless_left() -> BinaryIO:
            file = open_file(path)
            files.append(file)
            if left:
                file.close()
            return file

        try:
            yield await self.run(open_unless_left)
        finally:
            left = True
            for file in files:
                file.close()

    def oldest_job_s(self) -> float:
        """Seconds since the oldest running job began; 0 without one."""
        now_s = self._clock.monotonic_s()
        return now_s - min(list(self._began_s.values()), default=now_s)

    def close(self) -> None:
        """Accept no new jobs and cancel the queued ones; does not wait for the running ones."""
        self._threads.shutdown(wait=False, cancel_futures=True)


def _be_nice(niceness: int) -> None:
    """Lower the priority of this thread, as Linux's nice(2) does; where a sandbox forbids that, it stays."""
    if niceness:
        with suppress(PermissionError):
            os.nice(niceness)

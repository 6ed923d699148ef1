"""Threads for work that would hold up the event loop: detection, solving, encoding, merging."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import ParamSpec, TypeVar

from daemon.runtime.clock import Clock

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")

THREADS = 2
"""One job may take long without holding up the next; numpy and OpenCV bring threads of their own."""


class Workers:
    """A few threads that know since when their oldest job runs, so that a hung one is noticed."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._threads = ThreadPoolExecutor(THREADS, thread_name_prefix="worker")
        self._began_s: dict[int, float] = {}
        self._jobs = 0

    async def run(self, work: Callable[Arguments, Answer], *args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
        """The answer of `work`, which runs in a thread; what it raises is raised here."""
        self._jobs += 1
        job = self._jobs

        def timed() -> Answer:
            self._began_s[job] = self._clock.monotonic_s()
            try:
                return work(*args, **kwargs)
            finally:
                del self._began_s[job]

        return await asyncio.get_running_loop().run_in_executor(self._threads, timed)

    def oldest_job_s(self) -> float:
        """How long the longest job has been at work; 0 when none is."""
        now_s = self._clock.monotonic_s()
        return now_s - min(list(self._began_s.values()), default=now_s)

    def close(self) -> None:
        """Let nothing new begin; what runs is left to end by itself."""
        self._threads.shutdown(wait=False, cancel_futures=True)

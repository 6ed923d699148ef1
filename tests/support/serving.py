"""The daemon's server around an application that a test has built."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass

from daemon.api.extension import Extensions
from daemon.application import Application
from daemon.http.connection_limiter import ConnectionLimiter
from daemon.server import Server
from extensions.installed import INSTALLED
from tests.support.waiting import LIMIT_S


@dataclass(frozen=True, eq=False)
class Served:
    """`task` ends with the server."""

    server: Server
    url: str
    task: "asyncio.Task[None]"


@asynccontextmanager
async def serve_for_tests(
    application: Application, limiter: ConnectionLimiter | None = None, *, extensions: Extensions = INSTALLED
) -> AsyncIterator[Served]:
    """The server, up at its URL; stopped in order afterwards. Raises what ends it before."""
    announced: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    server = Server(application, announced.set_result, limiter, extensions=extensions)
    task = asyncio.create_task(server.listen())
    try:
        await asyncio.wait([announced, task], return_when=asyncio.FIRST_COMPLETED, timeout=LIMIT_S)
        if task.done():
            await task
        yield Served(server, announced.result(), task)
    finally:
        server.should_exit = True
        application.begin_stop("the end of the test")
        await task

"""Begins an abort before anything else is done with its request: the arm does not wait for the store."""

import asyncio
import re
from collections.abc import Awaitable

from fastapi import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from daemon.application import Application
from daemon.model.records import RunRecord

ABORT_PATH = re.compile(r"/runs/([^/]{1,64})/abort")


class AbortFirst:
    """Starts the abort of an authorised POST /runs/{id}/abort, whose outcome the route answers; see `abort_of`.

    A repetition with an Idempotency-Key is a second abort, which has no effect, and receives the first answer.
    """

    def __init__(self, app: ASGIApp, application: Application) -> None:
        self._app, self._application = app, application

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        path = ABORT_PATH.fullmatch(scope["path"]) if scope["type"] == "http" and scope["method"] == "POST" else None
        if path is not None:
            supervisor = self._application.supervisor
            abort = asyncio.create_task(supervisor.abort(path[1], "a request over REST"), name=f"aborts {path[1]}")
            abort.add_done_callback(_retrieve)
            scope["state"]["abort"] = abort
        await self._app(scope, receive, send)


def abort_of(request: Request) -> Awaitable[RunRecord]:
    """The aborted run. Raises RunOver, StopUnconfirmed, NotFound."""
    abort: asyncio.Task[RunRecord] = request.scope["state"]["abort"]
    return asyncio.shield(abort)


def _retrieve(abort: "asyncio.Task[RunRecord]") -> None:
    """Retrieve an error that no route asks for, so that asyncio does not log it."""
    if not abort.cancelled():
        abort.exception()

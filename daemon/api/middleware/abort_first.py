"""Begins an abort before anything else is done with its request: the arm does not wait for the store."""

import asyncio
import re
from collections.abc import Awaitable

from fastapi import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from calibration.sentences.sentence import Sentence
from daemon.application import Application
from daemon.http.connections import PACING
from daemon.model.records import RunRecord
from drivers.timing import retrieve_error

ABORT_PATH = re.compile(r"/runs/([^/]{1,64})/abort")


class AbortFirst:
    """Starts the abort of an authorised POST /runs/{id}/abort, whose outcome the route answers; see `abort_of`.

    While a run is being aborted other requests do not begin, for half a second at most: the telegrams to the controller
    take several turns of the event loop, which are short then.

    A repetition with an Idempotency-Key is a second abort, which has no effect, and receives the first answer.
    """

    def __init__(self, app: ASGIApp, application: Application) -> None:
        self._app, self._application = app, application

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        path = ABORT_PATH.fullmatch(scope["path"]) if scope["method"] == "POST" else None
        if path is not None:
            supervisor, pacing = self._application.supervisor, scope["state"].get(PACING)
            run = supervisor.in_progress
            ending = supervisor.abort(path[1], Sentence("by-rest"))
            abort = asyncio.create_task(ending, name=f"aborts {path[1]}")
            abort.add_done_callback(retrieve_error)
            if run is not None and run.id == path[1] and pacing is not None:
                pacing.hold()
                abort.add_done_callback(lambda _: pacing.release())
            scope["state"]["abort"] = abort
        await self._app(scope, receive, send)


def abort_of(request: Request) -> Awaitable[RunRecord]:
    """The aborted run. Raises RunOver, StopUnconfirmed, NotFound."""
    abort: asyncio.Task[RunRecord] = request.scope["state"]["abort"]
    return asyncio.shield(abort)

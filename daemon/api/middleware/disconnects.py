"""Ends the work for a request whose client has disconnected, whose key has ended, or that outlasts the daemon.

A GET is cancelled as a whole, with the reading, computation or wait it is in. Other methods change something, and are
carried out; only the waits among them end (`Client.until_disconnected`).
"""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Any

from starlette.requests import ClientDisconnect, Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from daemon.access.errors import KeyMissing
from daemon.api.problems import answer, problem_of
from daemon.application import Application
from daemon.errors import DaemonError, Stopping
from daemon.model.records import RunRecord

WATCH_AFTER_S = 0.05
"""Most requests are answered earlier, and need no task that listens for the disconnect."""


class Disconnects:
    """Cancels reading requests of clients that have disconnected, and raises ClientDisconnect.

    When the key ends, an answer that has not begun is 401, and an event stream ends; a file is sent to its end.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        reads = scope["method"] == "GET"  # HEAD comes as GET
        client = Client(receive, send, discards_body=reads)
        scope.setdefault("state", {})["connection"] = client
        try:
            if reads:
                async with client.until_disconnected():
                    await self._app(scope, client.receive, client.send)
            else:
                await self._app(scope, client.receive, client.send)
        except KeyMissing as error:
            await client.refuse(scope, error)
        except asyncio.CancelledError:  # at shutdown the server cancels what is still not answered
            if client.begun:
                raise
            await client.refuse(scope, Stopping())
        finally:
            client.close()


class Client:
    """The client of one request: passes messages on, and notices its disconnect once the body is read.

    The work for it ends with its disconnect, or with `end`.

    `discards_body`: the body is not used, and is read to notice the disconnect.
    """

    def __init__(self, receive: Receive, send: Send, *, discards_body: bool = False) -> None:
        self._receive, self._send = receive, send
        self._discards_body = discards_body
        self._receiving = self._body_read = self._answered = False
        self.begun = self._sized = False
        self._end: ClientDisconnect | KeyMissing | None = None
        self._gone = asyncio.Event()
        self._listener: asyncio.Task[None] | None = None
        self._worker: asyncio.Task[None] | None = None

    async def receive(self) -> Message:
        """The next part of the body; after its end http.disconnect, when the client disconnects."""
        if self._body_read or self._listener is not None:
            self._listen()
            await self._gone.wait()
            return {"type": "http.disconnect"}
        self._receiving = True
        try:
            message = await self._receive()
        finally:
            self._receiving = False
        self._body_read = not message.get("more_body", False)
        if message["type"] == "http.disconnect":
            self._finish(ClientDisconnect())
        return message

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.begun = True
            self._sized = any(name.lower() == b"content-length" for name, _ in message.get("headers", ()))
        elif not message.get("more_body", False):
            self._answered = True  # the server reports a disconnect then, too
        await self._send(message)

    @asynccontextmanager
    async def until_disconnected(self) -> AsyncIterator[None]:
        """Cancel the block when the client disconnects or its key ends; raises ClientDisconnect or KeyMissing."""
        if self._worker is not None:
            yield  # within such a block
            return
        if self._end is not None:
            raise self._end
        task = self._worker = asyncio.current_task()
        assert task is not None
        timer = asyncio.get_running_loop().call_later(WATCH_AFTER_S, self._listen)
        try:
            yield
        except asyncio.CancelledError:
            self._raise_end_of(task)
            raise
        finally:
            self._worker = None
            timer.cancel()

    def _raise_end_of(self, task: "asyncio.Task[Any]") -> None:
        """Raise why the cancelled task has ended; no variable keeps the error, whose traceback refers to its frame."""
        if self._end is not None and task.uncancel() == 0:
            raise self._end from None

    def end(self, reason: KeyMissing) -> None:
        """End the work because the key has ended, unless a file is being sent."""
        if not self._sized:
            self._finish(reason)

    async def refuse(self, scope: Scope, error: DaemonError) -> None:
        """Answer why the work has ended, or end the event stream."""
        if self.begun:
            await self.send({"type": "http.response.body", "body": b"", "more_body": False})
        else:
            await answer(problem_of(error), {"Connection": "close"})(scope, self.receive, self.send)

    def close(self) -> None:
        """Listen no more. Listener and error are let go of, since their tracebacks refer to this client."""
        listener, self._listener, self._end = self._listener, None, None
        if listener is not None:
            listener.cancel()

    def _listen(self) -> None:
        """Listen for the disconnect, unless the body is still being read by the request."""
        if self._listener is None and not self._receiving and (self._body_read or self._discards_body):
            self._listener = asyncio.create_task(self._await_disconnect())

    async def _await_disconnect(self) -> None:
        with suppress(DaemonError):  # a discarded body that is too large
            while (await self._receive())["type"] != "http.disconnect":
                pass
        self._finish(ClientDisconnect())

    def _finish(self, reason: ClientDisconnect | KeyMissing) -> None:
        self._gone.set()
        if self._end is not None or self._answered:
            return
        self._end = reason
        if self._worker is not None:
            self._worker.cancel()


def client_of(request: Request) -> Client:
    client: Client = request.scope["state"]["connection"]
    return client


async def wait_for_run(request: Request, app: Application, run_id: str, wait: float) -> RunRecord:
    """The run when it is over, or as it stands after `wait` seconds, or when the client of a POST has disconnected."""
    with suppress(ClientDisconnect):
        async with client_of(request).until_disconnected():
            return await app.supervisor.wait(run_id, wait)
    return await app.supervisor.run(run_id)

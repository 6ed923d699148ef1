"""Transform a cloud while it is streamed from the request into the response.

Starlette's StreamingResponse over request.stream() does not work here: under uvicorn (ASGI 2.3) its listener for a
disconnect consumes messages of the body, and the answer is truncated with status 200.
"""

import asyncio
import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from daemon.api.http_errors import BodyTooLarge
from daemon.api.problems import answer, problem_of
from daemon.api.streaming.request_body import body_chunks, lend_body
from daemon.api.streaming.spool import Spool
from daemon.errors import StorageError
from registration.errors import CloudTooLong, CloudTruncated, RegistrationError
from registration.io.formats.ply import with_frame
from registration.io.stream import CloudStream

log = logging.getLogger(__name__)

OnComplete = Callable[[CloudStream, int], None]
"""Called with the stream and the bytes of the answer when a cloud is complete."""

MAX_SMALL_BODY_BYTES = 1_000_000
"""A body up to this size is read completely before the answer begins, so that errors are answered as problems."""

REFUSALS = (RegistrationError, StorageError, BodyTooLarge)


@dataclass
class StreamedCloud:
    """One cloud in transit."""

    stream: CloudStream
    spool: Spool
    content_length: int | None
    calibration_id: str
    _head_sent: bool = field(default=False, init=False)

    async def receive(self, receive: Receive, ready: asyncio.Event, done: OnComplete) -> None:
        """Transform the body into the spool; set `ready` for the answer to begin. Raises REFUSALS, ClientDisconnect."""
        size, is_small = 0, self.content_length is not None and self.content_length <= MAX_SMALL_BODY_BYTES
        try:
            async for chunk in body_chunks(receive):
                size += await self._put(self.stream.parts(chunk))
                if size and self.stream.in_range and not ready.is_set() and not is_small:
                    self._check_length()
                    ready.set()
            size += await self._put(self.stream.last_parts())
            done(self.stream, size)
        finally:
            self.spool.end()
            ready.set()

    async def _put(self, parts: Iterator[bytes | memoryview]) -> int:
        """Put the transformed parts, with the header changed, into the spool; returns the number of bytes."""
        size = 0
        for moved in parts:
            part = moved
            if self.stream.header is not None and not self._head_sent:
                part, self._head_sent = self._head(), True
            await self.spool.put(part)
            size += len(part)
        return size

    def _head(self) -> bytes:
        """The header of the answer; in a PLY, comments that name another frame are replaced."""
        header = self.stream.header
        assert header is not None
        return with_frame(header.rewritten, self.calibration_id) if header.format == "ply" else header.rewritten

    def answer_length(self) -> int | None:
        """Length of the answer in bytes, if the header determines it."""
        header = self.stream.header
        if header is None:
            return None
        if header.format == "octets":
            return self.content_length
        return None if header.body_length is None else len(self._head()) + header.body_length

    def _check_length(self) -> None:
        """Raises CloudTruncated or CloudTooLong when Content-Length and the cloud's header disagree."""
        header = self.stream.header
        if header is None or self.content_length is None:
            return
        if header.format == "octets":
            off = -(self.content_length % header.layout.itemsize)
        else:
            off = 0 if header.body_length is None else self.content_length - header.length - header.body_length
        if off < 0 or (off and not header.filler):
            kind = CloudTruncated if off < 0 else CloudTooLong
            what = f"Content-Length is {abs(off)} bytes too {'short' if off < 0 else 'long'} for a whole cloud"
            raise kind("request body", "header", what, "send the whole cloud, and nothing after it")


class CloudResponse(Response):
    """Answers the transformed cloud. An error before the answer begins is a problem; later the answer is cut off."""

    def __init__(
        self, stream: CloudStream, media_type: str, headers: dict[str, str], folder: Path, done: OnComplete
    ) -> None:
        """`folder`: for a temporary file with the answer to a client that does not read while it sends."""
        super().__init__(media_type=media_type)
        self._stream, self._folder, self._done = stream, folder, done
        self._every_header = {**headers, "Content-Type": media_type}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Receive and send concurrently, each at its own pace."""
        lend_body(scope)
        spool = Spool(self._folder)
        given = dict(scope["headers"]).get(b"content-length", b"").decode("latin-1")
        length = int(given) if given.isdigit() else None
        passage = StreamedCloud(self._stream, spool, length, self._every_header.get("Handeyed-Calibration", ""))
        ready = asyncio.Event()
        taking = asyncio.create_task(passage.receive(receive, ready, self._done))
        try:
            await ready.wait()
            error = taking.exception() if taking.done() else None
            if error is None:
                await self._start(passage, send, whole=taking.done())
                # A task of its own avoids resuming through the whole chain of middleware for each chunk.
                await asyncio.create_task(self._send(spool, taking, send))
            elif isinstance(error, REFUSALS):
                await answer(problem_of(error), {"Connection": "close"})(scope, receive, send)
            elif not isinstance(error, ClientDisconnect):
                raise error
        finally:
            taking.cancel()
            await asyncio.gather(taking, return_exceptions=True)
            spool.close()

    async def _start(self, passage: StreamedCloud, send: Send, *, whole: bool) -> None:
        headers = dict(self._every_header)
        if whole and self._stream.points == self._stream.non_finite:
            headers["Handeyed-Warning"] = ", ".join(filter(None, [headers.get("Handeyed-Warning"), "no-points"]))
        if (length := passage.answer_length()) is not None:
            headers["Content-Length"] = str(length)
        pairs = [(name.lower().encode(), value.encode()) for name, value in headers.items()]
        await send({"type": "http.response.start", "status": 200, "headers": pairs})

    async def _send(self, spool: Spool, taking: asyncio.Task[None], send: Send) -> None:
        """Send the spooled bytes; and the end only for a complete cloud, so that clients detect a truncated one."""
        while content := await spool.get():
            await send({"type": "http.response.body", "body": content, "more_body": True})
        try:
            await taking
        except (*REFUSALS, ClientDisconnect) as error:
            log.warning("a streamed cloud was cut off: %s", error or "the client disconnected")
            return
        await send({"type": "http.response.body", "body": b"", "more_body": False})

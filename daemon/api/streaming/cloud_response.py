"""A cloud moved while it passes by: request body in, answer out, both streamed.

Not Starlette's StreamingResponse over request.stream(): under uvicorn (ASGI 2.3) its listener for a disconnect takes
messages of the body away, and the answer is cut short with status 200.
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
from daemon.api.streaming.request_body import body_chunks
from daemon.api.streaming.spool import Spool
from daemon.errors import StorageError
from registration.errors import CloudTooLong, CloudTruncated, RegistrationError
from registration.io.formats.ply import with_frame
from registration.io.stream import CloudStream

log = logging.getLogger(__name__)

OnComplete = Callable[[CloudStream, int], None]
"""Told of a cloud that passed whole, and its answer's bytes."""

MAX_SMALL_BODY_BYTES = 1_000_000
"""A body up to this is looked at to its end before the answer begins: what is wrong with it is told as a problem."""

REFUSALS = (RegistrationError, StorageError, BodyTooLarge)


@dataclass
class StreamedCloud:
    """One cloud on its way through."""

    stream: CloudStream
    spool: Spool
    content_length: int | None
    calibration_id: str
    _head_sent: bool = field(default=False, init=False)

    async def receive(self, receive: Receive, ready: asyncio.Event, done: OnComplete) -> None:
        """Move what comes in; `ready` is set when the answer may begin. Raises the REFUSALS, ClientDisconnect."""
        size = 0
        try:
            async for chunk in body_chunks(receive):
                size += await self._put(self.stream.parts(chunk))
                if size and not ready.is_set() and not self._is_small:
                    self._check_length()
                    ready.set()
            size += await self._put(self.stream.last_parts())
            done(self.stream, size)
        finally:
            self.spool.end()
            ready.set()

    async def _put(self, parts: Iterator[bytes | memoryview]) -> int:
        """The moved parts, the header with the frame's name in it; answers how many bytes."""
        size = 0
        for moved in parts:
            part = moved
            if self.stream.header is not None and not self._head_sent:
                part, self._head_sent = self._head(), True
            await self.spool.put(part)
            size += len(part)
        return size

    def _head(self) -> bytes:
        """The cloud's header as it is answered: a PLY's older comments may name another frame."""
        header = self.stream.header
        assert header is not None
        return with_frame(header.rewritten, self.calibration_id) if header.format == "ply" else header.rewritten

    @property
    def _is_small(self) -> bool:
        return self.content_length is not None and self.content_length <= MAX_SMALL_BODY_BYTES

    def answer_length(self) -> int | None:
        """Bytes of the answer, where the header tells."""
        header = self.stream.header
        if header is None:
            return None
        if header.format == "octets":
            return self.content_length
        return None if header.body_length is None else len(self._head()) + header.body_length

    def _check_length(self) -> None:
        """Content-Length and the cloud's own header agree, as far as both tell: better said now than at the end."""
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
    """Answers the moved cloud. What is wrong before the answer begins is a problem; later the answer is cut off."""

    def __init__(
        self, stream: CloudStream, media_type: str, headers: dict[str, str], folder: Path, done: OnComplete
    ) -> None:
        """`folder`: where a temporary file may hold the answer of a client that does not read while it sends."""
        super().__init__(media_type=media_type)
        self._stream, self._folder, self._done = stream, folder, done
        self._every_header = {**headers, "Content-Type": media_type}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Receives and sends at the same time, each at its own pace."""
        spool = Spool(self._folder)
        passage = StreamedCloud(
            self._stream, spool, _content_length(scope), self._every_header.get("Handeyed-Calibration", "")
        )
        ready = asyncio.Event()
        taking = asyncio.create_task(passage.receive(receive, ready, self._done))
        try:
            await ready.wait()
            error = taking.exception() if taking.done() else None
            if error is None:
                await self._start(passage, send)
                # A task of its own: resumed through the whole chain of middlewares, each piece would cost more.
                await asyncio.create_task(self._send(spool, taking, send))
            elif isinstance(error, REFUSALS):
                await answer(problem_of(error), {"Connection": "close"})(scope, receive, send)
            elif not isinstance(error, ClientDisconnect):
                raise error
        finally:
            taking.cancel()
            await asyncio.gather(taking, return_exceptions=True)
            spool.close()

    async def _start(self, passage: StreamedCloud, send: Send) -> None:
        headers = dict(self._every_header)
        if (length := passage.answer_length()) is not None:
            headers["Content-Length"] = str(length)
        pairs = [(name.lower().encode(), value.encode()) for name, value in headers.items()]
        await send({"type": "http.response.start", "status": 200, "headers": pairs})

    async def _send(self, spool: Spool, taking: asyncio.Task[None], send: Send) -> None:
        """Everything; and the end only when the cloud was whole, for an answer without it is an error to any client."""
        while content := await spool.get():
            await send({"type": "http.response.body", "body": content, "more_body": True})
        try:
            await taking
        except (*REFUSALS, ClientDisconnect) as error:
            log.warning("a cloud was cut off on its way through: %s", error or "the client went away")
            return
        await send({"type": "http.response.body", "body": b"", "more_body": False})


def _content_length(scope: Scope) -> int | None:
    value = dict(scope["headers"]).get(b"content-length", b"").decode("latin-1")
    return int(value) if value.isdigit() else None

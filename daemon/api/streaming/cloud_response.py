"""Transform a cloud while it is streamed from the request into the response.

Starlette's StreamingResponse over request.stream() does not work here: under uvicorn (ASGI 2.3) its listener for a
disconnect consumes messages of the body, and the answer is truncated with status 200.
"""

import asyncio
import logging
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import aclosing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from fastapi.responses import FileResponse
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from daemon.api.http_errors import BodyTooLarge
from daemon.api.problems import answer, problem_of
from daemon.api.streaming.request_body import body_chunks, lend_body
from daemon.api.streaming.spool import MAX_READER_WAIT_S, AwaitedSpool
from daemon.errors import StorageError
from daemon.http.connections import TAKE_SOCKET
from daemon.http.taken_socket import READ, WRITE, TakenSocket
from registration.errors import CloudTooLong, CloudTruncated, RegistrationError
from registration.io.formats.ply import with_frame
from registration.io.stream import CloudStream

log = logging.getLogger(__name__)

OnComplete = Callable[[CloudStream, int], None]
"""Called with the stream and the bytes of the answer when a cloud is complete."""

MAX_SMALL_BODY_BYTES = 1_000_000
"""A body up to this size is read completely before the answer begins, so that errors are answered as problems."""

PIECE_BYTES = 1 << 19
"""Received, moved and sent at once by a thread; with pieces of 256 kB a cloud takes a tenth more processor time."""

REFUSALS = (RegistrationError, StorageError, BodyTooLarge)


@dataclass
class StreamedCloud:
    """One cloud in transit."""

    stream: CloudStream
    spool: AwaitedSpool
    content_length: int | None
    calibration_id: str
    complete: bool = field(default=False, init=False)
    size: int = field(default=0, init=False)
    _head_sent: bool = field(default=False, init=False)

    async def begin(self, chunks: AsyncIterator[bytes | memoryview]) -> None:
        """Transform chunks into the spool until the answer may begin. Raises REFUSALS, ClientDisconnect."""
        is_small = self.content_length is not None and self.content_length <= MAX_SMALL_BODY_BYTES
        async for chunk in chunks:
            await self._put(self.stream.parts(chunk))
            if self.size and self.stream.in_range and not is_small:
                self._check_length()
                return
        await self._put(self.stream.last_parts())
        self.complete = True
        self.spool.end()

    async def receive(self, chunks: AsyncIterator[bytes | memoryview]) -> None:
        """Transform the rest of the chunks into the spool. Raises REFUSALS, ClientDisconnect."""
        try:
            async for chunk in chunks:
                await self._put(self.stream.parts(chunk))
            await self._put(self.stream.last_parts())
            self.complete = True
        finally:
            self.spool.end()

    def exchange(self, taken: TakenSocket) -> None:
        """Receive the rest and send the answer, in a thread. Raises REFUSALS, ClientDisconnect."""
        assert self.stream.header is not None  # the answer has begun
        record_bytes = min(self.stream.header.layout.itemsize, PIECE_BYTES)
        room, unsent = memoryview(bytearray(PIECE_BYTES)), memoryview(taken.head)
        while True:
            while unsent or (unsent := memoryview(self.spool.take())):
                if not (sent := taken.send(unsent)):
                    break
                unsent = unsent[sent:] or memoryview(b"")  # its memory is the next piece's
            if self.complete and not unsent:
                return
            whole = PIECE_BYTES - (PIECE_BYTES - taken.body_left) % record_bytes  # a cut record is moved by itself
            full = not self.spool.in_file and not self.spool.fits(PIECE_BYTES)
            if self.complete:
                taken.wait(WRITE)
            elif unsent and full and taken.wait(WRITE, MAX_READER_WAIT_S):
                continue  # the client reads, if later than it sends: no file is needed
            elif received := taken.receive_into(room[:whole]):
                for part in self._answered(self.stream.parts(room[:received])):
                    self.spool.append(part)
                if not taken.body_left:
                    for part in self._answered(self.stream.last_parts()):
                        self.spool.append(part)
                    self.complete = True
            else:
                taken.wait(READ | WRITE if unsent else READ)

    async def _put(self, parts: Iterator[bytes | memoryview]) -> None:
        for part in self._answered(parts):
            await self.spool.put(part)

    def _answered(self, parts: Iterator[bytes | memoryview]) -> Iterator[bytes | memoryview]:
        """The transformed parts, with the header changed; counted in `size`."""
        for moved in parts:
            part = moved
            if self.stream.header is not None and not self._head_sent:
                part, self._head_sent = self._head(), True
            self.size += len(part)
            yield part

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
        given = dict(scope["headers"]).get(b"content-length", b"").decode("latin-1")
        length = int(given) if given.isdigit() else None
        spool = AwaitedSpool(self._folder)
        passage = StreamedCloud(self._stream, spool, length, self._every_header.get("Handeyed-Calibration", ""))
        begun = False
        try:
            async with aclosing(body_chunks(receive)) as chunks:
                await passage.begin(chunks)
                sized = not passage.complete and passage.answer_length() is not None
                take = scope.get("state", {}).get(TAKE_SOCKET) if sized else None
                taken = take() if take is not None else None
                begun = True
                if taken is not None:
                    await taken.run(self._start(passage, send), passage.exchange)
                else:
                    await self._start(passage, send)
                    lend_body(scope)
                    await self._pass_on(passage, chunks, send)
            self._done(self._stream, passage.size)
            await send({"type": "http.response.body", "body": b"", "more_body": False})
        except (*REFUSALS, ClientDisconnect) as error:
            if begun:  # without the end of the answer, so that clients detect a truncated one
                log.warning("a streamed cloud was cut off: %s", str(error) or "the client disconnected")
            elif not isinstance(error, ClientDisconnect):
                await answer(problem_of(error), {"Connection": "close"})(scope, receive, send)
        finally:
            spool.close()

    async def _start(self, passage: StreamedCloud, send: Send) -> None:
        headers = dict(self._every_header)
        if passage.complete and self._stream.points == self._stream.non_finite:
            headers["Handeyed-Warning"] = ", ".join(filter(None, [headers.get("Handeyed-Warning"), "no-points"]))
        if (length := passage.answer_length()) is not None:
            headers["Content-Length"] = str(length)
        pairs = [(name.lower().encode(), value.encode()) for name, value in headers.items()]
        await send({"type": "http.response.start", "status": 200, "headers": pairs})

    async def _pass_on(self, passage: StreamedCloud, chunks: AsyncIterator[bytes | memoryview], send: Send) -> None:
        """Receive what is left and send the answer but for its end, by tasks of the event loop."""

        async def send_spooled() -> None:
            while content := await passage.spool.get():
                await send({"type": "http.response.body", "body": content, "more_body": True})

        # Tasks of their own avoid resuming through the whole chain of middleware for each chunk.
        sending = asyncio.create_task(send_spooled())
        taking = None if passage.complete else asyncio.create_task(passage.receive(chunks))
        try:
            await sending
            if taking is not None:
                await taking
        finally:
            for task in (sending, taking):
                if task is not None:
                    task.cancel()
            await asyncio.gather(*filter(None, (sending, taking)), return_exceptions=True)


class TemporaryFileResponse(FileResponse):
    """An answer from a file that is deleted afterwards, also when the client disconnects before its end."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            await asyncio.to_thread(partial(Path(self.path).unlink, missing_ok=True))

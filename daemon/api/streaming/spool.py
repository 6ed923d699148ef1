"""A queue of bytes that spills into a temporary file when its reader is slow.

Most HTTP clients send their whole body before they read the answer. Without a spool both ends would wait for each other
as soon as the sockets' buffers are full.
"""

import asyncio
import os
import tempfile
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import IO

from daemon.store.database import storage_errors

MEMORY_BYTES = 4_000_000
"""Bytes kept in memory, for a client that reads while it sends."""

CHUNK_BYTES = 1 << 18

MAX_READER_WAIT_S = 0.05
"""How long to wait for a slow reader before a file is used."""


class Spool:
    """A FIFO queue of bytes: in memory while they fit there, else in a file until that is read to its end."""

    def __init__(self, folder: Path, memory_bytes: int = MEMORY_BYTES) -> None:
        """`folder`: for the temporary file, which may grow as large as the answer."""
        self._folder, self._memory_bytes = folder, memory_bytes
        self._memory: deque[bytes | memoryview] = deque()
        self._in_memory = 0
        self._file: IO[bytes] | None = None
        self._written = self._read = 0

    @property
    def in_file(self) -> bool:
        """Whether bytes wait in the file."""
        return self._read < self._written

    def fits(self, length: int) -> bool:
        """Whether so many more bytes fit into memory."""
        return not self.in_file and self._in_memory + length <= self._memory_bytes

    def append(self, content: bytes | memoryview) -> None:
        """Append `content`, which must not be changed afterwards. Raises StorageError when the file cannot grow."""
        if self.fits(len(content)):
            if content:
                self._memory.append(content)
                self._in_memory += len(content)
        else:
            self._to_file(content)

    def _to_file(self, content: bytes | memoryview) -> None:
        with storage_errors(self._folder):
            if self._file is None:
                self._file = tempfile.TemporaryFile(dir=self._folder, buffering=0)  # noqa: SIM115 - closed by `close`
            rest = memoryview(content)
            while rest:
                rest = rest[os.pwrite(self._file.fileno(), rest, self._written + len(content) - len(rest)) :]
            self._written += len(content)

    def take(self) -> bytes | memoryview:
        """The next bytes, of the file at most CHUNK_BYTES; b"" when the queue is empty. Raises StorageError."""
        if self._memory:
            content = self._memory.popleft()
            self._in_memory -= len(content)
            return content
        if not self.in_file:
            return b""
        assert self._file is not None
        with storage_errors(self._folder):  # by position, since a writer may use the file at the same time
            content = os.pread(self._file.fileno(), min(CHUNK_BYTES, self._written - self._read), self._read)
        self._read += len(content)
        return content

    def close(self) -> None:
        """Close and delete the temporary file."""
        if self._file is not None:
            self._file.close()


class AwaitedSpool(Spool):
    """A spool whose writer and reader are tasks of the event loop."""

    def __init__(self, folder: Path, memory_bytes: int = MEMORY_BYTES) -> None:
        super().__init__(folder, memory_bytes)
        self._ended = False
        self._news, self._space = asyncio.Event(), asyncio.Event()

    async def put(self, content: bytes | memoryview) -> None:
        """Like `append`, but wait up to MAX_READER_WAIT_S for room in memory, and write to the file in a thread."""
        if self.fits(len(content)) or (not self.in_file and await self._fits_soon(len(content))):
            self.append(content)
        else:
            await asyncio.to_thread(self._to_file, content)  # memory is the event loop's
        self._news.set()

    def end(self) -> None:
        self._ended = True
        self._news.set()

    async def get(self) -> bytes | memoryview:
        """The next bytes; b"" at the end of the queue."""
        while True:
            if self._memory:
                self._space.set()
                return self.take()
            if self.in_file:
                return await asyncio.to_thread(self.take)
            if self._ended:
                return b""
            self._news.clear()
            await self._news.wait()

    async def _fits_soon(self, length: int) -> bool:
        """Wait for the reader to free memory; True when `length` bytes fit."""
        with suppress(TimeoutError):
            async with asyncio.timeout(MAX_READER_WAIT_S):
                while length <= self._memory_bytes and not self.fits(length):
                    self._space.clear()
                    await self._space.wait()
        return self.fits(length)

"""Moves a cloud while it is transferred: bytes in, bytes out, same format, bounded memory, no I/O of its own.

    stream = CloudStream.of_body("application/x-ply", base_T_camera, "m")
    for chunk in body:
        send_all(stream.parts(chunk))
    send_all(stream.last_parts())

The header is emitted as soon as it is complete, every point likewise. Output is as long as input for binary clouds, so
Content-Length can be announced. Points with NaN or infinite coordinates are passed through (they stay non-finite)
and counted in `non_finite`. All other columns, and the faces of a PLY file, are unchanged; normals are rotated.
"""

import weakref
from collections import deque
from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from numpy.typing import ArrayLike, NDArray

from registration.errors import CloudTruncated, CloudUnsupported
from registration.io.formats.bodies import BLOCK_BYTES, BodyDecoder, TextEncoder, decoder_of, require_end
from registration.io.formats.detect import HeaderParser, parser_of
from registration.io.formats.header import CloudHeader
from registration.io.formats.sections import SectionPassage
from registration.points.layout import Records
from registration.points.range_check import RangeCheck
from registration.points.rigid_motion import BlockMover, RigidMotion

BODY = "request body"
"""What errors call the cloud."""


class CloudStream:
    """Stream of one cloud. Every method raises RegistrationError's leaves.

    After an error or `last_parts` the stream cannot be used further.
    """

    def __init__(
        self, parser: HeaderParser, motion: RigidMotion, file: str, range_check: RangeCheck | None = None
    ) -> None:
        """`file`: what errors call the cloud; `range_check`: refuses, at its end, one whose unit cannot be."""
        self._parser, self._motion, self._file, self._range = parser, motion, file, range_check
        self._prefix = b""
        self.header: CloudHeader | None = None
        """The parsed header, None until it is complete."""
        self._mover: BlockMover | None = None
        self._encoder: TextEncoder | None = None
        self._free: deque[NDArray[np.uint8]] = deque(maxlen=2)
        """Memory of pieces that nobody holds any more; new memory costs a page fault every 4 kB."""

    @classmethod
    def of_body(
        cls, media_type: str, base_T_camera: ArrayLike, unit: str | None, range_check: RangeCheck | None = None
    ) -> "CloudStream":
        """Of a request's body."""
        return cls(parser_of(media_type, BODY), RigidMotion.of(base_T_camera, unit), BODY, range_check)

    @property
    def in_range(self) -> bool:
        """Whether a point has come that lies where one can be; True of a cloud whose range is not checked."""
        return self._range is None or self._range.sound

    @property
    def points(self) -> int:
        return self._mover.points if self._mover else 0

    @property
    def non_finite(self) -> int:
        """Points with a coordinate that is NaN or infinite so far."""
        return self._mover.non_finite if self._mover else 0

    def parts(self, chunk: bytes | bytearray | memoryview) -> Iterator[bytes | memoryview]:
        """Feed a chunk; the output that is ready, which stays as it is when the chunk is overwritten."""
        data = memoryview(chunk).cast("B")
        if self.header is None and data:
            content = self._prefix + data
            header = self._parser(content, self._file)
            if header is None:
                self._prefix = content
                return
            self._prefix = b""
            yield self._begin(header)
            data = memoryview(content)[header.length :]
        step = BLOCK_BYTES if self._encoder else max(1, len(data))
        for start in range(0, len(data), step):
            yield from self._body(data[start : start + step])

    def last_parts(self) -> Iterator[bytes | memoryview]:
        """End the input; the remaining output. Raises CloudTruncated when something is missing."""
        if self.header is None:
            header = self._parser(b"", self._file) if not self._prefix else None
            if header is None:
                raise CloudTruncated(
                    self._file,
                    "header",
                    f"the data end after {len(self._prefix)} bytes, inside the header",
                    "send or copy the whole cloud again",
                )
            yield self._begin(header)
        self._lead.finish()
        yield from self._moved(self._points.finish(), 0)
        self._tail.finish()
        if self._range is not None:
            self._range.require(self._file)

    def _begin(self, header: CloudHeader) -> bytes:
        if header.encoding == "compressed":
            raise CloudUnsupported(
                self._file,
                "DATA",
                "a compressed PCD cannot be moved as a stream",
                "send it as 'DATA binary', or register the file from disk",
            )
        self.header = header
        self._mover = BlockMover(self._motion, header.layout)
        self._lead = SectionPassage(header.lead, header.encoding, self._file)
        self._points: BodyDecoder = decoder_of(header, self._file)
        self._tail = SectionPassage(header.tail, header.encoding, self._file)
        self._encoder = TextEncoder(header.layout, header.separator or " ") if header.encoding == "text" else None
        return header.rewritten

    def _body(self, data: memoryview) -> Iterator[bytes | memoryview]:
        if not self._lead.complete:
            used = self._lead.take(data)
            yield bytes(data[:used])
            data = data[used:]
        if self._lead.complete and not self._points.complete and data:
            yield from self._moved(self._points.take(data), len(data))
            data = data[self._points.taken :]
        if self._points.complete and not self._tail.complete and data:
            used = self._tail.take(data)
            yield bytes(data[:used])
            data = data[used:]
        if data:
            assert self.header is not None
            require_end(self.header, self._file, self._points.points, data)

    def _moved(self, blocks: Iterator[Records], size: int) -> Iterator[bytes | memoryview]:
        """The moved blocks of `size` bytes: encoded each, or side by side in memory that is theirs until released."""
        assert self._mover is not None and self.header is not None
        end, out = 0, np.empty(0, np.uint8)
        for block in blocks:
            if self._range is not None:
                self._range.look(block, self.header.layout)
            if self._encoder:
                yield self._encoder.encode(self._mover.move(block))
                continue
            if not end:
                room = size + self.header.layout.itemsize
                with suppress(IndexError):  # the memory of a piece may come back at any time, from any thread
                    out = self._free.pop()
                out = out if len(out) >= room else np.empty(room, np.uint8)
            start, end = end, end + block.nbytes
            into = out[start:end].view(block.dtype)
            if self._mover.in_place:
                out[start:end] = block.view(np.uint8)
                self._mover.move(into)
            else:
                self._mover.move(block, into)
        if end:
            moved = out[:end]
            weakref.finalize(moved, self._free.append, out).atexit = False
            yield moved.data

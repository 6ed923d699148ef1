"""Frames of the CB link: a 12-byte header, a payload of at most 1012 bytes, a Fletcher-16 over both."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from protocols.cb.codes import VERSION

MAGIC = b"\x43\x42"
HEADER = struct.Struct("<2sBBHHHH")
HEADER_BYTES = HEADER.size
SUMMED_HEADER_BYTES = 10
PAYLOAD_MAX = 1012  # one frame fits one RAPID rawbytes of 1024


def fletcher16(data: bytes) -> int:
    """Fletcher's checksum modulo 255 (J. G. Fletcher 1982): the sum of sums in the high byte."""
    low = high = 0
    for byte in data:
        low = (low + byte) % 255
        high = (high + low) % 255
    return high << 8 | low


@dataclass(frozen=True)
class Frame:
    """One frame whose checksum held. `command` is the raw number, the reply bit included."""

    command: int
    seq: int
    payload: bytes = b""
    status: int = 0
    version: int = VERSION

    def encode(self) -> bytes:
        """The frame's bytes."""
        head = struct.pack("<2sBBHHH", MAGIC, self.version, self.command, self.seq, self.status, len(self.payload))
        return head + struct.pack("<H", fletcher16(head + self.payload)) + self.payload


@dataclass(frozen=True)
class ChecksumFailed:
    """A whole frame came, but its sum does not hold; nothing in it can be trusted."""

    command: int
    seq: int


@dataclass(frozen=True)
class GarbageSkipped:
    """Bytes that belong to no frame were dropped on the way to the next one."""

    count: int


@dataclass(frozen=True)
class FramingBroken:
    """The stream is no longer frames. On TCP: close the connection."""

    reason: str


ReaderEvent = Frame | ChecksumFailed | GarbageSkipped | FramingBroken


class FrameReader:
    """Bytes in, frames out, however the bytes are cut.

    Strict (TCP): the first thing that is no frame breaks the stream for good. Resynchronising (serial): bytes are
    dropped until a magic with a plausible length and a sum that holds. A false magic can promise a payload that
    never comes: the owner of the clock calls `abandon_half_frame` when bytes stay away.
    """

    def __init__(self, *, resynchronise: bool) -> None:
        self._resynchronise = resynchronise
        self._buffer = bytearray()
        self._broken: FramingBroken | None = None

    @property
    def half_frame_bytes(self) -> int:
        """How many bytes of an unfinished frame wait here."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[ReaderEvent]:
        """Take bytes as they came; return what is complete now."""
        if self._broken is not None:
            return [self._broken]
        self._buffer += data
        return list(self._complete())

    def abandon_half_frame(self) -> list[ReaderEvent]:
        """Bytes stayed away for too long: the half frame is none. Strict breaks, else the search goes on behind it."""
        if self._broken is not None:
            return [self._broken]
        if not self._buffer:
            return []
        if not self._resynchronise:
            return [self._break(f"a frame stopped after {len(self._buffer)} bytes")]
        events: list[ReaderEvent] = []
        while self._buffer:  # behind a false magic another may wait: no byte will come for that one either
            del self._buffer[:1]
            events += self._complete(skipped=1)
        return events

    def _complete(self, skipped: int = 0) -> Iterator[ReaderEvent]:
        while True:
            dropped, fault = self._seek_header()
            if fault and not self._resynchronise:
                yield self._break(fault)
                return
            skipped += dropped
            frame = self._take_frame()
            if frame is None:
                break
            if skipped and isinstance(frame, Frame):
                yield GarbageSkipped(skipped)
                skipped = 0
            yield frame
            if isinstance(frame, ChecksumFailed):
                if not self._resynchronise:
                    yield self._break("the checksum of a frame does not hold")
                    return
                skipped += 1
        if skipped:
            yield GarbageSkipped(skipped)

    def _seek_header(self) -> tuple[int, str]:
        """Drop what cannot begin a frame; return how many bytes that were, and what was wrong with the first."""
        dropped, fault = 0, ""
        while self._buffer:
            wrong = self._fault_at_start()
            if not wrong:
                break
            fault = fault or wrong
            if not self._resynchronise:
                break
            following = self._buffer.find(MAGIC[:1], 1)
            cut = len(self._buffer) if following < 0 else following
            del self._buffer[:cut]
            dropped += cut
        return dropped, fault

    def _fault_at_start(self) -> str:
        """Why the buffer does not begin a frame; empty when it does, as far as its bytes tell."""
        start = bytes(self._buffer[:2])
        if not MAGIC.startswith(start):
            return f"expected the magic 43 42, got {start.hex(' ')}"
        if len(self._buffer) >= SUMMED_HEADER_BYTES:
            promised = int.from_bytes(self._buffer[8:10], "little")
            if promised > PAYLOAD_MAX:
                return f"a payload of {promised} bytes is promised, at most {PAYLOAD_MAX} are allowed"
        return ""

    def _take_frame(self) -> Frame | ChecksumFailed | None:
        """The frame at the buffer's start, or None while it is not whole."""
        if len(self._buffer) < HEADER_BYTES:
            return None
        _, version, command, seq, status, promised, checksum = HEADER.unpack_from(self._buffer)
        end = HEADER_BYTES + promised
        if len(self._buffer) < end:
            return None
        payload = bytes(self._buffer[HEADER_BYTES:end])
        if fletcher16(bytes(self._buffer[:SUMMED_HEADER_BYTES]) + payload) != checksum:
            del self._buffer[:1]  # the length itself may be wrong: a good frame may begin inside
            return ChecksumFailed(command, seq)
        del self._buffer[:end]
        return Frame(command, seq, payload, status, version)

    def _break(self, reason: str) -> FramingBroken:
        self._broken = FramingBroken(reason)
        self._buffer.clear()
        return self._broken

"""Frames of the CB link: a 12-byte header, a payload of at most 1012 bytes, a Fletcher-16 over both."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from protocols.cb.codes import VERSION

MAGIC = b"\x43\x42"
HEADER = struct.Struct("<2sBBHHHH")
HEADER_BYTES = HEADER.size
SUMMED_HEADER_BYTES = 10
MAX_PAYLOAD_BYTES = 1012  # so that a frame fits one RAPID rawbytes of 1024


def fletcher16(data: bytes) -> int:
    """Fletcher's checksum modulo 255 (J. G. Fletcher 1982): the sum of sums in the high byte, the sum in the low."""
    low = high = 0
    for byte in data:
        low = (low + byte) % 255
        high = (high + low) % 255
    return high << 8 | low


@dataclass(frozen=True)
class Frame:
    """A frame whose checksum is right. `command` is the raw byte, including the reply bit."""

    command: int
    seq: int
    payload: bytes = b""
    status: int = 0
    version: int = VERSION

    def encode(self) -> bytes:
        head = struct.pack("<2sBBHHH", MAGIC, self.version, self.command, self.seq, self.status, len(self.payload))
        return head + struct.pack("<H", fletcher16(head + self.payload)) + self.payload


@dataclass(frozen=True)
class ChecksumFailed:
    """A complete frame with a wrong checksum; its content is not to be trusted."""

    command: int
    seq: int


@dataclass(frozen=True)
class GarbageSkipped:
    """Number of bytes dropped before the next frame."""

    count: int


@dataclass(frozen=True)
class FramingBroken:
    """The stream can no longer be split into frames. On TCP: close the connection."""

    reason: str


ReaderEvent = Frame | ChecksumFailed | GarbageSkipped | FramingBroken


class FrameReader:
    """Splits a byte stream into frames, wherever the stream is cut.

    Strict (TCP): any byte that fits no frame breaks the stream for good. Resynchronising (serial): bytes are dropped up
    to a magic with a plausible length and a right checksum. A false magic may announce a payload that never comes, so
    the caller, who has the clock, calls `abandon_half_frame` after a timeout.
    """

    def __init__(self, *, resynchronise: bool) -> None:
        self._resynchronise = resynchronise
        self._buffer = bytearray()
        self._broken: FramingBroken | None = None

    @property
    def half_frame_bytes(self) -> int:
        """Number of buffered bytes of an incomplete frame."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[ReaderEvent]:
        """Feed received bytes; returns what they complete."""
        if self._broken is not None:
            return [self._broken]
        self._buffer += data
        return list(self._complete())

    def abandon_half_frame(self) -> list[ReaderEvent]:
        """Discard an incomplete frame after a timeout: a strict stream breaks, a serial one searches on."""
        if self._broken is not None:
            return [self._broken]
        if not self._buffer:
            return []
        if not self._resynchronise:
            return [self._break(f"a frame stopped after {len(self._buffer)} bytes")]
        events: list[ReaderEvent] = []
        while self._buffer:  # a second false magic may follow the first one
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
        """Drop bytes that cannot begin a frame; returns their number and what was wrong with the first."""
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
        """Why the buffer cannot begin a frame; empty when it can, judged by the bytes so far."""
        start = bytes(self._buffer[:2])
        if not MAGIC.startswith(start):
            who = " (a web server answers there)" if start == b"HT" else ""
            return f"expected the magic 43 42, got {start.hex(' ')}{who}"
        if len(self._buffer) >= SUMMED_HEADER_BYTES:
            promised = int.from_bytes(self._buffer[8:10], "little")
            if promised > MAX_PAYLOAD_BYTES:
                return f"a payload of {promised} bytes is promised, at most {MAX_PAYLOAD_BYTES} are allowed"
        return ""

    def _take_frame(self) -> Frame | ChecksumFailed | None:
        """Take the first frame from the buffer; None while it is incomplete."""
        if len(self._buffer) < HEADER_BYTES:
            return None
        _, version, command, seq, status, promised, checksum = HEADER.unpack_from(self._buffer)
        end = HEADER_BYTES + promised
        if len(self._buffer) < end:
            return None
        payload = bytes(self._buffer[HEADER_BYTES:end])
        if fletcher16(bytes(self._buffer[:SUMMED_HEADER_BYTES]) + payload) != checksum:
            del self._buffer[:1]  # the length itself may be corrupted: drop one byte, a good frame may begin inside
            return ChecksumFailed(command, seq)
        del self._buffer[:end]
        return Frame(command, seq, payload, status, version)

    def _break(self, reason: str) -> FramingBroken:
        self._broken = FramingBroken(reason)
        self._buffer.clear()
        return self._broken

"""Moves records from file to file at the speed of copying: two threads, each moving every other block.

A file takes one write at a time: while one thread writes, the other reads and moves; a third would wait. A point
gets the same bits whichever thread moves it (`registration.points.rigid_motion.move_points`).
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from registration.errors import CloudTruncated
from registration.io.durable_file import GuardedFile
from registration.points.layout import Records

SPAN_BYTES = 1 << 19
"""Block size: fits a core's second-level cache, yet large enough for the kernel to write in large folios."""

THREADS = 2


class Mover(Protocol):
    """Moves blocks; each result is valid until the next call."""

    def move(self, block: Records) -> Records: ...


@dataclass(frozen=True)
class Span:
    """`count` records from byte `source` of one file to byte `target` of another."""

    dtype: np.dtype[Any]
    count: int
    source: int
    target: int

    @property
    def block_points(self) -> int:
        return max(1, SPAN_BYTES // self.dtype.itemsize)


def move_span(source: GuardedFile, target: GuardedFile, span: Span, movers: Sequence[Mover]) -> None:
    """Move all records, one thread per mover. Raises CloudTruncated, CloudIOError."""
    if span.count <= span.block_points:
        movers = movers[:1]

    def work(first: int) -> None:
        step = span.block_points
        for start in range(first * step, span.count, len(movers) * step):
            _move_block(source, target, span, start, buffers[first], movers[first])

    buffers = [memoryview(bytearray(span.block_points * span.dtype.itemsize)) for _ in movers]
    with ThreadPoolExecutor(len(movers), "move") as threads:
        list(threads.map(work, range(len(movers))))


def _move_block(
    source: GuardedFile, target: GuardedFile, span: Span, start: int, buffer: memoryview, mover: Mover
) -> None:
    size = span.dtype.itemsize
    wanted = buffer[: min(span.block_points, span.count - start) * size]
    length = source.read_at(wanted, span.source + start * size)
    if length < len(wanted):
        what = f"the file ends after {start + length // size} of {span.count} points: it was cut while it was read"
        raise CloudTruncated(source.name, f"point {start + length // size}", what, "copy the whole file again")
    moved = mover.move(np.frombuffer(wanted, span.dtype))
    target.write_at(moved.view(np.uint8).data, span.target + start * size)


def copy_span(source: GuardedFile, target: GuardedFile, begin: int, end: int) -> None:
    """Copy bytes `begin` to `end` to the same position. Raises CloudTruncated, CloudIOError."""
    buffer = memoryview(bytearray(min(SPAN_BYTES, max(0, end - begin))))
    while begin < end:
        length = source.read_at(buffer[: end - begin], begin)
        if not length:
            what = "the file ends: it was cut while it was read"
            raise CloudTruncated(source.name, f"byte {begin}", what, "copy the whole file again")
        target.write_at(buffer[:length], begin)
        begin += length

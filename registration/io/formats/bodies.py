"""Decodes bodies from pieces of bytes of any size to blocks of records, and encodes text bodies."""

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from registration.errors import CloudFormatError, CloudTooLong, CloudTruncated
from registration.io.formats.header import CloudHeader, shorten
from registration.points.layout import Layout, Records, scalar_columns

BLOCK_BYTES = 1 << 18
"""Bytes of a block of records, which stays in the second-level cache while it is read, moved and written."""

LINE_LIMIT = 1 << 16
"""Longest line of text in bytes; a longer one means damage or another format."""

RECORD_TEXT = {"f4": "%.9g", "f8": "%.17g"}
"""Digits that preserve every bit."""


class BodyDecoder(Protocol):
    """Decodes the bytes of the points. `take` yields blocks; `taken` is how many of the given bytes it used."""

    taken: int

    @property
    def complete(self) -> bool: ...

    @property
    def points(self) -> int: ...

    def take(self, data: memoryview) -> Iterator[Records]: ...

    def finish(self) -> Iterator[Records]:
        """Call at the end of the bytes. Raises CloudTruncated when points are missing."""
        ...


class _Body:
    """How many points there are, and the beginning of one that was cut off."""

    def __init__(self, header: CloudHeader, file: str) -> None:
        self._file, self._dtype, self._count = file, header.layout.dtype, header.count
        self._cut = b""
        self.points = self.taken = 0

    @property
    def complete(self) -> bool:
        return self.points == self._count


class BinaryDecoder(_Body):
    """Fixed-size records. Blocks are views of the given bytes, up to BLOCK_BYTES; a cut record is one of its own."""

    def take(self, data: memoryview) -> Iterator[Records]:
        itemsize, offset = self._dtype.itemsize, 0
        if self._cut:
            offset = min(itemsize - len(self._cut), len(data))
            self._cut += data[:offset]
            if len(self._cut) == itemsize:
                cut, self._cut = self._cut, b""
                self.points += 1
                yield np.frombuffer(cut, self._dtype)
        whole = (len(data) - offset) // itemsize
        if self._count is not None:
            whole = min(whole, self._count - self.points)
        end, step = offset + whole * itemsize, max(1, BLOCK_BYTES // itemsize)
        for first in range(0, whole, step):
            block = np.frombuffer(data, self._dtype, min(step, whole - first), offset + first * itemsize)
            self.points += len(block)
            yield block
        self.taken = end if self.complete else len(data)
        if not self.complete:
            self._cut += data[end:]

    def finish(self) -> Iterator[Records]:
        if self._cut:
            raise _truncation_error(
                self._file, self.points, self._count, f"{len(self._cut)} bytes of a {self._dtype.itemsize}-byte point"
            )
        if self._count is not None and not self.complete:
            raise _truncation_error(self._file, self.points, self._count)
        return iter(())


class TextDecoder(_Body):
    """One line of numbers per record; blank lines are skipped."""

    def __init__(self, header: CloudHeader, file: str) -> None:
        super().__init__(header, file)
        self._columns = scalar_columns(header.layout.dtype)
        self._width = len(self._columns.names or ())
        self._separator = header.separator

    def take(self, data: memoryview) -> Iterator[Records]:
        self.taken = 0
        if self.complete:
            return
        content = self._cut + data
        end = content.rfind(b"\n") + 1
        if len(content) - end > LINE_LIMIT:
            raise CloudFormatError(
                self._file, f"point {self.points}", f"a line is longer than {LINE_LIMIT} bytes", "check the file's type"
            )
        lines = content[:end].split(b"\n")[:-1]
        rows = [line for line in lines if line.strip()]
        if self._count is not None and self.points + len(rows) >= self._count:
            rows = rows[: self._count - self.points]
            used = _through_row(lines, len(rows))
            self.taken, self._cut = sum(len(line) + 1 for line in lines[:used]) - len(self._cut), b""
        else:
            self.taken, self._cut = len(data), content[end:]
        yield from self._parse(rows)

    def finish(self) -> Iterator[Records]:
        rest, self._cut = self._cut, b""
        if not self.complete:
            yield from self._parse([rest] if rest.strip() else [])
        if self._count is not None and not self.complete:
            raise _truncation_error(self._file, self.points, self._count)

    def _parse(self, rows: list[bytes]) -> Iterator[Records]:
        if not rows:
            return
        try:
            block = self._numbers(rows)
        except ValueError:
            index, what = self._culprit(rows)
            fix = f"every line needs {self._width} numbers"
            raise CloudFormatError(self._file, f"point {self.points + index}", what, fix) from None
        self.points += len(block)
        yield block.view(self._dtype)

    def _numbers(self, rows: list[bytes]) -> Records:
        text = [row.decode("ascii") for row in rows]
        with np.errstate(over="ignore"):
            return np.loadtxt(text, self._columns, comments=None, delimiter=self._separator, ndmin=1)

    def _culprit(self, rows: list[bytes]) -> tuple[int, str]:
        for index, row in enumerate(rows):
            try:
                self._numbers([row])
            except ValueError:
                return (
                    index,
                    f"{shorten(row.decode('ascii', 'replace').strip())} is not {self._width} fitting numbers",
                )
        return 0, "the lines have different numbers of columns"


def _through_row(lines: list[bytes], rows: int) -> int:
    """Number of lines up to and including the last of `rows` non-blank lines."""
    for index, line in enumerate(lines):
        rows -= bool(line.strip())
        if not rows:
            return index + 1
    return len(lines)


def _truncation_error(file: str, points: int, count: int | None, cut: str = "") -> CloudTruncated:
    promised = "" if count is None else f" of {count} promised"
    rest = f" and {cut}" if cut else ""
    return CloudTruncated(
        file,
        f"point {points}",
        f"the data end after {points} points{promised}{rest}",
        "send or copy the whole cloud again",
    )


def require_end(header: CloudHeader, file: str, points: int, extra: bytes | memoryview) -> None:
    """Check that only filler follows after everything the header promised. Raises CloudTooLong."""
    if bytes(extra).strip(header.filler):
        what = f"at least {len(extra)} bytes follow after everything the header promises"
        raise CloudTooLong(file, f"after point {points}", what, "check the header's count, or send the cloud again")


def decoder_of(header: CloudHeader, file: str) -> BodyDecoder:
    """The decoder for a header's encoding ('compressed' has no streaming form)."""
    return TextDecoder(header, file) if header.encoding == "text" else BinaryDecoder(header, file)


class TextEncoder:
    """Encodes records as lines of numbers."""

    def __init__(self, layout: Layout, separator: str = " ") -> None:
        columns = scalar_columns(layout.dtype)
        self._names = columns.names or ()
        self._columns = columns
        self._row = separator.join(RECORD_TEXT.get(columns[name].str[1:], "%d") for name in self._names) + "\n"

    def encode(self, block: Records) -> bytes:
        numbers = np.ascontiguousarray(block).view(self._columns)
        rows = zip(*(numbers[name].tolist() for name in self._names), strict=True)
        return "".join(map(self._row.__mod__, rows)).encode("ascii")

"""Copies the elements before or after the points, and detects truncation."""

from registration.errors import CloudFormatError, CloudTruncated
from registration.io.formats.header import Encoding
from registration.io.formats.tail import BinaryWalker, Element, RecordTooLong


class SectionPassage:
    """`take` returns how many of the given bytes belong to the elements; these are copied unchanged."""

    def __init__(self, elements: tuple[Element, ...], encoding: Encoding, file: str) -> None:
        self._file = file
        self._walk = _Lines(elements) if encoding == "text" else BinaryWalker(elements)

    @property
    def complete(self) -> bool:
        return self._walk.complete

    def take(self, data: memoryview) -> int:
        try:
            return self._walk.take(data)
        except RecordTooLong as error:
            raise CloudFormatError(self._file, self._walk.place, str(error), "write the file again") from None

    def finish(self) -> None:
        """Raises CloudTruncated when records are missing."""
        self._walk.finish()
        if not self.complete:
            raise CloudTruncated(
                self._file, self._walk.place, "the data end here", "send or copy the whole cloud again"
            )


class _Lines:
    """Text elements: one line each; blank lines are skipped."""

    def __init__(self, elements: tuple[Element, ...]) -> None:
        self._left = self._all = sum(element.count for element in elements)
        self._begun = False

    @property
    def complete(self) -> bool:
        return self._left == 0

    @property
    def place(self) -> str:
        return f"line {self._all - self._left} beside the points"

    def take(self, data: memoryview) -> int:
        content = bytes(data)
        position = 0
        while self._left:
            end = content.find(b"\n", position)
            piece = content[position : end if end >= 0 else None]
            self._begun = self._begun or bool(piece.strip())
            if end < 0:
                return len(content)
            self._left -= self._begun
            self._begun = False
            position = end + 1
        return position

    def finish(self) -> None:
        self._left -= self._begun
        self._begun = False

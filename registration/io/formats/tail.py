"""Measures elements beside the points of a PLY file (faces, edges, cameras), which are copied unread.

Elements with lists have records of varying length. Most meshes consist of triangles only, so the walker measures
one record and then tests, vectorised, how many of the following have the same list lengths.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

LIST_BYTES_LIMIT = 1 << 24
"""A longer record is taken for damage, which bounds memory."""


@dataclass(frozen=True)
class Property:
    """A number (`length` None), or a list of `kind` preceded by its length."""

    kind: np.dtype[Any]
    length: np.dtype[Any] | None = None


@dataclass(frozen=True)
class Element:
    """`count` records of the same properties."""

    name: str
    count: int
    properties: tuple[Property, ...]

    @property
    def lists(self) -> bool:
        return any(item.length is not None for item in self.properties)

    @property
    def itemsize(self) -> int:
        """Record size of an element without lists."""
        return sum(item.kind.itemsize for item in self.properties)


class RecordTooLong(Exception):
    """A list's length is negative or absurd."""


class BinaryWalker:
    """Measures binary elements; a record cut by a boundary is buffered until complete, in bounded memory."""

    def __init__(self, elements: tuple[Element, ...]) -> None:
        self._elements = [element for element in elements if element.count and element.properties]
        self._left = [element.count for element in self._elements]
        self._cut = b""

    @property
    def complete(self) -> bool:
        return not self._elements

    @property
    def place(self) -> str:
        """The next record, for messages."""
        if self.complete:
            return "the end"
        element = self._elements[0]
        return f"{element.name} {element.count - self._left[0]}"

    def take(self, data: memoryview) -> int:
        """How many bytes of `data` belong to the elements. Raises RecordTooLong."""
        content, position = memoryview(self._cut + data), 0
        while self._elements:
            element, left = self._elements[0], self._left[0]
            if element.lists:
                taken, size = _walk(element, left, content[position:])
            else:
                taken = min(left, (len(content) - position) // element.itemsize)
                size = taken * element.itemsize
            position += size
            self._left[0] -= taken
            if self._left[0]:
                break
            self._elements.pop(0), self._left.pop(0)
        used = position - len(self._cut) if self.complete else len(data)
        self._cut = b"" if self.complete else bytes(content[position:])
        return used

    def finish(self) -> None:
        """Nothing to do: bytes are passed on before their record is complete."""


def _walk(element: Element, left: int, data: memoryview) -> tuple[int, int]:
    """(records, bytes) that are complete."""
    bytes_ = np.frombuffer(data, np.uint8)
    taken = position = 0
    while taken < left:
        measured = _measure(element, data, position)
        if measured is None:
            break
        size, lengths = measured
        alike = min(left - taken, (len(data) - position) // size)
        rows = bytes_[position : position + alike * size].reshape(alike, size)
        for offset, length in lengths:
            rows = rows[: _agreeing(rows[:, offset : offset + len(length)], length)]
        taken += len(rows)
        position += len(rows) * size
    return taken, position


def _agreeing(rows: NDArray[np.uint8], length: NDArray[np.uint8]) -> int:
    """How many of the first rows equal `length`."""
    same = (rows == length).all(axis=1)
    return len(same) if same.all() else int(np.argmin(same))


def _measure(element: Element, data: memoryview, start: int) -> tuple[int, list[tuple[int, NDArray[np.uint8]]]] | None:
    """Size of the record at `start` and its list lengths' bytes with offsets; None when it is incomplete."""
    position = start
    lengths: list[tuple[int, NDArray[np.uint8]]] = []
    for item in element.properties:
        count = 1
        if item.length is not None:
            raw = data[position : position + item.length.itemsize]
            if len(raw) < item.length.itemsize:
                return None
            count = int(np.frombuffer(raw, item.length)[0])
            if not 0 <= count * item.kind.itemsize <= LIST_BYTES_LIMIT:
                raise RecordTooLong(f"a list of {count} in element {element.name!r}")
            lengths.append((position - start, np.frombuffer(raw, np.uint8)))
            position += item.length.itemsize
        position += count * item.kind.itemsize
    return None if position > len(data) else (position - start, lengths)

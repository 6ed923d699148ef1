"""What all header parsers and all readers return, and parsing of numbers in header lines."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal, NoReturn

from registration.errors import CloudFormatError, CloudUnsupported
from registration.io.formats.tail import Element
from registration.points.layout import Layout, Records

Encoding = Literal["text", "binary", "compressed"]

HEADER_LIMIT = 1 << 16
"""Largest header in bytes; the longest known ones have a few thousand."""

COUNT_LIMIT = 1 << 63


@dataclass(frozen=True)
class CloudHeader:
    """`length` bytes of header, then `count` records (None: up to the end) and the elements of `tail`.

    `rewritten` is the header for the moved cloud.
    """

    format: str
    encoding: Encoding
    layout: Layout
    count: int | None
    length: int
    rewritten: bytes
    lead: tuple[Element, ...] = ()
    tail: tuple[Element, ...] = ()
    separator: str | None = None
    """Separator of the numbers of a text line; None: white space."""

    @property
    def filler(self) -> bytes:
        """Bytes that may follow everything without meaning: PCL fills a file's last page with zeros."""
        if self.encoding == "text":
            return b" \t\r\n\v\f"
        return b"\0" if self.format == "pcd" else b""

    @property
    def body_length(self) -> int | None:
        """Bytes after the header, as far as the header determines it."""
        if (
            self.count is None
            or self.encoding != "binary"
            or any(element.lists for element in (*self.lead, *self.tail))
        ):
            return None
        others = sum(element.count * element.itemsize for element in (*self.lead, *self.tail))
        return self.count * self.layout.itemsize + others


@dataclass(frozen=True)
class CloudSource:
    """An open cloud. `count`: None where the file does not determine it; `blocks` is to be called once.

    A block is valid until the next one; the caller may overwrite it.
    """

    layout: Layout
    count: int | None
    blocks: Callable[[], Iterator[Records]]


class HeaderLines:
    """Header lines with their numbers, for error messages."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.number = 0

    def raise_format_error(self, what: str, fix: str = "write the file again") -> NoReturn:
        raise CloudFormatError(self.file, f"header line {self.number}", what, fix)

    def refuse(self, what: str, fix: str) -> NoReturn:
        raise CloudUnsupported(self.file, f"header line {self.number}", what, fix)

    def whole_number(self, word: str, name: str, least: int = 0) -> int:
        """Parse a count: no sign, no exponent, below 2^63."""
        if not word.isascii() or not word.isdigit() or len(word) > 19 or not least <= int(word) < COUNT_LIMIT:
            self.raise_format_error(f"{name} is {shorten(word)}, not a whole number from {least} to 2^63")
        return int(word)


def shorten(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")

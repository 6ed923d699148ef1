"""RAPID values: num as IEEE single with its integer range, strings of 80, rawbytes of 1024, clocks."""

import math
from ctypes import c_float
from dataclasses import dataclass, field
from struct import Struct
from typing import Any

from mock_robot.rapid.errors import RapidError

MAX_STRING_LENGTH = 80
MAX_RAWBYTES = 1024
MIN_INTEGER, MAX_INTEGER = -8388607, 8388608
"""Range of RAPID's integers, in which a num is exact."""
MAX_SINGLE = 3.4028234663852886e38
MAX_EXACT_INTEGER = 2.0**24
"""A single represents every integer up to here."""
MILLISECOND = 1000


def single(value: float) -> float:
    """Round to IEEE single, as a num stores numbers. Raises ERR_NUM_LIMIT beyond its range."""
    if value.is_integer() and -MAX_EXACT_INTEGER <= value <= MAX_EXACT_INTEGER:
        return value
    rounded = c_float(value).value
    if -MAX_SINGLE <= rounded <= MAX_SINGLE:
        return rounded
    raise RapidError("ERR_NUM_LIMIT", f"{value:g} is beyond what a num holds")


def integer(value: float) -> int:
    """Check for an integer. Raises ERR_INT_NOTVAL, and ERR_INT_MAXVAL outside RAPID's integer range."""
    if value != math.floor(value):
        raise RapidError("ERR_INT_NOTVAL", f"{value:g} is no integer")
    if not MIN_INTEGER <= value <= MAX_INTEGER:
        raise RapidError("ERR_INT_MAXVAL", f"{value:g} is outside {MIN_INTEGER} to {MAX_INTEGER}")
    return int(value)


def short(text: str) -> str:
    """Check a string's length. Raises ERR_STRTOOLNG."""
    if len(text) > MAX_STRING_LENGTH:
        raise RapidError("ERR_STRTOOLNG", f"{len(text)} characters, a string holds {MAX_STRING_LENGTH}")
    return text


def number_text(value: float) -> str:
    """A num as RAPID prints it: six digits, or seven for an integer."""
    if value == math.floor(value) and MIN_INTEGER <= value <= MAX_INTEGER:
        return str(int(value))
    return f"{value:.6g}".upper().replace("E+0", "E+").replace("E-0", "E-")


class RawBytes:
    """1024 bytes, counted from 1, of which the first `length` are valid."""

    __slots__ = ("content", "length")

    def __init__(self, content: bytes = b"") -> None:
        self.content = bytearray(MAX_RAWBYTES)
        self.content[: len(content)] = content
        self.length = len(content)

    def clear(self, from_index: int = 1) -> None:
        """Zero from `from_index` on; bytes before it stay valid."""
        _require_inside(from_index, 1)
        self.content[from_index - 1 :] = bytes(MAX_RAWBYTES - from_index + 1)
        self.length = min(self.length, from_index - 1)

    def fill(self, content: bytes) -> None:
        self.content[:] = content.ljust(MAX_RAWBYTES, b"\0")
        self.length = len(content)

    def write(self, index: int, content: bytes) -> None:
        """Write bytes at `index`; the valid length grows to hold them."""
        _require_inside(index, len(content))
        self.content[index - 1 : index - 1 + len(content)] = content
        self.length = max(self.length, index - 1 + len(content))

    def read(self, index: int, count: int) -> bytes:
        """`count` valid bytes from `index` on."""
        if not 1 <= index <= index - 1 + count <= self.length:
            raise RapidError("ERR_ARGVALERR", f"bytes {index} to {index - 1 + count} of {self.length} valid ones")
        return bytes(self.content[index - 1 : index - 1 + count])

    def number(self, layout: Struct, index: int) -> Any:
        if not 1 <= index <= self.length + 1 - layout.size:
            self.read(index, layout.size)
        return layout.unpack_from(self.content, index - 1)[0]

    def valid(self) -> bytes:
        return bytes(self.content[: self.length])


def _require_inside(index: int, count: int) -> None:
    if not 1 <= index <= index - 1 + count <= MAX_RAWBYTES:
        where = f"bytes {index} to {index - 1 + count} of a rawbytes of {MAX_RAWBYTES}"
        raise RapidError("ERR_ARGVALERR", where)


@dataclass
class StopWatch:
    """A stop watch; the times are passed in."""

    _since_s: float | None = field(default=None, init=False)

    def reset(self) -> None:
        self._since_s = None

    def start(self, now_s: float) -> None:
        """Start; no effect on a running clock."""
        if self._since_s is None:
            self._since_s = now_s

    def read_s(self, now_s: float) -> float:
        """Seconds as a num, to the millisecond."""
        running_s = 0.0 if self._since_s is None else now_s - self._since_s
        return single(math.floor(running_s * MILLISECOND) / MILLISECOND)

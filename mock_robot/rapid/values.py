"""Values of RAPID: num as IEEE single with its integer range, strings of 80, rawbytes of 1024, clocks."""

import math
from ctypes import c_float
from dataclasses import dataclass, field
from struct import Struct
from time import monotonic
from typing import Any

from mock_robot.rapid.errors import RapidError

STRING_MAX = 80
RAWBYTES_MAX = 1024
INTEGER_LOW, INTEGER_HIGH = -8388607, 8388608
"""RAPID's integers in a num: exact only here."""
SINGLE_MAX = 3.4028234663852886e38
SINGLE_EXACT = 2.0**24
"""A single holds every integer up to here."""
MILLISECOND = 1000


def single(value: float) -> float:
    """A number as a num holds it: rounded to IEEE single. Raises ERR_NUM_LIMIT beyond its range."""
    if value.is_integer() and -SINGLE_EXACT <= value <= SINGLE_EXACT:
        return value
    rounded = c_float(value).value
    if -SINGLE_MAX <= rounded <= SINGLE_MAX:
        return rounded
    raise RapidError("ERR_NUM_LIMIT", f"{value:g} is beyond what a num holds")


def integer(value: float) -> int:
    """A num that has to be an integer. Raises ERR_INT_NOTVAL, and ERR_INT_MAXVAL outside RAPID's integer range."""
    if value != math.floor(value):
        raise RapidError("ERR_INT_NOTVAL", f"{value:g} is no integer")
    if not INTEGER_LOW <= value <= INTEGER_HIGH:
        raise RapidError("ERR_INT_MAXVAL", f"{value:g} is outside {INTEGER_LOW} to {INTEGER_HIGH}")
    return int(value)


def short(text: str) -> str:
    """A string that a string holds. Raises ERR_STRTOOLNG."""
    if len(text) > STRING_MAX:
        raise RapidError("ERR_STRTOOLNG", f"{len(text)} characters, a string holds {STRING_MAX}")
    return text


def number_text(value: float) -> str:
    """A num as RAPID prints it: six digits, or seven for an integer."""
    if value == math.floor(value) and INTEGER_LOW <= value <= INTEGER_HIGH:
        return str(int(value))
    return f"{value:.6g}".upper().replace("E+0", "E+").replace("E-0", "E-")


class RawBytes:
    """1024 bytes, counted from 1; `length` of them are valid."""

    __slots__ = ("content", "length")

    def __init__(self, content: bytes = b"") -> None:
        self.content = bytearray(RAWBYTES_MAX)
        self.content[: len(content)] = content
        self.length = len(content)

    def clear(self, from_index: int = 1) -> None:
        """Zero from there on; what lies before stays valid."""
        _require_inside(from_index, 1, "ERR_RAW_COPY")
        self.content[from_index - 1 :] = bytes(RAWBYTES_MAX - from_index + 1)
        self.length = min(self.length, from_index - 1)

    def fill(self, content: bytes) -> None:
        """These bytes and no others."""
        self.content[:] = content.ljust(RAWBYTES_MAX, b"\0")
        self.length = len(content)

    def write(self, index: int, content: bytes, error: str = "ERR_RAW_PACK") -> None:
        """Put bytes at `index`; what is valid grows to hold them."""
        _require_inside(index, len(content), error)
        self.content[index - 1 : index - 1 + len(content)] = content
        self.length = max(self.length, index - 1 + len(content))

    def read(self, index: int, count: int, error: str = "ERR_RAW_UNPACK") -> bytes:
        """`count` valid bytes from `index` on."""
        if not 1 <= index <= index - 1 + count <= self.length:
            raise RapidError(error, f"bytes {index} to {index - 1 + count} of {self.length} valid ones")
        return bytes(self.content[index - 1 : index - 1 + count])

    def number(self, layout: Struct, index: int) -> Any:
        """The one value at `index` that the layout tells."""
        if not 1 <= index <= self.length + 1 - layout.size:
            self.read(index, layout.size)
        return layout.unpack_from(self.content, index - 1)[0]

    def valid(self) -> bytes:
        """The valid bytes."""
        return bytes(self.content[: self.length])


def _require_inside(index: int, count: int, error: str) -> None:
    if not 1 <= index <= index - 1 + count <= RAWBYTES_MAX:
        raise RapidError(error, f"bytes {index} to {index - 1 + count} of a rawbytes of {RAWBYTES_MAX}")


@dataclass
class Clock:
    """A stop watch on wire time."""

    _ran_s: float = field(default=0.0, init=False)
    _since_s: float | None = field(default=None, init=False)

    def reset(self) -> None:
        """Stop, and back to zero."""
        self._ran_s, self._since_s = 0.0, None

    def start(self) -> None:
        """Run on; a running clock does already."""
        if self._since_s is None:
            self._since_s = monotonic()

    def stop(self) -> None:
        """Hold the time."""
        self._ran_s, self._since_s = self.read_s(), None

    def read_s(self) -> float:
        """Seconds, to the millisecond, as a num."""
        running_s = 0.0 if self._since_s is None else monotonic() - self._since_s
        return single(math.floor((self._ran_s + running_s) * MILLISECOND) / MILLISECOND)

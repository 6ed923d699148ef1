"""PLY headers (Turk 1994; text and binary of both byte orders, any scalar properties beside x, y, z)."""

from typing import Any, Literal

import numpy as np

from registration.errors import CloudFormatError
from registration.io.formats.header import HEADER_LIMIT, CloudHeader, Encoding, HeaderLines, shorten
from registration.io.formats.tail import Element, Property
from registration.points.layout import Layout

NAMES: dict[str, str] = dict(
    zip(
        ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"),
        ("char", "uchar", "short", "ushort", "int", "uint", "float", "double"),
        strict=True,
    )
)
SIZED = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64")
TYPES: dict[str, str] = {
    **{name: code for code, name in NAMES.items()},
    **dict(zip(SIZED, NAMES, strict=True)),
}
ENCODINGS: dict[str, tuple[Encoding, Literal["<", ">"]]] = {
    "ascii": ("text", "<"),
    "binary_little_endian": ("binary", "<"),
    "binary_big_endian": ("binary", ">"),
}


def parse_header(prefix: bytes, file: str) -> CloudHeader | None:
    """Parse the header at the start of `prefix`; None while incomplete. Raises CloudFormatError, CloudUnsupported."""
    if not b"ply\n".startswith(prefix[:4]) and not b"ply\r".startswith(prefix[:4]):
        raise CloudFormatError(file, "byte 0", "a PLY file begins with the line 'ply'", "check the file's type")
    lines = HeaderLines(file)
    position = 0
    reading = _Reading(lines)
    while not reading.ended:
        end = prefix.find(b"\n", position)
        if end < 0 or end >= HEADER_LIMIT:
            if len(prefix) > HEADER_LIMIT:
                lines.raise_format_error(f"no 'end_header' within {HEADER_LIMIT} bytes", "check the file's type")
            return None
        lines.number += 1
        line = prefix[position:end].rstrip(b"\r")
        position = end + 1
        if not line.isascii():
            if not line.startswith((b"comment", b"obj_info")):
                lines.raise_format_error("the header has bytes that are not ASCII")
            continue
        reading.line(line.decode("ascii").split())
    return reading.header(position, prefix[:position])


class _Reading:
    def __init__(self, lines: HeaderLines) -> None:
        self._lines = lines
        self._encoding: tuple[Encoding, Literal["<", ">"]] | None = None
        self._elements: list[tuple[str, int, list[tuple[str, Property]]]] = []
        self._vertex_line = 0
        self.ended = False

    def line(self, words: list[str]) -> None:
        match words:
            case _ if self._lines.number == 1:
                if words != ["ply"]:
                    self._lines.raise_format_error("a PLY file begins with the line 'ply'", "check the file's type")
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", encoding, "1.0"] if encoding in ENCODINGS and self._encoding is None:
                self._encoding = ENCODINGS[encoding]
            case ["element", name, count]:
                self._elements.append((name, self._lines.whole_number(count, f"the number of {name!r}"), []))
            case ["property", "list", length, kind, name] if self._elements:
                self._property(name, Property(self._type(kind), self._type(length, "iu")))
            case ["property", kind, name] if self._elements:
                self._property(name, Property(self._type(kind)))
            case ["end_header"]:
                self.ended = True
            case _:
                self._lines.raise_format_error(f"{shorten(' '.join(words))} is no PLY header line here")

    def _type(self, name: str, kinds: str = "iuf") -> np.dtype[Any]:
        if self._encoding is None:
            self._lines.raise_format_error("a property stands before the 'format' line")
        if name not in TYPES or TYPES[name][0] not in kinds:
            self._lines.raise_format_error(f"{shorten(name)} is no PLY type here", f"known: {', '.join(TYPES)}")
        return np.dtype(TYPES[name]).newbyteorder(self._encoding[1])

    def _property(self, name: str, item: Property) -> None:
        element, _, properties = self._elements[-1]
        if any(name == other for other, _ in properties):
            self._lines.raise_format_error(f"property {shorten(name)} of {shorten(element)} stands twice")
        if element == "vertex" and item.length is not None:
            self._lines.refuse(f"vertex property {shorten(name)} is a list", "write vertices of numbers only")
        properties.append((name, item))

    def header(self, length: int, content: bytes) -> CloudHeader:
        if self._encoding is None:
            self._lines.raise_format_error("there is no 'format' line")
        names = [name for name, _, _ in self._elements]
        if names.count("vertex") != 1:
            self._lines.raise_format_error(f"{names.count('vertex')} elements 'vertex' where one is needed")
        at = names.index("vertex")
        _, count, properties = self._elements[at]
        dtype = np.dtype([(name, item.kind) for name, item in properties])
        missing = [name for name in ("x", "y", "z") if name not in (dtype.names or ())]
        if missing:
            self._lines.raise_format_error(f"the vertices have no {', '.join(missing)}")
        if any(dtype[name].kind != "f" for name in ("x", "y", "z")):
            self._lines.refuse("x, y, z are integers, which cannot hold a rotated point", "write them as float")
        elements = [Element(name, number, tuple(item for _, item in items)) for name, number, items in self._elements]
        return CloudHeader(
            "ply",
            self._encoding[0],
            Layout.of(dtype),
            count,
            length,
            content,
            tuple(elements[:at]),
            tuple(elements[at + 1 :]),
        )


def with_frame(header: bytes, calibration_id: str) -> bytes:
    """A PLY header with a comment that names the frame, whatever its older comments say."""
    line = b"comment handeyed: frame base, lengths mm"
    if calibration_id:
        line += b", calibration " + calibration_id.encode("ascii", "replace").translate(None, b"\r\n")
    head, _, end = header.rpartition(b"end_header")
    return head + line + (b"\r\n" if head.endswith(b"\r\n") else b"\n") + b"end_header" + end


def format_header(layout: Layout, count: int, encoding: str = "binary_little_endian") -> bytes:
    """A header for records of `layout`, all of types that PLY has, of the same length for every `count`."""
    lines = ["ply", f"format {encoding} 1.0", "comment lengths in mm".ljust(41 - len(str(count)))]
    lines.append(f"element vertex {count}")
    for name in layout.dtype.names or ():
        lines.append(f"property {NAMES[layout.dtype[name].str[1:]]} {name}")
    return ("\n".join([*lines, "end_header"]) + "\n").encode("ascii")

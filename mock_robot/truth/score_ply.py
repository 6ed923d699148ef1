"""A PLY reader independent of the product's own, so that the score does not share its defects."""

import numpy as np

from calibration.transforms import Array

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
ENDIANS = {"binary_little_endian": "<", "binary_big_endian": ">"}


class UnreadablePly(ValueError):
    """The bytes are not a PLY file with x, y, z; the message says what is wrong."""


def read_points(ply: bytes) -> Array:
    """x, y, z (n, 3) of the first element, which must be the vertices. Raises UnreadablePly."""
    head, mark, body = ply.partition(b"end_header\n")
    words = [line.split() for line in head.decode("latin-1").splitlines()]
    if not mark or not words or words[0] != ["ply"]:
        raise UnreadablePly("it does not begin with a PLY header: is it the merged cloud?")
    endian = next((ENDIANS.get(line[1]) for line in words if line[:1] == ["format"] and len(line) > 1), None)
    elements = [index for index, line in enumerate(words) if line[:1] == ["element"]]
    if endian is None or not elements or words[elements[0]][1:2] != ["vertex"]:
        raise UnreadablePly("its header names no binary format, or its first element is not the vertices")
    promised = b"".join(word.encode() for word in words[elements[0]][2:3])
    if not promised.isdigit():
        raise UnreadablePly("its header does not say how many vertices there are")
    count = int(promised)
    until = elements[1] if len(elements) > 1 else len(words)
    fields = [(line[2], line[1]) for line in words[elements[0] : until] if line[:1] == ["property"]]
    names = [name for name, _ in fields]
    if not {"x", "y", "z"} <= set(names) or not all(kind in TYPES for _, kind in fields):
        raise UnreadablePly(f"its vertices have {', '.join(names) or 'no properties'}: x, y and z are needed")
    record = np.dtype([(name, endian + TYPES[kind]) for name, kind in fields])
    if len(body) < count * record.itemsize:
        raise UnreadablePly(f"its header promises {count} points, it ends after {len(body) // record.itemsize}")
    table = np.frombuffer(body, record, count)
    return np.column_stack([table[axis].astype(float) for axis in "xyz"])

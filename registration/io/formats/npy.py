"""NumPy's file format: an array (n, 3 or more) of floats, or a structured array with x, y, z."""

import ast
import warnings
from typing import Any

import numpy as np

from registration.errors import CloudFormatError, CloudUnsupported
from registration.io.formats.header import COUNT_LIMIT, HEADER_LIMIT, CloudHeader, shorten
from registration.points.layout import Layout

MAGIC = b"\x93NUMPY"
COLUMN_LIMIT = 256
FIX = "save it with numpy.save as an array (n, 3) of floats"


def parse_header(prefix: bytes, file: str) -> CloudHeader | None:
    """Parse the header at the start of `prefix`; None while incomplete. Raises CloudFormatError, CloudUnsupported."""
    if not MAGIC.startswith(prefix[:6]) and not prefix.startswith(MAGIC):
        raise CloudFormatError(file, "byte 0", "this is no NPY file", "check the file's type")
    if len(prefix) < 12:
        return None
    wide = prefix[6] >= 2
    start = 12 if wide else 10
    length = start + int.from_bytes(prefix[8:start], "little")
    if length > HEADER_LIMIT:
        raise CloudFormatError(file, "header", f"it claims {length} bytes", "write the file again")
    if len(prefix) < length:
        return None
    entries = _entries(prefix[start:length], file)
    layout, count = _layout(entries, file)
    return CloudHeader("npy", "binary", layout, count, length, prefix[:length])


def _entries(text: bytes, file: str) -> dict[str, Any]:
    try:
        with warnings.catch_warnings(action="ignore"):  # Python warns of suspicious literals, which are handled here
            entries = ast.literal_eval(text.decode("latin1").strip())
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        entries = None
    if not isinstance(entries, dict) or set(entries) != {"descr", "fortran_order", "shape"}:
        raise CloudFormatError(file, "header", f"{shorten(text.decode('latin1'))} is no NPY header", FIX)
    return entries


def _layout(entries: dict[str, Any], file: str) -> tuple[Layout, int]:
    dtype, shape = _dtype(entries["descr"], file), entries["shape"]
    if not isinstance(shape, tuple) or not all(type(size) is int and 0 <= size < COUNT_LIMIT for size in shape):
        raise CloudFormatError(file, "header", f"shape {shorten(str(shape))} is not valid", FIX)
    if dtype.names and len(shape) == 1:
        if not {"x", "y", "z"} <= set(dtype.names) or any(dtype[name].kind != "f" for name in ("x", "y", "z")):
            raise CloudUnsupported(file, "header", "the records have no float columns x, y, z", FIX)
        return Layout.of(dtype), shape[0]
    if dtype.kind != "f" or len(shape) != 2 or not 3 <= shape[1] <= COLUMN_LIMIT:
        raise CloudUnsupported(file, "header", f"an array of {dtype} and shape {shape} is no cloud", FIX)
    if entries["fortran_order"] and shape[0] > 1:
        raise CloudUnsupported(file, "header", "the array lies column by column", "save numpy.ascontiguousarray(it)")
    names = ["x", "y", "z", *(f"c{index}" for index in range(3, shape[1]))]
    return Layout.of(np.dtype([(name, dtype) for name in names])), shape[0]


def _dtype(description: Any, file: str) -> np.dtype[Any]:
    try:
        with warnings.catch_warnings(action="ignore"):
            dtype = np.dtype([tuple(entry) for entry in description] if isinstance(description, list) else description)
    except (TypeError, ValueError, SyntaxError, OverflowError, MemoryError):
        raise CloudFormatError(file, "header", f"{shorten(str(description))} is no type", FIX) from None
    kinds = [dtype[name].base.kind for name in dtype.names] if dtype.names else [dtype.kind]
    if not set(kinds) <= set("fiub") or dtype.itemsize > HEADER_LIMIT or (dtype.kind == "f" and dtype.itemsize > 8):
        raise CloudUnsupported(file, "header", f"the type {shorten(str(dtype))} is not numbers", FIX)
    return dtype


def format_header(layout: Layout, count: int) -> bytes:
    """An NPY header whose length does not depend on `count`; three equal columns make an array (n, 3)."""
    kinds = {layout.dtype[name] for name in layout.dtype.names or ()}
    plain = layout.dtype.names == layout.xyz and len(kinds) == 1
    descr = repr(kinds.pop().str if plain else layout.dtype.descr)
    shape = (count, 3) if plain else (count,)
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}"
    length = -(-(10 + len(descr) + 96) // 64) * 64
    return MAGIC + b"\x01\x00" + (length - 10).to_bytes(2, "little") + text.ljust(length - 11).encode("latin1") + b"\n"

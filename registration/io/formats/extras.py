"""Reads LAS, LAZ and E57 in blocks through the libraries of the extras `handeyed[las]` and `handeyed[e57]`.

LAS coordinates are integers with scale and offset, returned as float64 in the file's own unit, metres or
millimetres. Whatever the libraries raise on damaged files becomes a CloudFormatError.
"""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import numpy as np

from registration.errors import CloudError, CloudFormatError, CloudTruncated, CloudUnsupported
from registration.io.durable_file import GuardedFile
from registration.io.formats import las
from registration.io.formats.e57_xml import require_plain_xml
from registration.io.formats.header import CloudSource
from registration.io.formats.laz import require_sound_chunks
from registration.points.layout import COLOURS, Layout, Records

BLOCK_POINTS = 1 << 16
E57_BLOCK_POINTS = 1 << 14
"""libE57 fills a block column by column, so a block should fit into the cache."""

DAMAGE = (
    ValueError,
    TypeError,
    KeyError,
    IndexError,
    EOFError,
    OverflowError,
    MemoryError,
    RuntimeError,
    AttributeError,
    struct.error,
)
"""Exceptions that parsers written in Python and C raise on unexpected bytes."""

PANIC = "PanicException"
"""Exception of parsers written in Rust, whose class cannot be imported."""


def library(name: str, extra: str, file: str) -> Any:
    """Import an optional library. Raises CloudUnsupported when it is not installed."""
    try:
        return import_module(name)
    except ImportError:
        fix = f"install handeyed[{extra}], or convert the cloud to PLY"
        raise CloudUnsupported(file, "format", f"{name} is not installed", fix) from None


@contextmanager
def translate_errors(file: str, place: str, *further: type[Exception]) -> Iterator[None]:
    """Turn a library's exceptions into CloudFormatError, and silence NumPy's overflow warnings."""
    try:
        with np.errstate(all="ignore"):
            yield
    except CloudError:
        raise
    except BaseException as error:
        if not isinstance(error, (*DAMAGE, *further)) and type(error).__name__ != PANIC:
            raise
        what = f"it is damaged ({str(error)[:120] or type(error).__name__})"
        raise CloudFormatError(file, place, what, "copy the whole file again") from None


def open_las(file: GuardedFile, header: las.LasHeader, *, packed: bool) -> tuple[Any, tuple[type[Exception], ...]]:
    """laspy's reader of a file with this header, and what it raises on damage. `packed`: LAZ is read, or written.

    Raises CloudError's leaves.
    """
    laspy = library("laspy", "las", file.name)
    errors: tuple[type[Exception], ...] = (laspy.errors.LaspyException,)
    if packed:
        errors += (library("lazrs", "las", file.name).LazrsError,)
    with translate_errors(file.name, "header", *errors):
        if header.compressed:
            require_sound_chunks(file, header, library("lazrs", "las", file.name))
        file.seek(0)
        return laspy.open(file.raw, closefd=False), errors


def las_chunks(reader: Any, most: int, name: str, errors: tuple[type[Exception], ...]) -> Iterator[tuple[int, Any]]:
    """laspy's records, at most so many at a time, with the number of those before. Raises CloudError's leaves."""
    seen, expected = 0, int(reader.header.point_count)
    while seen < expected:
        with translate_errors(name, f"point {seen}", *errors):
            chunk = reader.read_points(min(most, expected - seen))
        if not len(chunk):
            what = f"the header promises {expected} points, the file has {seen}"
            raise CloudTruncated(name, f"point {seen}", what, "copy the whole file again")
        yield seen, chunk
        seen += len(chunk)


def las_source(file: GuardedFile, name: str, *, compressed: bool) -> CloudSource:
    """A LAS or LAZ file: x, y, z and all dimensions, including extra ones. Raises CloudError's leaves."""
    head = las.read_whole_header(file)
    reader, errors = open_las(file, head, packed=compressed or head.compressed)
    with translate_errors(name, "header", *errors):
        names = [each for each in reader.header.point_format.dimension_names if each not in ("X", "Y", "Z")]
        record = reader.read_points(0)
        held = {each: np.asarray(record[each]) for each in names}
        columns = [(each, empty.dtype.newbyteorder("="), empty.shape[1:]) for each, empty in held.items()]
        layout = Layout.of(np.dtype([("x", "f8"), ("y", "f8"), ("z", "f8"), *columns]))

    def blocks() -> Iterator[Records]:
        for seen, chunk in las_chunks(reader, BLOCK_POINTS, name, errors):
            with translate_errors(name, f"point {seen}", *errors):
                block = np.zeros(len(chunk), layout.dtype)
                for column in layout.dtype.names or ():
                    block[column] = np.asarray(chunk[column])
            yield block

    return CloudSource(layout, int(reader.header.point_count), blocks)


def e57_source(file: GuardedFile, name: str) -> CloudSource:
    """Scans of an E57 file in sequence: x, y, z and the columns every scan has. Raises CloudError's leaves."""
    pye57 = library("pye57", "e57", name)
    require_plain_xml(file, name)
    libe57, damage = pye57.libe57, pye57.libe57.E57Exception
    with translate_errors(name, "header", damage):
        # libE57 opens by path: by the descriptor's, so that it reads the file that was checked.
        image = pye57.E57(f"/proc/self/fd/{file.raw.fileno()}")
        headers = [image.get_header(index) for index in range(image.scan_count)]
        count = sum(int(header.point_count) for header in headers)
        posed = [header for header in headers if header.has_pose()]
        if not all(np.allclose(one.rotation_matrix, np.eye(3)) and np.allclose(one.translation, 0) for one in posed):
            what = "a scan carries a pose of its own, so its points stand in no camera's frame"
            raise CloudUnsupported(name, "pose", what, "export the scan in the scanner's frame")
        shared = [field for field in (headers[0].point_fields if headers else []) if field in COLUMNS]
        fields = [field for field in shared if all(field in header.point_fields for header in headers)]
        if not {"cartesianX", "cartesianY", "cartesianZ"} <= set(fields):
            raise CloudUnsupported(name, "points", "there are no Cartesian coordinates", "export x, y, z")
    layout = Layout.of(np.dtype([(COLUMNS[field], "f8") for field in fields]))

    def straight_into(block: Records) -> Any:
        """libE57's buffers backed by the columns of `block`."""
        buffers = libe57.VectorSourceDestBuffer()
        for field in fields:
            column = block[COLUMNS[field]]
            buffers.append(
                libe57.SourceDestBuffer(image.image_file, field, column, len(block), True, True, column.strides[0])
            )
        return buffers

    def blocks() -> Iterator[Records]:
        for index, header in enumerate(headers):
            if not int(header.point_count):
                continue  # libE57 takes it for damage
            block = np.empty(E57_BLOCK_POINTS, layout.dtype)
            with translate_errors(name, f"scan {index}", damage):
                reader = header.points.reader(straight_into(block))
                read = reader.read()
                least, most = colour_range(header, libe57) if "red" in block.dtype.fields else (0.0, 255.0)
            while read:
                for colour in COLOURS if (least, most) != (0.0, 255.0) else ():
                    block[colour][:read] = (block[colour][:read] - least) * (255.0 / (most - least))
                yield block[:read]
                with translate_errors(name, f"scan {index}", damage):
                    read = reader.read()
            reader.close()  # libE57 opens no second one beside it

    return CloudSource(layout, count, blocks)


COLUMNS = {
    **{f"cartesian{axis}": axis.lower() for axis in "XYZ"},
    **{f"color{name}": name.lower() for name in ("Red", "Green", "Blue")},
    **{f"nor:normal{axis}": f"n{axis.lower()}" for axis in "XYZ"},
    "intensity": "intensity",
    "timeStamp": "time",
}


MAX_COLOUR_RANGE = 2.0**32
"""A float without limits holds more."""


def colour_range(header: Any, libe57: Any) -> tuple[float, float]:
    """Least and largest colour of an E57 scan: by its limits, else by what its type holds; 0 and 255 by none."""
    if header.node.isDefined("colorLimits/colorRedMaximum"):
        limits = header.node["colorLimits"]
        least, most = (float(limits[f"colorRed{end}"].value()) for end in ("Minimum", "Maximum"))
    else:
        red = libe57.StructureNode(header.points.prototype())["colorRed"]
        least, most = float(red.minimum()), float(red.maximum())
    return (least, most) if 0 < most - least < MAX_COLOUR_RANGE else (0.0, 255.0)

"""NPZ: arrays `points` (height, width, 3) or (n, 3), and further ones of the same height and width, or n.

`normals` become nx, ny, nz; three or four channels of 8 or 16 bits are colours, others are columns of their own.
"""

import io
import zipfile
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from registration.errors import CloudFormatError, CloudUnsupported
from registration.io.durable_file import GuardedFile
from registration.io.formats.header import CloudSource
from registration.points.layout import COLOURS, Layout, Records

MAX_FILE_BYTES = 2_000_000_000
"""Largest NPZ, packed or unpacked."""
POINTS = ("points", "points_mm", "xyz", "pointcloud", "point_cloud")
NORMALS = ("normals", "normal")
BLOCK_POINTS = 1 << 14


def read_whole(file: GuardedFile, name: str) -> tuple[NDArray[Any], dict[str, NDArray[Any]]]:
    """The points (..., 3), and the other arrays of numbers of the same pixels. Raises CloudError's leaves."""
    from calibration.documents.imports.refusal import DAMAGED_ARCHIVE  # loads pydantic

    size = file.seek(0, 2)
    if size > MAX_FILE_BYTES:
        raise CloudUnsupported(name, "file", "it is larger than 2 GB", "give one view of the camera")
    file.seek(0)
    content = file.read(size)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > MAX_FILE_BYTES:
                raise CloudUnsupported(name, "file", "it unpacks to more than 2 GB", "give one view of the camera")
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            held = {str(key).lower(): np.asarray(arrays[key]) for key in arrays.files}
    except DAMAGED_ARCHIVE as error:
        raise CloudFormatError(name, "file", f"this is no NPZ of arrays ({error})", "write it again") from None
    names = ", ".join(held) or "none"
    key = next((key for key in POINTS if key in held), "")
    points = held.pop(key, np.zeros(0))
    if points.ndim not in (2, 3) or points.shape[-1] != 3 or points.dtype.kind not in "iuf":
        what = f"there is no array 'points' of (height, width, 3) among {names}"
        raise CloudFormatError(name, "arrays", what, "write np.savez(file, points=..., intensity=...)")
    pixels = points.shape[:-1]
    beside = {
        key: array for key, array in held.items() if array.dtype.kind in "iuf" and array.shape[: len(pixels)] == pixels
    }
    return points, {key: array for key, array in beside.items() if array.ndim - len(pixels) in (0, 1)}


def npz_source(file: GuardedFile, name: str) -> CloudSource:
    """A whole NPZ as one sequence of points, row by row. Raises CloudError's leaves."""
    columns = _columns(*read_whole(file, name))
    layout, count = Layout.of(np.dtype([(key, column.dtype) for key, column in columns.items()])), len(columns["x"])

    def blocks() -> Iterator[Records]:
        for start in range(0, count, BLOCK_POINTS):
            block = np.empty(min(BLOCK_POINTS, count - start), layout.dtype)
            for key, column in columns.items():
                block[key] = column[start : start + BLOCK_POINTS]
            yield block

    return CloudSource(layout, count, blocks)


def _columns(points: NDArray[Any], beside: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Native columns (n,) by their common names."""
    kind = points.dtype.newbyteorder("=") if points.dtype.kind == "f" and points.dtype.itemsize > 2 else np.dtype(float)
    columns = {axis: points[..., index].ravel().astype(kind) for index, axis in enumerate("xyz")}
    for key, array in beside.items():
        native = array.astype(array.dtype.newbyteorder("="), copy=False)
        channels = [native] if native.ndim < points.ndim else list(np.moveaxis(native, -1, 0))
        names = _names(key, array, len(channels))
        columns |= {name: channel.ravel() for name, channel in zip(names, channels, strict=True)}
    return columns


def _names(key: str, array: NDArray[Any], channels: int) -> list[str]:
    """Names of an array's channels; a fourth one of colours is no colour."""
    if channels == 1:
        return [key]
    if channels == 3 and key in NORMALS:
        return ["nx", "ny", "nz"]
    if channels in (3, 4) and array.dtype in (np.uint8, np.uint16):
        return [*COLOURS, "alpha"][:channels]
    return [f"{key}_{index}" for index in range(channels)]

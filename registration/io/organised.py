"""Reads organised clouds: a point and an intensity for every pixel of a 3D camera.

PCD holds width and height. PLY does not: they stand in its header as `obj_info num_cols` and `num_rows`, or are given
by the caller. NPZ holds arrays: `points` (height, width, 3) and `intensity` (height, width[, channels]).
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from registration.errors import CloudFormatError, CloudUnsupported
from registration.io.durable_file import GuardedFile
from registration.io.formats.header import HEADER_LIMIT
from registration.io.formats.npz import read_whole
from registration.io.formats.pcl import SHIFTS, unpack_colour
from registration.io.reading import open_cloud
from registration.points.layout import Array
from registration.points.rigid_motion import scale_to_mm

MAX_PIXELS = 64_000_000

INTENSITY = ("intensity", "grey", "gray", "luminance", "reflectance", "texture", "image", "scalar_intensity")
COLOURS = (("red", "green", "blue"), ("r", "g", "b"))
PACKED_COLOURS = ("rgb", "rgba")
SIZES = (
    (re.compile(rb"^WIDTH\s+(\d+)", re.M), re.compile(rb"^HEIGHT\s+(\d+)", re.M)),
    (re.compile(rb"^obj_info\s+num_cols\s+(\d+)", re.M), re.compile(rb"^obj_info\s+num_rows\s+(\d+)", re.M)),
    (re.compile(rb"^comment\s+width:?\s+(\d+)", re.M | re.I), re.compile(rb"^comment\s+height:?\s+(\d+)", re.M | re.I)),
)


@dataclass(frozen=True, eq=False)
class OrganisedCloud:
    """`intensity` (h, w), of any range; `points_mm` (h, w, 3), NaN where a pixel has no point."""

    intensity: NDArray[Any]
    points_mm: Array


def read_organised(path: Path, unit: str, size: tuple[int, int] | None = None) -> OrganisedCloud:
    """The cloud in `path`, whose lengths are in `unit`; `size` (width, height) where the file does not hold it.

    Raises CloudError's leaves, UnitUnknown.
    """
    scale = scale_to_mm(unit)
    columns = _npz_columns(path) if path.suffix.lower() == ".npz" else _file_columns(path, size)
    points = scale * np.stack([columns[name].astype(np.float64) for name in ("x", "y", "z")], axis=-1)
    points[~np.all(np.isfinite(points), axis=2) | np.all(points == 0, axis=2)] = np.nan
    return OrganisedCloud(_intensity(columns, path.name), points)


def _file_columns(path: Path, size: tuple[int, int] | None) -> Mapping[str, NDArray[Any]]:
    """Columns (h, w) of a PLY or PCD file."""
    with open_cloud(path) as cloud:
        dtype = cloud.layout.dtype
        wanted = [name for name in dtype.names or () if dtype[name].shape == ()]
        if cloud.count is not None and cloud.count > MAX_PIXELS:
            what = f"{cloud.count} points are more than a camera's pixels"
            raise CloudUnsupported(path.name, "header", what, "give one view of the camera")
        blocks = [block[wanted].copy() for block in cloud.blocks()]
    rows = np.concatenate(blocks) if blocks else np.zeros(0, dtype)[wanted]
    width, height = _size(path, size)
    if width * height != len(rows) or min(width, height) < 2:
        what = f"{len(rows)} points are no picture of {width} x {height} pixels"
        raise CloudUnsupported(path.name, "header", what, "write the cloud organised, with a point for every pixel")
    return {name: rows[name].reshape(height, width) for name in wanted}


def _size(path: Path, given: tuple[int, int] | None) -> tuple[int, int]:
    """Width and height from the header, else as `given`."""
    with GuardedFile.reading(path, path.name) as file:
        header = file.read(HEADER_LIMIT)
    for across, down in SIZES:
        found = across.search(header), down.search(header)
        if found[0] is not None and found[1] is not None and int(found[1][1]) > 1:
            return int(found[0][1]), int(found[1][1])
    if given is None:
        what, fix = "width and height are not in the file", "give image_size, or write an organised PCD or NPZ"
        raise CloudUnsupported(path.name, "header", what, fix)
    return given


def _npz_columns(path: Path) -> Mapping[str, NDArray[Any]]:
    with GuardedFile.reading(path, path.name) as file:
        points, beside = read_whole(file, path.name)
    if points.ndim != 3:
        fix = "write np.savez(file, points=..., intensity=...) with points of (height, width, 3)"
        raise CloudFormatError(path.name, "arrays", "its points are no picture of a camera's pixels", fix)
    columns = {axis: points[:, :, index] for index, axis in enumerate("xyz")}
    for key, array in beside.items():
        if array.ndim == 2:
            columns[key] = array
        elif array.shape[2] in (1, 3, 4):
            columns[INTENSITY[0]] = array[:, :, :3].mean(axis=2)
    return columns


def _intensity(columns: Mapping[str, NDArray[Any]], name: str) -> NDArray[Any]:
    known = {key.lower(): column for key, column in columns.items()}
    for key in INTENSITY:
        if key in known:
            return known[key]
    for channels in COLOURS:
        if set(channels) <= known.keys():
            return np.asarray(np.mean([known[channel].astype(np.float32) for channel in channels], axis=0))
    for key in PACKED_COLOURS:
        if key in known and known[key].dtype.itemsize == 4:
            return np.asarray(np.mean([unpack_colour(key, colour, known) for colour in SHIFTS], axis=0))
    what = f"there is no intensity among {', '.join(known)}"
    raise CloudUnsupported(name, "columns", what, "write the cloud with intensity or colour")

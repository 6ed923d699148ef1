"""Reads profiles (.npz, .csv) and robot paths (.csv) from files."""

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.documents.imports.refusal import DAMAGED_ARCHIVE
from calibration.errors import GeometryError
from calibration.transforms import Array, transform_from_quaternion
from registration.documents import TimeUnit
from registration.errors import CloudIOError, PathError, ProfileError
from registration.io.regular_file import read_regular
from registration.profiles.gocator import is_gocator, read_gocator
from registration.profiles.profile_block import ProfileBlock
from registration.profiles.robot_path import RobotPath

SECONDS: dict[TimeUnit, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "us/1.024": 1e-6 / 1.024}
"""Per unit; the last is the internal unit in which LMI's sensors export times."""

MAX_FILE_BYTES = 1 << 31
"""Of a file, and of the arrays in it: 100 s of 1,280 points at 2,000 profiles a second."""
ARRAYS = ("time", "x_mm", "z_mm")
POINT_COLUMNS = "time,x_mm,z_mm"
POSE_COLUMNS = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz"


def read_profiles(file: Path, time_unit: TimeUnit = "s") -> ProfileBlock:
    """All profiles of a file. Raises CloudIOError, ProfileError."""
    content = _read(file)
    if file.suffix.lower() == ".npz":
        times, x, z = _arrays(content, file.name)
    elif is_gocator(content):
        times, x, z = read_gocator(content, file.name)
    else:
        times, x, z = _profiles_of_rows(_table(content, POINT_COLUMNS, file.name, ProfileError), file.name)
    try:
        return ProfileBlock.of(times * SECONDS[time_unit], x, z)
    except ProfileError as error:
        raise ProfileError(f"{file.name}: {error.what}", error.fix) from None


def read_path(file: Path) -> RobotPath:
    """The poses of a path, columns POSE_COLUMNS. Raises CloudIOError, PathError."""
    rows = _table(_read(file), POSE_COLUMNS, file.name, PathError)
    try:
        return RobotPath.of(rows[:, 0], transform_from_quaternion(rows[:, 1:4], rows[:, 4:]))
    except GeometryError as error:
        raise PathError(f"{file.name}: {error}", "give unit quaternions, w first") from None
    except PathError as error:
        raise PathError(f"{file.name}: {error.what}", error.fix) from None


def _read(file: Path) -> bytes:
    try:
        return read_regular(file, MAX_FILE_BYTES)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise CloudIOError(file.name, "file", f"it cannot be read ({reason})", "check path and rights") from None


def _arrays(content: bytes, name: str) -> tuple[Array, NDArray[Any], NDArray[Any]]:
    fix = f"give a .npz file with the arrays {', '.join(ARRAYS)} of numbers"
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            sizes = {member.filename: member.file_size for member in archive.infolist()}
            missing = [one for one in ARRAYS if f"{one}.npy" not in sizes]
            if missing:
                raise ProfileError(f"{name}: the array {missing[0]} is missing", fix)
            if sum(sizes.values()) > MAX_FILE_BYTES:
                raise ProfileError(f"{name}: it unpacks to more than {MAX_FILE_BYTES >> 30} GB", "split the sweep")
            times, x, z = (np.lib.format.read_array(io.BytesIO(archive.read(f"{one}.npy"))) for one in ARRAYS)
    except DAMAGED_ARCHIVE as error:
        raise ProfileError(f"{name}: no .npz file ({str(error)[:80]})", fix) from None
    if any(array.dtype.kind not in "iuf" for array in (times, x, z)):
        raise ProfileError(f"{name}: an array holds no numbers", fix)
    return times, x, z


def _table(content: bytes, columns: str, name: str, error_of: type[ProfileError] | type[PathError]) -> Array:
    """Rows (n, columns) of numbers under a header. Raises `error_of`."""
    fix = f"give a .csv file in UTF-8 whose first line is {columns}, and numbers with decimal points below"
    header, _, rest = content.partition(b"\n")
    found = header.decode("utf-8", "replace").lstrip("\ufeff").strip().replace(" ", "")
    if found != columns:
        raise error_of(f"{name}: the first line is {found[:60]!r}", fix)
    if not rest.strip():
        raise error_of(f"{name}: there are no rows", fix)
    try:
        rows = np.loadtxt(io.BytesIO(rest), delimiter=",", ndmin=2, comments=None)
    except (ValueError, OverflowError) as error:
        raise error_of(f"{name}: {str(error)[:80]}", fix) from None
    if rows.shape[1] != columns.count(",") + 1:
        raise error_of(f"{name}: rows have {rows.shape[1]} numbers", fix)
    return rows


def _profiles_of_rows(rows: Array, name: str) -> tuple[Array, Array, Array]:
    """Rows of one point each; those in a row with one time are a profile. Raises ProfileError."""
    starts = np.flatnonzero(np.concatenate([[True], np.diff(rows[:, 0]) != 0]))
    counts = np.diff(np.append(starts, len(rows)))
    if len(starts) * int(counts.max()) * 16 > MAX_FILE_BYTES:
        raise ProfileError(f"{name}: profiles differ too much in their number of points", "split the sweep")
    x, z = (np.full((len(starts), int(counts.max())), np.nan) for _ in range(2))
    profile = np.repeat(np.arange(len(starts)), counts)
    place = np.arange(len(rows)) - np.repeat(starts, counts)
    x[profile, place], z[profile, place] = rows[:, 1], rows[:, 2]
    return rows[starts, 0], x, z

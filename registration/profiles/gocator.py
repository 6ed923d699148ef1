"""Reads the CSV that Gocator line profile sensors export: its sections Profile and RawProfile.

Source: LMI Technologies, Gocator Line Profile Sensors User Manual, "CSV File Format": sections from a line with the
name to a line "End"; attributes, then rows of Frame, Source, Time, Encoder, Z Encoder, Inputs, Exposure, Y, Axis and
values. Knowledge base 7064-YOVB-9866 for the unit of the times.
"""

import csv
import io
from collections.abc import Iterator
from itertools import takewhile

import numpy as np

from calibration.transforms import Array
from registration.errors import ProfileError

SECTIONS = ("Profile", "RawProfile")
MAX_VALUES = 1 << 27
"""Of all profiles together, those that the widest has: 1 GB."""
FIX = "export the recording from the sensor's web page as CSV, in Profile mode"


def is_gocator(content: bytes) -> bool:
    """Whether the first line is that of such a file."""
    return content[:16].lstrip(b"\xef\xbb\xbf").split(b"\n")[0].strip(b"\r ,") == b"Info"


def read_gocator(content: bytes, name: str) -> tuple[Array, Array, Array]:
    """Times (n,) in the file's unit, x (n, m) and z (n, m) in mm, NaN without a point. Raises ProfileError."""
    text = io.TextIOWrapper(io.BytesIO(content), "utf-8-sig", "replace", newline="")
    try:
        return _profiles((row for row in csv.reader(text) if any(cell.strip() for cell in row)), name)
    except csv.Error as error:
        raise ProfileError(f"{name}: {error}", FIX) from None


def _profiles(rows: Iterator[list[str]], name: str) -> tuple[Array, Array, Array]:
    """As `read_gocator`; each row becomes numbers before the next is read. Raises ProfileError, csv.Error."""
    section, header, body = _section(rows, name)
    time, axis = header.index("Time"), header.index("Axis")
    profiles: dict[str, dict[str, Array]] = {}
    times: dict[str, float] = {}
    for line in body:
        if len(line) <= max(time, axis):
            raise ProfileError(f"{name}: a row of {section} has {len(line)} values", FIX)
        frame, kind = ",".join(line[:time]), line[axis].strip().upper()
        profiles.setdefault(frame, {})[kind] = _numbers(line[axis + 1 :])
        times.setdefault(frame, float(_numbers([line[time]])[0]))
    frames = [frame for frame, found in profiles.items() if "Z" in found and ("X" in found or section == "Profile")]
    if not frames:
        raise ProfileError(
            f"{name}: {section} has no rows of the axis Z{'' if section == 'Profile' else ' and X'}", FIX
        )
    along = _numbers(header[axis + 1 :])
    width = max(len(profiles[frame]["Z"]) for frame in frames)
    if len(frames) * width > MAX_VALUES:
        raise ProfileError(f"{name}: {len(frames)} profiles with up to {width} values are too many", "split the sweep")
    z = np.stack([_widen(profiles[frame]["Z"], width) for frame in frames])
    x = np.stack([_widen(profiles[frame].get("X", along), width) for frame in frames])
    return np.array([times[frame] for frame in frames]), x, z


def _section(rows: Iterator[list[str]], name: str) -> tuple[str, list[str], Iterator[list[str]]]:
    """The name, header and rows of the first section with profiles. Raises ProfileError."""
    names = (row[0].strip() for row in rows if not any(map(str.strip, row[1:])))
    section = next((found for found in names if found in SECTIONS), None)
    if section is None:
        raise ProfileError(f"{name}: it has no section {' or '.join(SECTIONS)}", FIX)
    body = takewhile(lambda row: row[0].strip() != "End", rows)
    for row in body:
        header = [cell.strip() for cell in row]
        if "Time" in header and "Axis" in header:
            return section, header, body
    raise ProfileError(f"{name}: {section} has no row with the names Time and Axis", FIX)


def _numbers(cells: list[str]) -> Array:
    """(n,): NaN for what is no number."""
    return np.array([_number(cell) for cell in cells], float)


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return np.nan


def _widen(values: Array, width: int) -> Array:
    """The first `width` values (width,), with NaN after the last."""
    return np.concatenate([values[:width], np.full(max(width - len(values), 0), np.nan)])

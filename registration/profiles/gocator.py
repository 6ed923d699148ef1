"""Reads the CSV that Gocator line profile sensors export: its sections Profile and RawProfile.

Source: LMI Technologies, Gocator Line Profile Sensors User Manual, "CSV File Format": sections from a line with the
name to a line "End"; attributes, then rows of Frame, Source, Time, Encoder, Z Encoder, Inputs, Exposure, Y, Axis and
values. Knowledge base 7064-YOVB-9866 for the unit of the times.
"""

import csv
import io

import numpy as np

from calibration.transforms import Array
from registration.errors import ProfileError

SECTIONS = ("Profile", "RawProfile")
FIX = "export the recording from the sensor's web page as CSV, in Profile mode"


def is_gocator(content: bytes) -> bool:
    """Whether the first line is that of such a file."""
    return content[:16].lstrip(b"\xef\xbb\xbf").split(b"\n")[0].strip(b"\r ,") == b"Info"


def read_gocator(content: bytes, name: str) -> tuple[Array, Array, Array]:
    """Times (n,) in the file's unit, x (n, m) and z (n, m) in mm, NaN without a point. Raises ProfileError."""
    text = content.decode("utf-8", "replace").lstrip("\ufeff")
    try:
        rows = [row for row in csv.reader(io.StringIO(text)) if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise ProfileError(f"{name}: {error}", FIX) from None
    section, header, body = _section(rows, name)
    time, axis = header.index("Time"), header.index("Axis")
    profiles: dict[str, dict[str, Array]] = {}
    times: dict[str, float] = {}
    for line in body:
        if len(line) <= axis:
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
    z = np.stack([_widened(profiles[frame]["Z"], width) for frame in frames])
    x = np.stack([_widened(profiles[frame].get("X", along), width) for frame in frames])
    return np.array([times[frame] for frame in frames]), x, z


def _section(rows: list[list[str]], name: str) -> tuple[str, list[str], list[list[str]]]:
    """The name, header and rows of the first section with profiles. Raises ProfileError."""
    starts = [
        index for index, row in enumerate(rows) if row[0].strip() in SECTIONS and not any(map(str.strip, row[1:]))
    ]
    if not starts:
        raise ProfileError(f"{name}: it has no section {' or '.join(SECTIONS)}", FIX)
    section, body = rows[starts[0]][0].strip(), rows[starts[0] + 1 :]
    ends = [index for index, row in enumerate(body) if row[0].strip() == "End"]
    body = body[: ends[0] if ends else len(body)]
    for index, row in enumerate(body):
        header = [cell.strip() for cell in row]
        if "Time" in header and "Axis" in header:
            return section, header, body[index + 1 :]
    raise ProfileError(f"{name}: {section} has no row with the names Time and Axis", FIX)


def _numbers(cells: list[str]) -> Array:
    """(n,): NaN for what is no number."""
    return np.array([_number(cell) for cell in cells], float)


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return np.nan


def _widened(values: Array, width: int) -> Array:
    """The first `width` values (width,), with NaN after the last."""
    return np.concatenate([values[:width], np.full(max(width - len(values), 0), np.nan)])

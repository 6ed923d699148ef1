"""Coordinates of a 3D camera in mm, by the features of the standard's chapter "3D Scan Control" (GenICam SFNC 2.7).

Codes: GenICam Pixel Format Naming Convention (PFNC) 2.4.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.cameras.genicam.device import RawPicture
from drivers.errors import GarbledAnswer, IncompletePicture, SettingRefused

MAX_PIXELS = 64_000_000
UNITS_MM = {"Millimeter": 1.0, "Inch": 25.4, "Meter": 1000.0}
GRID, DEPTH = "CalibratedABC_Grid", "ProjectedC"
"""Output modes: a point for each pixel, or its depth along the optical axis."""
SCAN3D_WORDS = ("Scan3dOutputMode", "Scan3dCoordinateSystem", "Scan3dDistanceUnit")
SCAN3D_LENS = {"Scan3dFocalLength": 0.0, "Scan3dAspectRatio": 1.0,
               "Scan3dPrincipalPointU": 0.0, "Scan3dPrincipalPointV": 0.0}  # fmt: skip
"""Features of the lens with what stands where a camera has none."""


@dataclass(frozen=True)
class CoordinateFormat:
    """`channels` of a pixel: 3 for A, B and C, 1 for C alone."""

    name: str
    channels: int
    dtype: str


COORDINATES = {
    0x011000B8: CoordinateFormat("Coord3D_C16", 1, "<u2"),
    0x012000BF: CoordinateFormat("Coord3D_C32f", 1, "<f4"),
    0x023000B9: CoordinateFormat("Coord3D_ABC16", 3, "<u2"),
    0x026000C0: CoordinateFormat("Coord3D_ABC32f", 3, "<f4"),
}
"""By code."""


@dataclass(frozen=True)
class Coordinate:
    """One axis: length = scale * number + offset. `invalid`: the number of a pixel without a point, None for none.

    `limits`: least and greatest number that a point has.
    """

    scale: float = 1.0
    offset: float = 0.0
    invalid: float | None = None
    limits: tuple[float, float] | None = None


@dataclass(frozen=True)
class Scan3d:
    """How numbers become mm: the axes A, B, C, the unit of their lengths, and for depth the lens in pixels."""

    axes: tuple[Coordinate, Coordinate, Coordinate]
    mode: str = GRID
    unit_mm: float = 1.0
    focal_length_px: float = 0.0
    aspect_ratio: float = 1.0
    principal_point_px: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class RangeImage:
    """Points (h, w, 3) in mm, NaN where a pixel has none, and the intensity (h, w) or (h, w, 3) BGR of the pixels."""

    points_mm: NDArray[np.float32]
    taken_at_s: float
    intensity: NDArray[Any] | None = None


def read_scan3d(
    device: str, words: Mapping[str, str], axes: tuple[Coordinate, Coordinate, Coordinate], lens: Sequence[float]
) -> Scan3d:
    """The settings of features by name; `lens` in the order of SCAN3D_LENS. Raises SettingRefused."""
    mode = words.get("Scan3dOutputMode", GRID)
    if mode not in (GRID, DEPTH):
        raise SettingRefused(device, f"the output mode is {mode}", f"write ?Scan3dOutputMode={GRID}, or {DEPTH}")
    system = words.get("Scan3dCoordinateSystem", "Cartesian")
    if system != "Cartesian":
        raise SettingRefused(device, f"the coordinates are {system}", "write ?Scan3dCoordinateSystem=Cartesian")
    unit = words.get("Scan3dDistanceUnit", "Millimeter")
    if unit not in UNITS_MM:
        raise SettingRefused(device, f"the distances are in {unit}", "write ?Scan3dDistanceUnit=Millimeter")
    focal_length_px, aspect_ratio, u_px, v_px = lens
    if mode == DEPTH and not (focal_length_px > 0 and aspect_ratio > 0):
        what = "it sends depth, and no focal length to place it with"
        raise SettingRefused(device, what, f"write ?Scan3dOutputMode={GRID}")
    return Scan3d(axes, mode, UNITS_MM[unit], focal_length_px, aspect_ratio, (u_px, v_px))


def points_of(device: str, settings: Scan3d, picture: RawPicture) -> NDArray[np.float32]:
    """Points (h, w, 3) in mm, NaN where a pixel has none. Raises GarbledAnswer, IncompletePicture.

    A pixel has none where C, or every flagged axis if C is not, has its invalid value, or an axis is beyond its limits.
    """
    coordinates = COORDINATES[picture.format_code]
    expected = 3 if settings.mode == GRID else 1
    if coordinates.channels != expected:
        what = f"{coordinates.name} does not go with the output mode {settings.mode}"
        raise GarbledAnswer(
            device, what, "set PixelFormat to " + ("Coord3D_ABC32f" if expected == 3 else "Coord3D_C16")
        )
    numbers = _numbers(device, coordinates, picture)
    used = settings.axes if coordinates.channels == 3 else settings.axes[2:]
    flagged = [index for index, axis in enumerate(used) if axis.invalid is not None]
    deciding = flagged[-1:] if flagged[-1:] == [len(used) - 1] else flagged
    absent = ~np.all(np.isfinite(numbers), axis=2)
    if deciding:
        absent |= np.logical_and.reduce([numbers[..., index] == np.float32(used[index].invalid) for index in deciding])
    for index, axis in enumerate(used):
        if axis.limits is not None:
            absent |= (numbers[..., index] < axis.limits[0]) | (numbers[..., index] > axis.limits[1])
    scale, offset = (np.array([getattr(axis, name) for axis in used]) for name in ("scale", "offset"))
    points = settings.unit_mm * (numbers * scale + offset)
    if settings.mode == DEPTH:
        points = _projected(settings, points[..., 0])
    points[absent] = np.nan
    return np.asarray(points, np.float32)


def _numbers(device: str, coordinates: CoordinateFormat, picture: RawPicture) -> NDArray[Any]:
    """The camera's numbers (h, w, channels), as float64."""
    width, height = picture.width, picture.height
    if not 0 < width * height <= MAX_PIXELS:
        raise GarbledAnswer(device, f"a cloud of {width}×{height} pixels", "check the camera's region of interest")
    row_bytes = width * coordinates.channels * np.dtype(coordinates.dtype).itemsize
    needed = height * (row_bytes + picture.padding) - picture.padding
    if picture.data.size < needed:
        raise IncompletePicture(device, f"{picture.data.size} bytes of a cloud came, {needed} make it whole")
    rows = np.zeros(height * (row_bytes + picture.padding), np.uint8)
    rows[:needed] = picture.data[:needed]
    whole = np.ascontiguousarray(rows.reshape(height, -1)[:, :row_bytes])
    return whole.view(coordinates.dtype).reshape(height, width, coordinates.channels).astype(np.float64)


def _projected(settings: Scan3d, depth_mm: NDArray[Any]) -> NDArray[Any]:
    """Points (h, w, 3) of pixels whose centres have whole numbers: x = z (u - u0) / f, y = z (v - v0) / (f aspect)."""
    rows, columns = np.indices(depth_mm.shape)
    u_px, v_px = settings.principal_point_px
    x = depth_mm * (columns - u_px) / settings.focal_length_px
    y = depth_mm * (rows - v_px) / (settings.focal_length_px * settings.aspect_ratio)
    return np.stack([x, y, depth_mm], axis=-1)

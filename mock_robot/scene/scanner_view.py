"""Simulates the cloud of a structured-light scanner by casting one ray per grid point on the true skin.

Scanner frame as the camera's, z along the view. A ray that meets no metal within the measuring range gives no point.
The profiles of a laser triangulation sensor are cast alike: a fan of light in its plane y = 0, z along it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.targets import Target
from calibration.transforms import Array
from mock_robot.scene.camera_view import render
from mock_robot.scene.optics import Optics
from mock_robot.scene.part import DOOR, Door
from mock_robot.scene.printed_target import PrintOptions
from registration.io.formats import pcd, ply
from registration.points.layout import XYZ_FLOAT32, Layout

NEWTON_STEPS = 5
TRACING_STEPS = 80
STEP_TOLERANCE_MM = 1e-6


@dataclass(frozen=True)
class ScannerModel:
    """`columns` × `rows` rays of a pinhole of `focal` px (400 mm × 300 mm at 600 mm), measuring in `range_mm`.

    Noise along the ray is `noise_mm` at `reference_mm` and normal incidence; it grows with the distance squared and
    with 1 / cos of the angle of incidence. Points fade out between the two angles `fading_deg`.
    """

    columns: int = 640
    rows: int = 480
    focal: float = 960.0
    range_mm: tuple[float, float] = (450.0, 950.0)
    reference_mm: float = 600.0
    noise_mm: float = 0.04
    fading_deg: tuple[float, float] = (55.0, 72.0)

    def rays(self) -> Array:
        """Unit directions (rows × columns, 3) in the scanner frame, row by row."""
        x = (np.arange(self.columns) - (self.columns - 1) / 2) / self.focal
        y = (np.arange(self.rows) - (self.rows - 1) / 2) / self.focal
        directions = np.stack([*np.meshgrid(x, y), np.ones((self.rows, self.columns))], axis=-1).reshape(-1, 3)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return directions


def scan(
    scanner: ScannerModel, part_T_scanner: Sequence[Array], rng: np.random.Generator, door: Door = DOOR
) -> NDArray[np.float32]:
    """Points (n, 3) in the scanner frame, mm; the rows are taken at these poses, evenly in time (one pose at rest)."""
    rays = scanner.rays()
    bands = np.array_split(rays, len(part_T_scanner))
    cast_bands = [cast(scanner, pose, band, door) for pose, band in zip(part_T_scanner, bands, strict=True)]
    distance, cosine = (np.concatenate(values) for values in zip(*cast_bands, strict=True))
    return _add_noise(scanner, rays, distance, cosine, rng)


def cast(scanner: ScannerModel, part_T_scanner: Array, rays: Array, door: Door = DOOR) -> tuple[Array, Array]:
    """Distance (n,) along each ray to the first metal, NaN where there is none, and the cosine of incidence there."""
    origin, directions = part_T_scanner[:3, 3], rays @ part_T_scanner[:3, :3].T
    distance = np.full(len(rays), np.nan)
    cosine = np.zeros(len(rays))
    ahead = np.flatnonzero(directions[:, 2] < -1e-6)
    direction = directions[ahead]
    furthest = scanner.range_mm[1]
    t = np.clip(origin[2] / -direction[:, 2], 0.0, 2 * furthest)  # the skin lies below z = 0 everywhere
    t = _trace(door, origin, direction, t, furthest)
    hit = origin + t[:, None] * direction
    normal = door.normal(hit[:, 0], hit[:, 1])
    facing = -np.sum(normal * direction, axis=1)
    near, far = scanner.range_mm
    reached = np.abs(hit[:, 2] - door.height(hit[:, 0], hit[:, 1])) < 2 * STEP_TOLERANCE_MM
    seen = reached & (facing > 0) & (t * rays[ahead, 2] > near) & (t * rays[ahead, 2] < far)
    seen[seen] = door.edge_distance(hit[seen, 0], hit[seen, 1]) < 0
    distance[ahead[seen]] = t[seen]
    cosine[ahead] = np.maximum(facing, 0.0)
    return distance, cosine


def _trace(door: Door, origin: Array, direction: Array, t: Array, furthest_mm: float) -> Array:
    """Distance to the first hit of the skin, ignoring cut-outs.

    Newton steps to the envelope cannot pass it, since it is concave. Where the skin lies below it (the recess), sphere
    tracing (Hart, 1996) continues: the bounded slope keeps its steps from crossing the skin.
    """
    for _ in range(NEWTON_STEPS):
        x, y, z = (origin + t[:, None] * direction).T
        along_x, along_y = door.envelope_slope(x, y)
        closing = along_x * direction[:, 0] + along_y * direction[:, 1] - direction[:, 2]
        t = t + (z - door.envelope(x, y)) / np.maximum(closing, 1e-3)  # a ray that does not approach gets a far point
        t = np.minimum(t, 2 * furthest_mm)
    x, y, z = (origin + t[:, None] * direction).T
    active = np.flatnonzero(z - door.height(x, y) > STEP_TOLERANCE_MM)
    closing = np.abs(direction[:, 2]) + door.steepest * np.hypot(direction[:, 0], direction[:, 1])
    for _ in range(TRACING_STEPS):
        if not len(active):
            break
        x, y, z = (origin + t[active, None] * direction[active]).T
        gap = z - door.height(x, y)
        t[active] += np.maximum(gap, 0.0) / closing[active]
        active = active[(gap > STEP_TOLERANCE_MM) & (t[active] < 2 * furthest_mm)]
    return t


def _add_noise(
    scanner: ScannerModel, rays: Array, distance: Array, cosine: Array, rng: np.random.Generator
) -> NDArray[np.float32]:
    full, none = np.cos(np.radians(scanner.fading_deg))
    kept = np.isfinite(distance) & (rng.random(len(distance)) < (cosine - none) / (full - none))
    distance, cosine = distance[kept], np.maximum(cosine[kept], none)
    spread = scanner.noise_mm * (distance / scanner.reference_mm) ** 2 / cosine
    noisy = distance + spread * rng.standard_normal(len(distance))
    points: NDArray[np.float32] = (rays[kept] * noisy[:, None]).astype(np.float32)
    return points


def cloud_ply(points: NDArray[np.float32]) -> bytes:
    """Binary PLY, x y z as float32, mm."""
    records = np.ascontiguousarray(points, "<f4")
    return ply.format_header(XYZ_FLOAT32, len(points)) + records.tobytes()


COLUMNS = Layout.of(np.dtype([(name, "<f4") for name in ("x", "y", "z", "intensity")]))


def organised_pcd(
    scanner: ScannerModel,
    target: Target,
    scanner_T_target: Array,
    optics: Optics,
    rng: np.random.Generator,
    sheet: PrintOptions | None = None,
) -> bytes:
    """A PCD of rows × columns points, in mm, of the target's plane, with noise along each ray; NaN out of range."""
    centre = [(scanner.columns - 1) / 2, (scanner.rows - 1) / 2]
    matrix = np.array([[scanner.focal, 0, centre[0]], [0, scanner.focal, centre[1]], [0, 0, 1.0]])
    lens = CameraModel(matrix, np.zeros(5), (scanner.columns, scanner.rows))
    picture = render(lens, target, scanner_T_target, optics, rng, sheet)
    rays, normal = scanner.rays(), scanner_T_target[:3, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (normal @ scanner_T_target[:3, 3]) / (rays @ normal)
    depth = distance * rays[:, 2]
    near, far = scanner.range_mm
    distance[~((depth > near) & (depth < far))] = np.nan
    distance = distance + rng.normal(0.0, scanner.noise_mm, distance.shape) * (distance / scanner.reference_mm) ** 2
    rows = np.column_stack([rays * distance[:, None], picture.reshape(-1)]).astype("<f4")
    return pcd.format_header(COLUMNS, len(rows), rows=scanner.rows) + rows.tobytes()


@dataclass(frozen=True)
class ProfilerModel:
    """`columns` points across a fan of twice `half_angle_deg`, measured within `range_mm` of z with `noise_mm`."""

    columns: int = 320
    half_angle_deg: float = 15.0
    range_mm: tuple[float, float] = (300.0, 700.0)
    noise_mm: float = 0.04

    def slopes(self) -> Array:
        """x / z (columns,) of the light."""
        widest = float(np.tan(np.radians(self.half_angle_deg)))
        return np.linspace(-widest, widest, self.columns)

    def measured(self, z: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """x and z (n, columns) with noise, NaN out of range."""
        near, far = self.range_mm
        with np.errstate(invalid="ignore"):
            seen = np.where((z > near) & (z < far), z + rng.normal(0, self.noise_mm, z.shape), np.nan)
        return self.slopes() * seen, seen


def profile_door(profiler: ProfilerModel, part_T_profiler: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """x and z (n, columns) in mm of the door's skin from poses (n, 4, 4), NaN beside the metal."""
    slopes = profiler.slopes()
    length = np.hypot(slopes, 1.0)
    rays = np.column_stack([slopes, np.zeros_like(slopes), np.ones_like(slopes)]) / length[:, None]
    scanner = ScannerModel(range_mm=profiler.range_mm)
    z = np.array([cast(scanner, pose, rays, DOOR)[0] / length for pose in part_T_profiler])
    return profiler.measured(z, rng)

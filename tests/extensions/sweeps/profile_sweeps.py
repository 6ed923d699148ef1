"""Sweeps of a line profiler over a sphere and over planes, with the errors of arm and sensor."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibration.kinematics.robot_accuracy import RobotNoise
from calibration.transforms import Array, inverse, quaternion_from_rotation, rotation_from_vector, transform
from registration.profiles.files import POSE_COLUMNS
from registration.profiles.profile_block import ProfileBlock
from registration.profiles.robot_path import RobotPath
from tests.support.profile_files import write_npz

FLANGE_T_PROFILER = transform(rotation_from_vector([0.25, -0.4, 1.3]), [60.0, -35.0, 110.0])
CENTRE_MM = np.array([900.0, 120.0, 250.0])
RADIUS_MM = 25.0
PLANES = (
    (np.array([900.0, 120.0, 200.0]), np.array([0.0, 0.0, 1.0])),
    (np.array([900.0, 120.0, 200.0]), np.array([0.6, 0.0, 0.8])),
    (np.array([900.0, 120.0, 200.0]), np.array([-0.3, 0.7, 0.65]) / np.linalg.norm([-0.3, 0.7, 0.65])),
)
OFFSET_S = 0.042
SPEED_MM_S = 100.0
POSES_HZ, PROFILES_HZ = 100.0, 200.0


@dataclass(frozen=True)
class SensorNoise:
    """Standard deviations: of a point in mm, of a pose's time in s."""

    point_mm: float = 0.02
    time_s: float = 0.0


def sweep(
    surface: int | None,
    random: np.random.Generator,
    robot: RobotNoise,
    noise: SensorNoise = SensorNoise(),
    *,
    tilt: float = 0.45,
    columns: int = 160,
    along: Array | None = None,
    offset_s: float = OFFSET_S,
    spread_mm: float = 12.0,
    turning_rad_s: float = 0.02,
) -> tuple[ProfileBlock, RobotPath]:
    """One sweep across the sphere (None) or a plane by its number, from a random side and in a random direction.

    `along`: the direction of travel in the profiler frame, by default near its y, either way.
    """
    normal = np.array([0.0, 0.0, 1.0]) if surface is None else PLANES[surface][1]
    aim = CENTRE_MM if surface is None else PLANES[surface][0]
    looking = _facing(normal) @ rotation_from_vector(random.normal(0, tilt, 3)) if tilt else _facing(normal)
    if along is None:
        along = random.choice([-1, 1]) * np.array([random.normal(0, 0.3), 1.0, random.normal(0, 0.1)])
    along = along / np.linalg.norm(along)
    middle_at = np.array([random.normal(0, spread_mm), 0.0, 180.0 + random.normal(0, 1.5 * spread_mm)])
    length_s = 90.0 / SPEED_MM_S
    error = transform(
        rotation_from_vector(random.normal(0, robot.rotation_rad, 3)), random.normal(0, robot.translation_mm, 3)
    )
    turn = random.normal(0, turning_rad_s, 3)

    def reported(times: Array) -> Array:
        """base_T_flange; the sensor looks from aim at time 0 and travels along `along` of its own frame."""
        shift = SPEED_MM_S * times[:, None] * along
        rotation = looking @ rotation_from_vector(times[:, None] * turn)
        at = aim - (rotation @ middle_at) + shift @ looking.T
        return transform(rotation, at) @ inverse(FLANGE_T_PROFILER)

    times = np.arange(-length_s / 2 - 0.15, length_s / 2 + 0.15, 1 / POSES_HZ)
    path = RobotPath.of(5.0 + times, reported(times + random.normal(0, noise.time_s, len(times))))
    at = np.arange(-length_s / 2, length_s / 2, 1 / PROFILES_HZ)
    base_T_profiler = reported(at) @ error @ FLANGE_T_PROFILER
    x = np.linspace(-45, 45, columns)
    z = profile_of(surface, base_T_profiler, x)
    return ProfileBlock.of(5.0 + at - offset_s, x, z + random.normal(0, noise.point_mm, z.shape)), path


def profile_of(surface: int | None, base_T_profiler: Array, x: Array) -> Array:
    """z (n, m) at which the light at x (m,) meets the sphere before its table, or a plane; NaN beyond 400 mm."""
    place, normal = PLANES[surface] if surface is not None else (CENTRE_MM - [0, 0, 60.0], np.array([0.0, 0.0, 1.0]))
    rotation, origin = base_T_profiler[:, :3, :3], base_T_profiler[:, :3, 3]
    from_origin = ((place - origin) @ normal)[:, None] - (rotation[:, :, 0] @ normal)[:, None] * x
    z: Array = from_origin / (rotation[:, :, 2] @ normal)[:, None]
    if surface is None:
        centre = np.einsum("nji,nj->ni", rotation, CENTRE_MM - origin)
        square = RADIUS_MM**2 - centre[:, 1:2] ** 2 - (x - centre[:, :1]) ** 2
        front = centre[:, 2:] - np.sqrt(np.maximum(square, 0.0))
        z = np.where(square > 0.1 * RADIUS_MM**2, front, z)
    return np.where((z > 50) & (z < 400), z, np.nan)


def sweeps(
    surfaces: Sequence[int | None], seed: int, robot: RobotNoise, noise: SensorNoise = SensorNoise()
) -> list[tuple[ProfileBlock, RobotPath]]:
    """One sweep for each entry: None the sphere, else a plane's number."""
    random = np.random.default_rng(seed)
    return [sweep(surface, random, robot, noise) for surface in surfaces]


def write_folder(
    folder: Path, surfaces: Sequence[int | None], data: Sequence[tuple[ProfileBlock, RobotPath]], artefacts: bool = True
) -> None:
    """profiles.json with its files; the sphere is called ball, a plane by its number."""
    folder.mkdir(parents=True, exist_ok=True)
    listed = []
    for index, (surface, (block, path)) in enumerate(zip(surfaces, data, strict=True)):
        write_npz(folder / f"sweep_{index}.npz", block)
        rows = np.column_stack([
            path.times_s, path.base_T_flange[:, :3, 3], quaternion_from_rotation(path.base_T_flange[:, :3, :3]),
        ])  # fmt: skip
        np.savetxt(folder / f"path_{index}.csv", rows, "%.9f", ",", header=POSE_COLUMNS, comments="")
        name = ("ball" if surface is None else f"plane {surface}") if artefacts else None
        listed.append({"profiles": f"sweep_{index}.npz", "path": f"path_{index}.csv", "artefact": name})
    known = [{"name": "ball", "radius_mm": RADIUS_MM}, *({"name": f"plane {n}", "radius_mm": None} for n in range(3))]
    document = {"schema_version": 1, "time_unit": "s", "artefacts": known, "sweeps": listed}
    (folder / "profiles.json").write_text(json.dumps(document))


EDGE = (PLANES[1], (PLANES[0][0], np.array([-0.6, 0.0, 0.8])))
"""Two faces that meet along y, as place and normal."""


def standing_profiles(folder: Path, seed: int, count: int = 14, *, sphere: bool) -> None:
    """profile_NN.csv of the sphere, or of the edge of EDGE, at each pose of poses.csv, with the errors of an arm."""
    folder.mkdir(parents=True, exist_ok=True)
    random, x, rows = np.random.default_rng(seed), np.linspace(-30, 30, 241), []
    for at in range(count):
        looking = _facing(np.array([0.0, 0.0, 1.0])) @ rotation_from_vector(random.normal(0, [0.35, 0.35, 0.6]))
        middle = np.array([random.normal(0, 4), random.normal(0, 5) if sphere else 0.0, 180 + random.normal(0, 20)])
        aim = CENTRE_MM if sphere else PLANES[0][0]
        base_T_profiler = transform(looking, aim - looking @ middle)
        if sphere:
            z = profile_of(None, base_T_profiler[None], x)[0]
        else:  # of two faces that fall away from their edge the farther point is hidden
            z = np.max([_depths(base_T_profiler, x, *face) for face in EDGE], axis=0)
        z = z + random.normal(0, 0.01, len(z))
        seen = np.isfinite(z)
        np.savetxt(folder / f"profile_{at:02}.csv", np.column_stack([x, z])[seen], "%.4f", ",", header="x_mm,z_mm",
                   comments="")  # fmt: skip
        flange = base_T_profiler @ inverse(FLANGE_T_PROFILER)
        flange[:3, 3] += random.normal(0, 0.03, 3)
        numbers = [*flange[:3, 3], *quaternion_from_rotation(flange[:3, :3])]
        rows.append(f"profile_{at:02}.csv," + ",".join(f"{number:.7f}" for number in numbers))
    (folder / "poses.csv").write_text("\n".join(["profile,x_mm,y_mm,z_mm,qw,qx,qy,qz", *rows[::-1]]) + "\n")


def _depths(base_T_profiler: Array, x: Array, place: Array, normal: Array) -> Array:
    """z (m,) at which the light at x (m,) meets a plane."""
    towards = normal @ base_T_profiler[:3, :3]
    depths: Array = (normal @ (place - base_T_profiler[:3, 3]) - towards[0] * x) / towards[2]
    return depths


def _facing(normal: Array) -> Array:
    """base_R_profiler (3, 3) whose z looks against a normal."""
    across = np.cross(normal, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    return np.column_stack([across, np.cross(-normal, across), -normal])

"""A made-up part and views of it, with known truth."""

import itertools
import json
from pathlib import Path

import numpy as np

from calibration.documents.pose import PoseDocument
from calibration.problem import Setup
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform
from registration.io.writing import new_cloud
from registration.points.layout import XYZ_FLOAT32
from registration.scan import ScannerMount

FLANGE_T_CAMERA = transform(rotation_from_vector([0.02, -0.1, 0.8]), [60.0, -30.0, 60.0])
HAND = ScannerMount("calibration-1", FLANGE_T_CAMERA)


def bumpy(x: Array, y: Array) -> Array:
    """Height of a panel with hills that fix all six directions."""
    height: Array = 12 * np.sin(x / 23) * np.cos(y / 31) + 6 * np.sin(x / 9 + y / 17)
    return height


def flat(x: Array, y: Array) -> Array:
    return 0 * x


def poses(count: int, seed: int = 1) -> list[Array]:
    """base_T_flange above the part, looking down, each a little turned and shifted."""
    random = np.random.default_rng(seed)
    down = rotation_from_vector([np.pi, 0, 0])
    return [
        transform(rotation_from_vector(random.normal(0, 0.2, 3)) @ down, [*random.normal(0, 15, 2), 400.0])
        for _ in range(count)
    ]


def view_of(height: object, base_T_camera: Array, seed: int, noise_mm: float = 0.02, at: float = 0.0) -> Array:
    """Points (n, 3) in the camera's frame: another random half of the part each time."""
    random = np.random.default_rng(seed)
    x, y = random.uniform(-60, 60, (2, 7000))
    points = np.stack([x + at, y, height(x, y)], axis=1)  # type: ignore[operator]
    return map_points(inverse(base_T_camera), points + random.normal(0, noise_mm, points.shape))


def wrong(base_T_flange: Array, translation_mm: float, rotation_deg: float, seed: int) -> Array:
    """What the robot says when it errs."""
    random = np.random.default_rng(seed)
    error = transform(
        rotation_from_vector(random.normal(0, np.deg2rad(rotation_deg), 3)), random.normal(0, translation_mm, 3)
    )
    return base_T_flange @ error


def write_scan(
    folder: Path, clouds: list[Array], said: list[Array], unit: str = "mm", setup: Setup = "eye-in-hand"
) -> None:
    """scan.json and its clouds (given in mm)."""
    views = []
    for index, (points, base_T_flange) in enumerate(zip(clouds, said, strict=True)):
        records = np.ascontiguousarray(points / (1000 if unit == "m" else 1), np.float32).view(XYZ_FLOAT32.dtype)[:, 0]
        with new_cloud(folder / f"view_{index:03}.ply", XYZ_FLOAT32) as writer:
            writer.write(records)
        pose = PoseDocument.of(base_T_flange).model_dump()
        views.append({"cloud": f"view_{index:03}.ply", "unit": unit, "base_T_flange": pose})
    scan = {"schema_version": 1, "source": "a made-up part", "setup": setup, "views": views}
    (folder / "scan.json").write_text(json.dumps(scan))


def ticks() -> object:
    return itertools.count().__next__

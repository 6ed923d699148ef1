"""Taught scan poses: flange poses whose views together cover the part."""

import numpy as np

from calibration.transforms import Array, inverse, transform
from mock_robot.scene.part import DOOR, Door
from mock_robot.truth.truth import CellTruth, Nominal

DISTANCE_MM = 740.0
COLUMNS_MM = (-450.0, -150.0, 150.0, 450.0)
ROWS_MM = (-155.0, 155.0)
"""Views are half a metre wide: they overlap and reach past the door's edge although guess and rack are slightly off."""


def scan_poses_of(truth: CellTruth) -> list[Array]:
    """base_T_flange of each taught view, from nominal data only. None of a scanner that stands."""
    return scan_poses(truth.nominal) if truth.setup == "eye-in-hand" else []


def scan_poses(nominal: Nominal, door: Door = DOOR) -> list[Array]:
    """Poses row by row in alternating direction, for a short path; the camera looks along the skin's normal."""
    camera_T_flange = inverse(nominal.mount_T_camera)
    poses = []
    for row, y in enumerate(ROWS_MM):
        for x in COLUMNS_MM if row % 2 == 0 else COLUMNS_MM[::-1]:
            part_T_camera = _looking_at(x, y, door)
            poses.append(nominal.base_T_part @ part_T_camera @ camera_T_flange)
    return poses


def _looking_at(x: float, y: float, door: Door) -> Array:
    """part_T_camera at DISTANCE_MM from the skin at (x, y), its x along the door, its y down."""
    aim = np.array([x, y, float(door.height(np.array(x), np.array(y)))])
    out = np.array([x / door.radius_along, y / door.radius_up, 1.0])
    out /= np.linalg.norm(out)
    down = np.cross(-out, [1.0, 0.0, 0.0])
    down /= np.linalg.norm(down)
    rotation = np.column_stack([np.cross(down, -out), down, -out])
    return transform(rotation, aim + DISTANCE_MM * out)

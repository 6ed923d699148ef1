"""A tip, and poses in which it touches the board of the fake cell."""

from typing import Any

import numpy as np

from calibration.documents.pose import PoseDocument
from calibration.transforms import Array, map_points, rotation_from_vector, transform
from tests.daemon.cell_under_test import Bench
from tests.daemon.fakes import BASE_T_TARGET, BOARD

TIP_MM = np.array([5.0, -10.0, 200.0])
TIP = {"flange_tip_mm": TIP_MM.tolist(), "covariance": (0.01 * np.eye(3)).tolist(), "placing_sigma_mm": 0.1}


def pose_at(point_mm: Array) -> Array:
    """base_T_flange (4, 4) with the tip at the point of the base."""
    rotation = rotation_from_vector([np.pi, 0, 0.3])
    return transform(rotation, point_mm - rotation @ TIP_MM)


def touching(identity: int, off_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
    """The pose in which the tip touches a point of the board, `off_mm` beside."""
    return pose_at(map_points(BASE_T_TARGET, BOARD.points_mm[[identity]])[0] + off_mm)


def json_of(pose: Array) -> dict[str, Any]:
    return PoseDocument.of(pose).model_dump(mode="json")


async def touch_two_points(bench: Bench) -> list[int]:
    """Store a touch test of the first two points of the cross; returns the points of the cross."""
    run = (await bench.client.get("/runs?kind=verify")).json()["runs"][0]
    cross: list[int] = run["result"]["verification"]["cross"]
    given = [{"id": point, "base_T_flange": json_of(touching(point, (0.3 * point, 0, 0)))} for point in cross[:2]]
    body = {"tip": TIP, "verification": run["id"], "touches": given, "tolerance_mm": 1.0}
    made = await bench.client.post("/touch", json=body)
    assert made.status_code == 201, made.text
    return cross

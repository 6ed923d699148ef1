"""Where a line profiler stands before the mock cell's door."""

import numpy as np

from calibration.transforms import Array, transform
from mock_robot.scene.part import DOOR
from mock_robot.truth.truth import CellTruth

STAND_OFF_MM = 450.0


def base_T_profiler_before_door(truth: CellTruth, x: float, y: float) -> Array:
    """The profiler (4, 4) STAND_OFF_MM before (x, y) of the door, the laser line up the door, by the nominal rack."""
    slope_y = -y / DOOR.radius_up
    out = np.array([0.0, -slope_y, 1.0]) / np.hypot(slope_y, 1.0)
    along = np.array([1.0, 0.0, 0.0])
    rotation = np.column_stack([np.cross(along, -out), along, -out])
    aim = np.array([x, y, float(DOOR.height(np.array(x), np.array(y)))])
    base_T_profiler: Array = truth.nominal.base_T_part @ transform(rotation, aim + STAND_OFF_MM * out)
    return base_T_profiler

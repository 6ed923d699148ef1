"""The part as points."""

import numpy as np

from calibration.transforms import Array
from mock_robot.scene.part import DOOR, Door


def surface_samples(step_mm: float, door: Door = DOOR) -> Array:
    """Points (n, 3) on the metal in the part frame, one for each `step_mm` squared of its x-y area."""
    x, y = np.meshgrid(np.arange(-620.0, 620.0, step_mm), np.arange(-320.0, 320.0, step_mm))
    x, y = x.ravel(), y.ravel()
    metal = door.edge_distance(x, y) < 0
    x, y = x[metal], y[metal]
    return np.column_stack([x, y, door.height(x, y)])

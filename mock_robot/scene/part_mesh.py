"""The part as a triangle mesh, and as points."""

import numpy as np
from numpy.typing import NDArray

from calibration.transforms import Array
from mock_robot.scene.part import DOOR, Door


def mesh(step_mm: float = 8.0, door: Door = DOOR) -> tuple[Array, NDArray[np.int32]]:
    """Vertices (n, 3) in the part frame and triangles (m, 3) seen counter-clockwise; edge vertices lie on the edge."""
    x, y = np.meshgrid(np.arange(-640.0, 640.0, step_mm), np.arange(-340.0, 340.0, step_mm))
    index = np.arange(x.size, dtype=np.int32).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    flat = np.column_stack([x.ravel(), y.ravel()])
    metal = door.edge_distance(*flat.T) < 0
    triangles = triangles[metal[triangles].any(axis=1)]
    flat = door.onto_metal(flat)
    used, renumbered = np.unique(triangles, return_inverse=True)
    vertices = np.column_stack([flat[used], door.height(*flat[used].T)])
    return vertices, renumbered.reshape(triangles.shape).astype(np.int32)


def surface_samples(step_mm: float, door: Door = DOOR) -> Array:
    """Points (n, 3) on the metal in the part frame, one for each `step_mm` squared of its x-y area."""
    x, y = np.meshgrid(np.arange(-620.0, 620.0, step_mm), np.arange(-320.0, 320.0, step_mm))
    x, y = x.ravel(), y.ravel()
    metal = door.edge_distance(x, y) < 0
    x, y = x[metal], y[metal]
    return np.column_stack([x, y, door.height(x, y)])

"""Clouds the tests of the room share."""

import numpy as np
from numpy.typing import NDArray

from calibration.transforms import Array, map_points, rotation_from_vector, transform
from registration.points.layout import Layout, Records

BASE_T_CAMERA = transform(rotation_from_vector([0.1, 0.5, -0.3]), [100.0, -200.0, 300.0])

RICH = Layout.of(
    np.dtype(
        [(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")]
        + [(name, "u1") for name in ("red", "green", "blue")]
        + [("intensity", "<u2"), ("time", "<f8")]
    )
)


def cloud(layout: Layout, count: int, seed: int = 0) -> Records:
    """Random points about a metre wide, unit normals, and noise in every other column."""
    random = np.random.default_rng(seed)
    records = np.zeros(count, layout.dtype)
    for name in layout.dtype.names or ():
        kind = layout.dtype[name].base
        shape = records[name].shape
        high = 1000 if kind.kind == "f" else np.iinfo(kind).max
        records[name] = random.uniform(0 if kind.kind == "u" else -high, high, shape)
    if layout.normals:
        normals = random.normal(size=(count, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        for axis, name in enumerate(layout.normals):
            records[name] = normals[:, axis]
    return records


def xyz(records: Records, names: tuple[str, str, str] = ("x", "y", "z")) -> NDArray[np.float64]:
    """(n, 3)"""
    return np.stack([records[name].astype(float) for name in names], axis=1)


def moved(records: Records, base_T_camera: Array = BASE_T_CAMERA, scale: float = 1.0) -> NDArray[np.float64]:
    """What the plain formula says, in float64."""
    return map_points(base_T_camera, xyz(records) * scale)

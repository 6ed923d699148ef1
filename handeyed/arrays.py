"""Points and poses that a caller gives, checked before anything is placed by them."""

import numpy as np
from numpy.typing import ArrayLike

from calibration.errors import DocumentError
from calibration.observations.observations import rigid_mask
from calibration.transforms import Array

POINTS, POSE = "give (n, 3), a row for each point", "give (4, 4), with the translation in mm in the last column"


def as_points(points_mm: ArrayLike) -> Array:
    """Points (..., 3), NaN where a masked array is masked. Raises DocumentError: (3, n) and (n, 4) are no points."""
    points = _floats("points_mm", points_mm, POINTS)
    if points.size and points.shape[-1:] != (3,):
        raise DocumentError.one("register", "points_mm", f"an array {points.shape} holds no points", POINTS)
    return points if points.size else points.reshape(-1, 3)


def as_pose(base_T_flange: ArrayLike) -> Array:
    """A pose (4, 4). Raises DocumentError where it is transposed, scaled, mirrored or not finite."""
    pose = _floats("base_T_flange", base_T_flange, POSE)
    if pose.shape != (4, 4) or not rigid_mask(pose[None])[0] or not np.allclose(pose[3], [0, 0, 0, 1]):
        raise DocumentError.one("register", "base_T_flange", f"an array {pose.shape} that is no pose", POSE)
    return pose


def _floats(place: str, given: ArrayLike, fix: str) -> Array:
    try:
        if isinstance(given, np.ma.MaskedArray):
            given = np.ma.filled(np.ma.asarray(given, float), np.nan)
        floats: Array = np.asarray(given, float)
    except (TypeError, ValueError) as error:
        raise DocumentError.one("register", place, str(error), fix) from None
    return floats

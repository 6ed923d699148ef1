"""Offset of the centroid of a circle's image from the image of its centre, due to perspective and lens distortion.

Source: Heikkilä, "Geometric camera calibration using circular control points", 2000; here the rim is measured point by
point, so any camera model can be used.
"""

from collections.abc import Callable

import numpy as np

from calibration.transforms import Array

RIM_POINTS = 48


def circle_centre_bias(project: Callable[[Array], Array], centres: Array, radii: Array) -> Array:
    """Centroid minus projected centre (n, 2) in px, of circles with `centres` (n, 2) and `radii` (n,) in the plane.

    `project` maps plane points (m, 2) to pixels (m, 2).
    """
    angle = np.arange(RIM_POINTS) * (2 * np.pi / RIM_POINTS)
    rim = centres[:, None] + radii[:, None, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    middle = project(centres)
    polygon = project(rim.reshape(-1, 2)).reshape(rim.shape) - middle[:, None]
    following = np.roll(polygon, -1, axis=1)
    cross = polygon[..., 0] * following[..., 1] - polygon[..., 1] * following[..., 0]
    centroid = ((polygon + following) * cross[..., None]).sum(axis=1) / (3 * cross.sum(axis=1))[:, None]
    return np.asarray(centroid)

"""A sphere fixed in the base frame, and poses from which a camera on the flange sees it."""

import numpy as np

from calibration.transforms import Array, map_points, rotation_from_vector, transform
from tests.registration.parts import FLANGE_T_CAMERA

CENTRE_IN_BASE = np.array([120.0, -630.0, 70.0])


def cap(centre: Array, radius_mm: float, seed: int = 0, noise_mm: float = 0.05, count: int = 4000) -> Array:
    """The half of a sphere a camera at the origin sees."""
    random = np.random.default_rng(seed)
    directions = random.normal(size=(4 * count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    seen = directions[directions @ centre < -0.5 * np.linalg.norm(centre)][:count]
    points: Array = centre + seen * (radius_mm + random.normal(0, noise_mm, (len(seen), 1)))
    return points


def looks(count: int, seed: int = 0, tilt: float = 0.5) -> list[Array]:
    """base_T_flange from which the camera sees the sphere, each time elsewhere in its field."""
    random = np.random.default_rng(seed)
    poses = []
    for _ in range(count):
        rotation = rotation_from_vector(random.normal(0, tilt, 3)) @ rotation_from_vector([np.pi, 0, 0])
        seen = random.normal([0, 0, 320], [35, 35, 30])
        pose = transform(rotation, np.zeros(3))
        poses.append(transform(rotation, CENTRE_IN_BASE - map_points(pose @ FLANGE_T_CAMERA, seen[None])[0]))
    return poses

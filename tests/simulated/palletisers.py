"""Cells of an arm that turns its flange about the base's z only, and poses for it in any cell."""

import numpy as np

from calibration.camera import CameraModel
from calibration.problem import Setup, anchor_T_mount_of
from calibration.targets import Target
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform
from tests.simulated.sessions import BOARD, CAMERA, MARGIN_PX, Cell, CellNoise, observed

TOOL_DOWN = rotation_from_vector([np.pi, 0.0, 0.0])
TURN_RAD, AIM = 1.2, 0.2
"""Largest turn either way; the target's middle in the image, as a share of its distance from the camera."""


def palletiser_cell(seed: int, setup: Setup, views: int = 10, *, camera_given: bool = True) -> Cell:
    """A camera that leans by some degrees, or one above the arm with the target lying on the flange."""
    rng = np.random.default_rng(seed)
    leaning = rotation_from_vector(np.append(0.1 * rng.standard_normal(2), 0.0))
    turned = rotation_from_vector([0.0, 0.0, rng.uniform(-3.0, 3.0)])
    if setup == "eye-in-hand":
        X = transform(turned @ leaning, [*(80.0 * rng.standard_normal(2)), 60.0])
        Y = transform(rotation_from_vector([0.03, 0.02, 1.0]), [900.0, 100.0, -50.0])
    else:
        X = transform(TOOL_DOWN @ leaning, [900.0, 100.0, 1200.0])
        Y = transform(turned @ leaning, [60.0, -40.0, -30.0])
    poses = upright_poses(rng, setup, BOARD, CAMERA, X, Y, views, (450.0, 650.0))
    return observed(rng, setup, BOARD, poses, X, Y, CellNoise(), camera_given=camera_given)


def upright_poses(
    rng: np.random.Generator,
    setup: Setup,
    target: Target,
    camera: CameraModel,
    X: Array,
    Y: Array,
    count: int,
    distances_mm: tuple[float, float],
) -> Array:
    """base_T_flange (count, 4, 4), the flange's z down, from which the camera sees the whole target."""
    middle, found = target.points_mm.mean(axis=0, keepdims=True), []
    while len(found) < count:
        turn = rotation_from_vector([0.0, 0.0, rng.uniform(-TURN_RAD, TURN_RAD)]) @ TOOL_DOWN
        seen = rng.uniform(*distances_mm) * np.array([[*rng.uniform(-AIM, AIM, 2), 1.0]])
        on_flange, in_base = (map_points(X, seen), map_points(Y, middle))
        if setup == "eye-to-hand":
            on_flange, in_base = map_points(Y, middle), map_points(X, seen)
        pose = transform(turn, in_base[0] - turn @ on_flange[0])
        pixels = camera.project(map_points(inverse(anchor_T_mount_of(setup, pose) @ X) @ Y, target.points_mm))
        if np.all((pixels > MARGIN_PX) & (pixels < np.array(camera.image_size) - 1 - MARGIN_PX)):
            found.append(pose)
    return np.array(found)

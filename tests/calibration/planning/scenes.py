"""Scenes to plan for: the seed's own cell, with a board where its Tab. 1 puts the target."""

import numpy as np

from calibration.camera import CameraModel
from calibration.kinematics.stance import Stance
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, Scene
from calibration.planning.scene_belief import ScenePrior
from calibration.planning.viewpoints import ViewpointLimits, flange_poses, target_in_view
from calibration.problem import Detection, Problem, View
from calibration.targets import Chessboard
from calibration.transforms import (
    Array,
    inverse,
    map_points,
    nearest_rotation,
    rotation_from_vector,
    transform,
    transform_from_quaternion,
)

SEED_QUATERNIONS_WXYZ = (
    (0.169248, 0.338681, 0.630323, -0.677749),
    (0.316172, 0.159880, 0.408206, -0.841333),
    (0.00599902, -0.481792, -0.759899, 0.436341),
)
SEED_TRANSLATIONS_MM = ((128.36, -394.44, 1051.65), (155.78, -204.38, 979.51), (77.6, -584.51, 1036.17))
SEED_X = (
    (0.4610, 0.2494, -0.9623, -101.2112),
    (-0.9766, -0.0254, -0.4631, 285.4014),
    (-0.0684, 0.9882, 0.2537, 538.4676),
)
SEED_TARGET_CENTRE_MM = (7.8773, -396.5096, 835.4014)

GOOD_NOISE = ExpectedNoise(image_px=0.05, robot_rotation_rad=float(np.deg2rad(0.005)), robot_translation_mm=0.05)
WIDE = ViewpointLimits(tilt_rad=float(np.deg2rad(45)), roll_rad=np.pi, distance_mm=(450.0, 750.0))


def seed_poses() -> Array:
    """base_T_flange (3, 4, 4) as printed."""
    return transform_from_quaternion(SEED_TRANSLATIONS_MM, SEED_QUATERNIONS_WXYZ)


def seed_scene(noise: ExpectedNoise = GOOD_NOISE, intrinsics_free: bool = False) -> Scene:
    """The seed's X (made rigid) and a chessboard that faces its three cameras at the target of Tab. 1."""
    printed = np.array(SEED_X)
    flange_T_camera = inverse(transform(nearest_rotation(printed[:, :3])[0], printed[:, 3]))
    z = (seed_poses() @ flange_T_camera)[:, :3, 2].mean(axis=0)
    z /= np.linalg.norm(z)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    rotation = np.column_stack([x, np.cross(z, x), z])
    board = Chessboard(11, 8, 20.0)
    origin = np.array(SEED_TARGET_CENTRE_MM) - rotation @ board.points_mm.mean(axis=0)
    camera = CameraModel(np.array([[2400.0, 0, 640], [0, 2400, 512], [0, 0, 1]]), np.zeros(5), (1280, 1024))
    return Scene("eye-in-hand", board, camera, flange_T_camera, transform(rotation, origin), noise, intrinsics_free)


TRUTH = seed_scene()


LOOK = flange_poses(TRUTH, np.array([[0.05, 0.1, 0.3, 650.0, 0.1, -0.1]]))[0]


def guess_off(
    translation_mm: float, rotation_deg: float, *, direction: int = 0, intrinsics_known: bool = True
) -> ScenePrior:
    """A guess of X that is off by so much, in one of a few directions."""
    rng = np.random.default_rng(direction)
    turn, shift = (v / np.linalg.norm(v) for v in rng.standard_normal((2, 3)))
    off = transform(rotation_from_vector(np.radians(rotation_deg) * turn), translation_mm * shift)
    camera = TRUTH.camera if intrinsics_known else None
    return ScenePrior("eye-in-hand", TRUTH.target, camera, TRUTH.mount_T_camera @ off, None, GOOD_NOISE)


def problem_of(poses: list[Array], camera: object = TRUTH.camera) -> Problem:
    """What an exact camera on an exact robot sees, with a little noise; a target mostly outside is not found."""
    rng, views = np.random.default_rng(1), []
    for index, pose in enumerate(poses):
        camera_T_target = TRUTH.camera_T_target(pose[None])[0]
        points = map_points(camera_T_target, TRUTH.target.points_mm)
        pixels = TRUTH.camera.project(points) + rng.normal(0, 0.05, (len(points), 2))
        found = bool(target_in_view(TRUTH, pose[None])[0] > 0.6)
        views.append(View(index, Stance(pose), Detection(np.arange(len(points)), pixels) if found else None))
    return Problem("eye-in-hand", TRUTH.target, camera, TRUTH.camera.image_size, tuple(views))  # type: ignore[arg-type]

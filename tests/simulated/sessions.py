"""Cells with known truth: points projected through a known X, with noise on pixels and on robot poses."""

from dataclasses import dataclass, replace

import numpy as np

from calibration.camera import CameraModel
from calibration.kinematics.stance import Stance
from calibration.knowledge import NOTHING_STATED, Knowledge
from calibration.likelihood.nuisances import Nuisances
from calibration.problem import Detection, Problem, Setup, View
from calibration.targets import Chessboard, Target
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform

CAMERA = CameraModel(
    np.array([[2400.0, 0, 1223.5], [0, 2400.0, 1023.5], [0, 0, 1]]),
    np.array([-0.1, 0.05, 1e-4, -2e-4, 0.0]),
    (2448, 2048),
)
BOARD = Chessboard(11, 8, 15.0)
MARGIN_PX = 10
STAND_MM = (800.0, 2000.0)
"""Distance of a standing camera from the robot's base."""


@dataclass(frozen=True)
class CellNoise:
    """One standard deviation per axis."""

    image_px: float = 0.05
    robot_rotation_rad: float = float(np.radians(0.005))
    robot_translation_mm: float = 0.05


@dataclass(frozen=True, eq=False)
class Cell:
    """A session and the truth behind it; `base_T_flange` (n, 4, 4) is where the arm really stood."""

    problem: Problem
    mount_T_camera: Array
    anchor_T_target: Array
    camera: CameraModel
    base_T_flange: Array


def random_cell(
    rng: np.random.Generator,
    views: int,
    noise: CellNoise,
    *,
    setup: Setup = "eye-in-hand",
    camera_given: bool = True,
    target: Target = BOARD,
    tilt_rad: float = float(np.radians(35.0)),
    knowledge: Knowledge | None = None,
) -> Cell:
    """`views` pictures of the target from 450 to 650 mm, tilted by up to `tilt_rad` and rolled at will.

    `knowledge`: the problem states it, and lens and print are off by as much; without it they are as described.
    """
    on_flange = transform(rotation_from_vector(rng.standard_normal(3)), 80 * rng.standard_normal(3))
    in_cell = transform(rotation_from_vector(rng.standard_normal(3)), 500 * rng.standard_normal(3))
    X, Y = (on_flange, in_cell) if setup == "eye-in-hand" else (on_a_stand(rng, in_cell), on_flange)
    camera_T_target = np.array([looking(rng, target, tilt_rad) for _ in range(views)])
    base_T_flange = Y @ inverse(X @ camera_T_target) if setup == "eye-in-hand" else X @ camera_T_target @ inverse(Y)
    stated = knowledge or NOTHING_STATED
    nuisances = Nuisances.of(CAMERA, target.points_mm, stated, estimated=not camera_given)
    z = np.zeros(len(nuisances))
    if knowledge is not None:
        z[nuisances.first_known :] = nuisances.prior.usual**-0.5 * rng.standard_normal(len(z) - nuisances.first_known)
    camera, points_mm = nuisances.camera_at(z), nuisances.points_at(z)
    seen = observed(
        rng, setup, target, base_T_flange, X, Y, noise, camera=camera, camera_given=camera_given, points_mm=points_mm
    )
    given = CAMERA if camera_given else None
    return replace(seen, problem=replace(seen.problem, camera=given, knowledge=stated))


def on_a_stand(rng: np.random.Generator, base_T_camera: Array) -> Array:
    """The camera in the same direction from the base, and as far as stands are: 0.8 to 2 m."""
    direction = base_T_camera[:3, 3] / np.linalg.norm(base_T_camera[:3, 3])
    return transform(base_T_camera[:3, :3], rng.uniform(*STAND_MM) * direction)


def observed(
    rng: np.random.Generator,
    setup: Setup,
    target: Target,
    base_T_flange: Array,
    X: Array,
    Y: Array,
    noise: CellNoise,
    *,
    camera: CameraModel = CAMERA,
    camera_given: bool = True,
    points_mm: Array | None = None,
) -> Cell:
    """What a camera sees when the robot reports the poses (n, 4, 4); where the arm stands differs by its error.

    `points_mm` (k, 3): where the target's points really are; as described without it.
    """
    points_mm = target.points_mm if points_mm is None else points_mm
    n = len(base_T_flange)
    errors = transform(
        rotation_from_vector(noise.robot_rotation_rad * rng.standard_normal((n, 3))),
        noise.robot_translation_mm * rng.standard_normal((n, 3)),
    )
    stands = base_T_flange @ inverse(errors)
    camera_T_target = inverse((stands if setup == "eye-in-hand" else inverse(stands)) @ X) @ Y
    views = []
    for index, (pose, seen) in enumerate(zip(base_T_flange, camera_T_target, strict=True)):
        pixels = camera.project(map_points(seen, points_mm))
        pixels = pixels + noise.image_px * rng.standard_normal(pixels.shape)
        views.append(View(index, Stance(pose), Detection(np.arange(len(pixels)), pixels)))
    problem = Problem(setup, target, camera if camera_given else None, camera.image_size, tuple(views))
    return Cell(problem, X, Y, camera, stands)


def looking(rng: np.random.Generator, target: Target = BOARD, tilt_rad: float = float(np.radians(35.0))) -> Array:
    """camera_T_target with the whole target in the image."""
    centre = target.points_mm.mean(axis=0)
    while True:
        axis = rng.standard_normal(3)
        tilt = rotation_from_vector(axis / np.linalg.norm(axis) * tilt_rad * rng.uniform(0.3, 1.0))
        turn = rotation_from_vector([0.0, 0.0, rng.uniform(-np.pi, np.pi)]) @ tilt
        distance = rng.uniform(450, 650)
        where = distance * np.array([rng.uniform(-0.1, 0.1), rng.uniform(-0.08, 0.08), 1.0])
        pose = transform(turn, where - turn @ centre)
        pixels = CAMERA.project(map_points(pose, target.points_mm))
        size = np.array(CAMERA.image_size)
        if np.all((pixels > MARGIN_PX) & (pixels < size - 1 - MARGIN_PX)):
            return pose

"""Sessions whose print, lens or arm is not as described: the truth is X in the arm's millimetres."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from calibration.camera import CameraModel
from calibration.kinematics.stance import Stance
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, predict
from calibration.planning.scene_belief import ScenePrior, infer_scene
from calibration.problem import Detection, Problem, Setup, View, anchor_T_mount_of, base_T_flange_of
from calibration.solve import estimate_hand_eye
from calibration.targets import Chessboard
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform, transform_from_vector
from tests.simulated.sessions import CellNoise

Poses = Literal["planned", "random"]

CAMERA = CameraModel(np.array([[2400.0, 0, 1223.5], [0, 2400.0, 1023.5], [0, 0, 1]]), np.zeros(5), (2448, 2048))
BOARD = Chessboard(12, 9, 20.0)
RADIAL = np.array([-0.1, 0.05, 0.0, 0.0])
"""Distortion of a camera that was calibrated without tangential terms."""

DISTANCES_MM = {"planned": (450.0, 750.0), "random": (500.0, 700.0)}
MARGIN_PX = 20
CORNER_PX = 1500.0
"""Radius at which `radial_px` is stated."""

LOW, HIGH = (CellNoise(0.05, float(np.radians(angle)), size) for angle, size in ((0.005, 0.05), (0.02, 0.2)))


@dataclass(frozen=True)
class Wrong:
    """How the truth differs from the description.

    size, focal, arm : of the print, the focal length and the arm's lengths, over what is described.
    centre_px, radial_px : the principal point along the diagonal; radial distortion at CORNER_PX.
    stretch, shear : of the print. bow_mm : along x, at 100 mm from the middle.
    tangential_px : at CORNER_PX on the diagonal, where it is largest, of a lens described as RADIAL.
    rectified : the lens has no radial distortion, and is described without any.
    keystone : by how much the print's upper edge is longer than its lower one.
    autofocus_mm : focal length of a lens that focuses by itself; as described at 600 mm.
    glass_mm : thickness of a plate of glass on the print.
    """

    size: float = 1.0
    focal: float = 1.0
    arm: float = 1.0
    centre_px: float = 0.0
    radial_px: float = 0.0
    stretch: float = 0.0
    shear: float = 0.0
    bow_mm: float = 0.0
    tangential_px: float = 0.0
    rectified: bool = False
    keystone: float = 0.0
    autofocus_mm: float = 0.0
    glass_mm: float = 0.0


FAULTS = {
    "none": Wrong(),
    **{f"size {size}": Wrong(size=size) for size in (0.95, 0.97, 0.98, 0.99, 0.995, 0.998, 1.003, 1.01)},
    **{f"focal {share:+.1f} %": Wrong(focal=1 + share / 100) for share in (-1.0, -0.7, -0.3, 0.7, 3.0)},
    **{f"centre {off} px": Wrong(centre_px=off) for off in (5, 15, 60)},
    **{f"arm {arm}": Wrong(arm=arm) for arm in (0.998, 1.004)},
    **{f"stretch {share} %": Wrong(stretch=share / 100) for share in (0.2, 0.5)},
    "shear 0.1 %": Wrong(shear=1e-3),
    **{f"bow {bow} mm": Wrong(bow_mm=bow) for bow in (0.3, 1.0)},
    "radial 0.5 px": Wrong(radial_px=0.5),
    **{f"tangential {off} px": Wrong(tangential_px=off) for off in (0.1, 0.5, 1.5)},
    "tangential, rectified": Wrong(tangential_px=1.5, rectified=True),
    "keystone 0.5 %": Wrong(keystone=5e-3),
    "autofocus": Wrong(autofocus_mm=8.0),
    "glass 5 mm": Wrong(glass_mm=5.0),
    "stretch with bow": Wrong(stretch=1e-3, bow_mm=0.2),
    "together": Wrong(0.992, 1.004, 1.001, 8.0, 0.3, 1e-3, 5e-4, 0.2),
}


@dataclass(frozen=True, eq=False)
class WrongSession:
    """The problem as described, and the true X with its translation in the arm's millimetres."""

    problem: Problem
    mount_T_camera: Array


def wrong_session(
    rng: np.random.Generator, views: int, wrong: Wrong, noise: CellNoise, setup: Setup, poses: Poses
) -> WrongSession:
    """A session of `views` views in front of a board of 11 x 8 corners, 20 mm apart."""
    X, _, base_T_flange, camera_T_target = _cell(rng, views, setup, poses)
    corners = true_corners(wrong)
    # The arm stands elsewhere than it reports, by its noise.
    errors = np.concatenate(
        [
            noise.robot_rotation_rad * rng.standard_normal((views, 3)),
            noise.robot_translation_mm * rng.standard_normal((views, 3)),
        ],
        axis=1,
    )
    reported = base_T_flange @ transform_from_vector(errors)
    reported[:, :3, 3] *= wrong.arm
    seen = []
    for index, (pose, at) in enumerate(zip(reported, camera_T_target, strict=True)):
        pixels = true_camera(wrong, float(map_points(at, corners)[:, 2].mean())).project(
            through_glass(wrong, at, corners)
        )
        pixels = pixels + noise.image_px * rng.standard_normal(pixels.shape)
        seen.append(View(index, Stance(pose), Detection(np.arange(len(pixels)), pixels)))
    in_arm = X.copy()
    in_arm[:3, 3] *= wrong.arm
    given = replace(CAMERA, distortion=RADIAL) if wrong.tangential_px and not wrong.rectified else CAMERA
    problem = Problem(setup, BOARD, given, CAMERA.image_size, tuple(seen), poses_from_controller=True)
    return WrongSession(problem, in_arm)


def planned_session(seed: int, views: int, noise: CellNoise) -> Problem:
    """A session as described, planned, in front of the camera on the flange."""
    return wrong_session(np.random.default_rng(seed), views, Wrong(), noise, "eye-in-hand", "planned").problem


def u_ratio(seed: int, views: int, noise: CellNoise) -> float:
    """U of a planned session over what was expected of it before its last view; infinite without X."""
    problem = planned_session(seed, views, noise)
    prior = ScenePrior(problem.setup, problem.target, CAMERA, None, None, ExpectedNoise(noise.image_px, 0.0, 0.0))
    scene = infer_scene(prior, replace(problem, views=problem.views[:-1])).scene
    expected = predict(scene, np.array([view.base_T_flange for view in problem.views])).worst_point
    found = estimate_hand_eye(problem).uncertainty
    return np.inf if found is None else found.worst_point.expanded_mm / expected.expanded_mm


def true_corners(wrong: Wrong) -> Array:
    """The print's corners (n, 3)."""
    nominal = BOARD.points_mm
    middle = nominal.mean(axis=0)
    x, y, z = (nominal - middle).T
    wider = wrong.stretch / 2 + wrong.keystone * y / np.ptp(y)
    along, across = x * (1 + wider) + wrong.shear * y, y * (1 - wrong.stretch / 2)
    return np.asarray(middle + wrong.size * np.column_stack([along, across, z + wrong.bow_mm * (x / 100) ** 2]))


def through_glass(wrong: Wrong, camera_T_target: Array, corners: Array) -> Array:
    """Points (n, 3) of the camera on whose lines of sight the corners appear, by Snell's law at the plate's surface."""
    if not wrong.glass_mm:
        return map_points(camera_T_target, corners)
    camera, seen = inverse(camera_T_target)[:3, 3], corners.copy()
    for _ in range(8):  # the line of sight, as it enters the glass, goes on to `seen` on the print
        along = seen - camera
        sine = np.linalg.norm(along[:, :2], axis=1) / np.linalg.norm(along, axis=1)
        outside, inside = np.tan(np.arcsin(sine)), np.tan(np.arcsin(sine / 1.5))
        away = along[:, :2] / np.maximum(np.linalg.norm(along[:, :2], axis=1, keepdims=True), 1e-9)
        seen[:, :2] = corners[:, :2] + wrong.glass_mm * (outside - inside)[:, None] * away
    return map_points(camera_T_target, seen)


def true_camera(wrong: Wrong, distance_mm: float) -> CameraModel:
    """The camera as it is, before a target at that distance."""
    matrix, distortion = CAMERA.matrix.copy(), CAMERA.distortion.copy()
    matrix[[0, 1], [0, 1]] *= wrong.focal * (1 + wrong.autofocus_mm / distance_mm) / (1 + wrong.autofocus_mm / 600)
    matrix[:2, 2] += wrong.centre_px * np.sqrt(0.5)
    distortion[0] = wrong.radial_px * matrix[0, 0] ** 2 / CORNER_PX**3
    if wrong.tangential_px:
        both = np.sqrt(0.5) * wrong.tangential_px * matrix[0, 0] / (3 * CORNER_PX**2)
        distortion = np.array([*(0 if wrong.rectified else 1) * RADIAL[:2], both, both])
    return replace(CAMERA, matrix=matrix, distortion=distortion)


def _cell(rng: np.random.Generator, views: int, setup: Setup, poses: Poses) -> tuple[Array, Array, Array, Array]:
    """X, the target's pose, the robot's poses (n, 4, 4) and the target's in the camera (n, 4, 4)."""
    phase = rng.uniform(0, 2 * np.pi)
    seen: list[Array] = []
    while len(seen) < views:
        looked = _planned(rng, len(seen), phase) if poses == "planned" else _random(rng)
        if _inside(looked):
            seen.append(looked)
    camera_T_target = np.array(seen)
    turn = rotation_from_vector(rng.uniform(-1, 1, 3) * np.pi)
    on_flange = transform(turn, rng.uniform(-150, 150, 3))
    if setup == "eye-in-hand":
        X, Y = on_flange, transform(rotation_from_vector(rng.uniform(-0.35, 0.35, 3)), np.array([900.0, 0, 300]))
        anchor_T_mount = Y @ inverse(X @ camera_T_target)
    else:
        looking = rotation_from_vector(rng.uniform(-1, 1, 3) * np.pi)
        X = transform(looking, np.array([900.0, 0, 600]) - looking @ np.array([0, 0, 600.0]))
        Y, anchor_T_mount = on_flange, inverse(X @ camera_T_target @ inverse(on_flange))
    base_T_flange = base_T_flange_of(setup, anchor_T_mount)
    assert np.allclose(anchor_T_mount_of(setup, base_T_flange), anchor_T_mount)
    return X, Y, base_T_flange, camera_T_target


def _planned(rng: np.random.Generator, index: int, phase: float) -> Array:
    """Tilts of 30 to 40 degrees about different axes, three distances, rolls by 45 and 90 degrees."""
    near, far = DISTANCES_MM["planned"]
    about = phase + 2 * np.pi * 0.618 * index + 0.1 * rng.standard_normal()
    distance = (far, near, (near + far) / 2)[index % 3] + rng.uniform(-0.08, 0.08) * (far - near)
    tilt = rotation_from_vector(np.radians(rng.uniform(30, 40)) * np.array([np.cos(about), np.sin(about), 0.0]))
    roll = np.radians((0, 90, -90, 45, -45)[index % 5] + rng.uniform(-20, 20))
    return _looking(tilt @ rotation_from_vector([0.0, 0.0, roll]), np.array([*rng.uniform(-60, 60, 2), distance]))


def _random(rng: np.random.Generator) -> Array:
    """Tilts up to 35 degrees about x and y, rolls up to 90 degrees, the board in the middle."""
    x, y = np.radians(rng.uniform(-35, 35, 2))
    turn = rotation_from_vector([x, 0.0, 0.0]) @ rotation_from_vector([0.0, y, 0.0])
    roll = rotation_from_vector([0.0, 0.0, np.radians(rng.uniform(-90, 90))])
    return _looking(turn @ roll, np.array([0.0, 0.0, rng.uniform(*DISTANCES_MM["random"])]))


def _looking(turn: Array, place: Array) -> Array:
    facing = rotation_from_vector([np.pi, 0.0, 0.0]) @ turn
    return transform(facing, place - facing @ BOARD.points_mm.mean(axis=0))


def _inside(camera_T_target: Array) -> bool:
    pixels = CAMERA.project(map_points(camera_T_target, BOARD.points_mm))
    return bool(np.all((pixels > MARGIN_PX) & (pixels < np.array(CAMERA.image_size) - 1 - MARGIN_PX)))

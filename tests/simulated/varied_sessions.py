"""Sessions of other boards, cameras and arms than the diagnosis was written on, posed by an arm's own axes.

Any of ABB's arms named here, its errors drawn by its class; the camera on the flange or in the cell; 8 to 60 views; the
axes recorded or not; the intrinsics given or not.
"""

import numpy as np

from calibration.camera import CameraModel
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import Arm, UnreachablePoseError
from calibration.kinematics.arm_errors import Postures
from calibration.kinematics.stance import Stance
from calibration.problem import Detection, Problem, View, anchor_T_mount_of, base_T_flange_of
from calibration.targets import Charuco, Chessboard, Target
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform
from mock_robot.arm.built_arm import ArmClass, build_arm
from tests.simulated.fault_kinds import Session
from tests.simulated.faults import SETUPS

ARMS = (
    "IRB 120-3/0.6",
    "CRB 15000-5/0.95",
    "IRB 1200-5/0.9",
    "IRB 1600-6/1.45",
    "IRB 2600-12/1.85",
    "IRB 4600-60/2.05",
    "IRB 6700-200/2.60",
)
CLASSES: tuple[ArmClass, ...] = ("perfect", "calibrated", "standard")
BOARDS: tuple[Target, ...] = (
    Charuco(7, 5, 30.0, 22.0, "DICT_4X4_50"),
    Charuco(14, 9, 20.0, 15.0, "DICT_5X5_100"),
    Charuco(10, 8, 12.0, 9.0, "DICT_6X6_100"),
    Chessboard(8, 5, 25.0),
    Chessboard(11, 8, 15.0),
)
SENSORS = ((1280, 1024), (1920, 1200), (2448, 2048), (4096, 3000))
FOCAL_OF_WIDTH = (0.9, 2.2)
BOARD_OF_IMAGE = (0.45, 0.75)
"""The board's diagonal as a share of the image's height."""

VIEWS = (8, 12, 20, 35, 60)
SHARE_JOINTS, SHARE_GIVEN = 0.5, 0.7
MIN_VIEWS_FREE = 12
REPEATABILITY_MM, REPEATABILITY_RAD = 0.02, float(np.radians(0.002))
MAX_TILT_RAD = float(np.radians(35.0))
MIDDLE = np.array([0.0, 0.2, 0.1, 0.0, 0.9, 0.0])
"""Axes about which the views are taken, rad."""

MAX_TRIES_OF_VIEW = 30


def varied(rng: np.random.Generator, share_joints: float = SHARE_JOINTS) -> Session:
    """A session without a fault besides those of its arm; `share_joints`: the chance that its joints are recorded."""
    while True:
        drawn = _varied(rng, share_joints)
        if drawn is not None:
            problem, joints = drawn
            return Session(problem, None, turned_back=_turned_back(joints))


def _turned_back(joints: Array) -> frozenset[int]:
    """The views whose axis 1 is more than 90 degrees from its median, when they are fewer than one in five."""
    rows = np.flatnonzero(np.abs(joints[:, 0] - np.median(joints[:, 0])) > np.pi / 2)
    return frozenset(rows.tolist()) if 5 * len(rows) < len(joints) else frozenset()


def _varied(rng: np.random.Generator, share_joints: float) -> tuple[Problem, Array] | None:
    """The session and its joints (n, 6); None where the arm reaches too few of the views."""
    arm, board = find_arm(str(rng.choice(ARMS))), BOARDS[rng.integers(len(BOARDS))]
    setup, n = SETUPS[rng.integers(2)], int(rng.choice(VIEWS))
    built = build_arm(arm, CLASSES[rng.integers(len(CLASSES))], int(rng.integers(2**31)))
    camera = _camera(rng)
    middle = arm.forward(MIDDLE + rng.uniform(-0.3, 0.3, 6))
    on_flange = transform(rotation_from_vector(rng.uniform(-1.8, 1.8, 3)), rng.uniform(-120, 120, 3))
    first = _looking(rng, board, camera)
    in_cell = middle @ on_flange @ (first if setup == "eye-in-hand" else inverse(first))
    X, Y = (on_flange, in_cell) if setup == "eye-in-hand" else (in_cell, on_flange)
    joints = []
    for _ in range(MAX_TRIES_OF_VIEW * n):
        wanted = base_T_flange_of(setup, Y @ inverse(X @ _looking(rng, board, camera)))
        reached = _joints_at(arm, wanted)
        if len(reached):
            joints.append(reached[rng.integers(len(reached))])
        if len(joints) == n:
            break
    else:
        return None
    scatter = transform(
        rotation_from_vector(REPEATABILITY_RAD * rng.standard_normal((n, 3))),
        REPEATABILITY_MM * rng.standard_normal((n, 3)),
    )
    stands = built.base_T_flange(Postures(np.array(joints))) @ scatter
    seen = inverse(anchor_T_mount_of(setup, stands) @ X) @ Y
    image_px, recorded = float(np.exp(rng.uniform(np.log(0.03), np.log(0.3)))), bool(rng.random() < share_joints)
    views = []
    for row in range(n):
        pixels = camera.project(map_points(seen[row], board.points_mm))
        pixels = pixels + image_px * rng.standard_normal(pixels.shape)
        found = Detection(np.arange(len(pixels)), pixels)
        views.append(View(row, Stance(arm.forward(joints[row]), joints[row] if recorded else None), found))
    given = bool(rng.random() < SHARE_GIVEN) or n < MIN_VIEWS_FREE
    return Problem(setup, board, camera if given else None, camera.image_size, tuple(views)), np.array(joints)


def _joints_at(arm: Arm, base_T_flange: Array) -> Array:
    """Joints (k, 6) within the limits that reach the pose."""
    try:
        found = arm.inverse(base_T_flange)
    except UnreachablePoseError:
        return np.empty((0, 6))
    within: Array = found[np.abs(found).max(axis=1) < np.pi]
    return within


def _camera(rng: np.random.Generator) -> CameraModel:
    width, height = SENSORS[rng.integers(len(SENSORS))]
    focal = width * rng.uniform(*FOCAL_OF_WIDTH)
    middle = np.array([width - 1, height - 1]) / 2 + 0.01 * width * rng.standard_normal(2)
    distortion = np.array([-0.1, 0.08, 1e-4, -1e-4, 0.0]) * rng.uniform(-1, 1)
    return CameraModel(np.array([[focal, 0, middle[0]], [0, focal, middle[1]], [0, 0, 1]]), distortion, (width, height))


def _looking(rng: np.random.Generator, board: Target, camera: CameraModel) -> Array:
    """camera_T_target with the whole board in the image, tilted by up to MAX_TILT_RAD and rolled at will."""
    points, (width, height) = board.points_mm, camera.image_size
    centre, diagonal_mm = points.mean(axis=0), float(np.linalg.norm(np.ptp(points, axis=0)))
    while True:
        azimuth, tilt = rng.uniform(-np.pi, np.pi), MAX_TILT_RAD * np.sqrt(rng.uniform())
        turn = rotation_from_vector(tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))
        turn = turn @ rotation_from_vector(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
        distance = camera.matrix[0, 0] * diagonal_mm / (height * rng.uniform(*BOARD_OF_IMAGE))
        aside = distance / camera.matrix[0, 0] * rng.uniform(-0.2, 0.2, 2) * np.array([width, height])
        pose = transform(turn, np.array([*aside, distance]) - turn @ centre)
        pixels = camera.project(map_points(pose, points))
        if np.all((pixels > 5) & (pixels < np.array(camera.image_size) - 6)):
            return pose

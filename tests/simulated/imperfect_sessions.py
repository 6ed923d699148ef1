"""Sessions without a fault whose lens, board, exposure, light or robot is a little outside the solver's model.

The truth is known. A session of one seed is the same for every kind, but for the imperfection.
"""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import scipy

from calibration.camera import CameraModel
from calibration.kinematics.stance import Stance
from calibration.likelihood.predicted_uncertainty import working_points_mm
from calibration.problem import Detection, Problem, Setup, View, anchor_T_mount_of
from calibration.solution import Solution
from calibration.targets import Chessboard, Target
from calibration.transforms import (
    Array,
    inverse,
    map_points,
    rotation_from_vector,
    transform,
    transform_from_vector,
)
from tests.simulated.sessions import BOARD, CAMERA, Cell, CellNoise

SHARE_EXACT_ROBOT, SHARE_GIVEN = 0.3, 0.7
VIEWS = (8, 10, 15, 20, 30)
MIN_VIEWS_FREE = 10
LENS_PX = 0.1
"""RMS over the image that the best five coefficients leave of the lens."""

BOW_MM = 0.1
ROLLING_PX = 0.2
"""One deviation per axis of the image's shift from the first row to the last."""

LIGHT_PX = 0.05
"""One deviation per axis of three shifts each: of all corners, growing over the image, alternating between corners."""

TREND = np.repeat([np.radians(0.02), 0.2], 3)
"""One deviation per axis of the robot's errors that follow the pose, rad and mm."""

TREND_TERMS, TREND_LENGTH_MM, TREND_LENGTH_RAD = 40, 500.0, 1.0
"""Random Fourier features of a Gaussian process over position and orientation, and its lengths."""

Lens = Callable[[Array], Array]
"""Pixels (n, 2) of points (n, 3) in the camera's frame."""


@dataclass(frozen=True)
class Imperfection:
    """What is outside the model; `small_board`: a board of 4 x 3 corners far away, in 40 to 120 views."""

    lens: bool = False
    bow: bool = False
    rolling: bool = False
    light: bool = False
    trend: bool = False
    exact_robot: bool = False
    small_board: bool = False


NOTHING = Imperfection()
IMPERFECTIONS = {
    "exact robot": Imperfection(exact_robot=True),
    "lens beyond the model": Imperfection(lens=True),
    "board bowed by 0.1 mm": Imperfection(bow=True),
    "rolling exposure": Imperfection(rolling=True),
    "corners biased by light": Imperfection(light=True),
    "robot errors follow the pose": Imperfection(trend=True),
    "all of these": Imperfection(lens=True, bow=True, rolling=True, light=True, trend=True),
    "small board, many views": Imperfection(lens=True, light=True, exact_robot=True, small_board=True),
}


@dataclass(frozen=True, eq=False)
class ImperfectCell:
    """A session, the truth behind it, its lens, and the noise of pixels and robot besides the imperfection."""

    cell: Cell
    lens: Lens
    noise: CellNoise

    def point_error_mm(self, solution: Solution) -> float:
        """RMS error of a measured point over the working volume; NaN without X.

        With estimated intrinsics a point is where its pixel is seen at its true distance, since X and camera are used
        together; with given ones it is known in the camera's frame.
        """
        if solution.mount_T_camera is None or solution.camera is None:
            return float("nan")
        points = working_points_mm(self.cell.camera, self._distance_mm())
        found = points
        if solution.camera_source == "estimated":
            rays = np.column_stack([solution.camera.normalise(self.lens(points)), np.ones(len(points))])
            found = rays * (np.linalg.norm(points, axis=1) / np.linalg.norm(rays, axis=1))[:, None]
        off = map_points(inverse(self.cell.mount_T_camera) @ solution.mount_T_camera, found) - points
        return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))

    def _distance_mm(self) -> float:
        """Median distance of the target's middle from the camera."""
        cell, centre = self.cell, self.cell.problem.target.points_mm.mean(axis=0, keepdims=True)
        anchor_T_mount = anchor_T_mount_of(cell.problem.setup, cell.base_T_flange)
        seen = map_points(inverse(anchor_T_mount @ cell.mount_T_camera) @ cell.anchor_T_target, centre)
        return float(np.median(np.linalg.norm(seen, axis=-1)))


def imperfect_cell(seed: tuple[int, ...], what: Imperfection) -> ImperfectCell:
    """A session of this seed with the imperfection, 0.02 to 0.3 px, up to 0.5 mm and 0.05 degrees of the robot."""
    rng = np.random.default_rng([*seed, 0])
    target: Target = Chessboard(4, 3, 50.0) if what.small_board else BOARD
    n = int(rng.integers(40, 121)) if what.small_board else int(rng.choice(VIEWS))
    setup: Setup = "eye-in-hand" if rng.random() < 0.5 else "eye-to-hand"
    image_px = float(np.exp(rng.uniform(np.log(0.02), np.log(0.1 if what.small_board else 0.3))))
    robot = np.repeat([np.radians(rng.uniform(0, 0.05)), rng.uniform(0, 0.5)], 3)
    exact, given = bool(rng.random() < SHARE_EXACT_ROBOT), bool(rng.random() < SHARE_GIVEN)
    given = given or n < MIN_VIEWS_FREE or what.small_board
    X = transform(rotation_from_vector(rng.standard_normal(3)), 80 * rng.standard_normal(3))
    Y = transform(rotation_from_vector(rng.standard_normal(3)), 500 * rng.standard_normal(3))
    camera_T_target = np.array([_looking(rng, target, what.small_board) for _ in range(n)])
    anchor_T_mount = Y @ inverse(X @ camera_T_target)
    base_T_flange = anchor_T_mount if setup == "eye-in-hand" else inverse(anchor_T_mount)
    robot = (0.0 if exact or what.exact_robot else 1.0) * robot
    errors = robot * rng.standard_normal((n, 6))
    noise_px = image_px * rng.standard_normal((n, len(target.points_mm), 2))
    # What follows draws from generators of its own, so that the session is the same for every kind.
    if what.trend:
        errors = errors + TREND * _smooth(np.random.default_rng([*seed, 1]), base_T_flange)
    lens, camera = _lens(np.random.default_rng([*seed, 2])) if what.lens else (CAMERA.project, CAMERA)
    points_mm = _bowed(np.random.default_rng([*seed, 3]), target) if what.bow else target.points_mm
    shift = _image_errors(seed, what, target)
    views = []
    for index in range(n):
        pixels = lens(map_points(camera_T_target[index], points_mm))
        pixels = pixels + noise_px[index] + shift(index, pixels)
        reported = base_T_flange[index] @ transform_from_vector(errors[index])
        views.append(View(index, Stance(reported), Detection(np.arange(len(pixels)), pixels)))
    problem = Problem(setup, target, camera if given else None, camera.image_size, tuple(views))
    noise = CellNoise(image_px, float(robot[0]), float(robot[3]))
    return ImperfectCell(Cell(problem, X, Y, camera, base_T_flange), lens, noise)


def _looking(rng: np.random.Generator, target: Target, far: bool) -> Array:
    """camera_T_target with the whole target in the image, tilted by up to 35 degrees."""
    centre = target.points_mm.mean(axis=0)
    while True:
        azimuth, tilt = rng.uniform(-np.pi, np.pi), np.radians(35.0) * rng.uniform(0.3, 1.0)
        turn = rotation_from_vector([0.0, 0.0, rng.uniform(-np.pi, np.pi)]) @ rotation_from_vector(
            tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        )
        distance = rng.uniform(1500, 3000) if far else rng.uniform(450, 650)
        where = distance * np.array([*(rng.uniform(-1, 1, 2) * (0.4, 0.35)), 1.0])
        pose = transform(turn, where - turn @ centre)
        pixels = CAMERA.project(map_points(pose, target.points_mm))
        if np.all((pixels > 10) & (pixels < np.array(CAMERA.image_size) - 11)):
            return pose


def _lens(rng: np.random.Generator) -> tuple[Lens, CameraModel]:
    """A lens with k4 to k6, thin prism and tilt, and the camera of five coefficients that comes closest to it."""
    extra = np.concatenate(
        [0.05 * rng.standard_normal(3), 1e-3 * rng.standard_normal(4), 1e-3 * rng.standard_normal(2)]
    )
    u, v = np.meshgrid(np.linspace(0, 2447, 13), np.linspace(0, 2047, 11))
    rays = np.column_stack([CAMERA.normalise(np.column_stack([u.ravel(), v.ravel()])), np.ones(u.size)])

    def lens_of(scale: float) -> Lens:
        k = np.concatenate([CAMERA.distortion, scale * extra])
        return lambda points: np.asarray(
            cv2.projectPoints(points, np.zeros(3), np.zeros(3), CAMERA.matrix, k)[0], np.float64
        ).reshape(-1, 2)

    scale = 1.0
    for _ in range(3):
        _, left_px = _closest_camera(rays, lens_of(scale)(rays))
        scale *= LENS_PX / left_px
    return lens_of(scale), _closest_camera(rays, lens_of(scale)(rays))[0]


def _closest_camera(rays: Array, pixels: Array) -> tuple[CameraModel, float]:
    """The camera of five coefficients nearest to `pixels` (n, 2) of the `rays` (n, 3), and the RMS that it leaves."""
    first = np.array([*CAMERA.matrix[[0, 1], [0, 1]], *CAMERA.matrix[:2, 2], *CAMERA.distortion])

    def camera_of(numbers: Array) -> CameraModel:
        fx, fy, cx, cy = numbers[:4]
        return CameraModel(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]), numbers[4:], CAMERA.image_size)

    found = scipy.optimize.least_squares(lambda k: (camera_of(k).project(rays) - pixels).ravel(), first, x_scale="jac")
    return camera_of(found.x), float(np.sqrt(2 * found.cost / len(rays)))


def _bowed(rng: np.random.Generator, target: Target) -> Array:
    """The target's points (k, 3) on a sheet bent about an axis in its plane, by BOW_MM between middle and rim."""
    angle = rng.uniform(0, np.pi)
    along = (target.points_mm - target.points_mm.mean(axis=0)) @ np.array([np.cos(angle), np.sin(angle), 0.0])
    points: Array = target.points_mm.copy()
    points[:, 2] += rng.choice([-1, 1]) * BOW_MM * (along / np.abs(along).max()) ** 2
    return points


def _smooth(rng: np.random.Generator, base_T_flange: Array) -> Array:
    """(n, 6): unit deviation each, alike at neighbouring poses."""
    where = np.concatenate(
        [base_T_flange[:, :3, 3] / TREND_LENGTH_MM, base_T_flange[:, :3, :3].reshape(-1, 9) / TREND_LENGTH_RAD], axis=1
    )
    phases = where @ rng.standard_normal((12, 6 * TREND_TERMS)) + rng.uniform(0, 2 * np.pi, 6 * TREND_TERMS)
    smooth: Array = np.sqrt(2 / TREND_TERMS) * np.cos(phases).reshape(len(where), 6, TREND_TERMS).sum(axis=2)
    return smooth


def _image_errors(seed: tuple[int, ...], what: Imperfection, target: Target) -> Callable[[int, Array], Array]:
    """The errors (n, 2) in px of a view's corners at `pixels` (n, 2), besides their noise."""
    rng, size = np.random.default_rng([*seed, 4]), np.array(CAMERA.image_size)
    common, growing = LIGHT_PX * rng.standard_normal(2), LIGHT_PX * rng.standard_normal((2, 2))
    parity = np.where(np.arange(len(target.points_mm)) % 2, 1.0, -1.0)[:, None]
    alternating = parity * LIGHT_PX * rng.standard_normal(2)

    def errors(view: int, pixels: Array) -> Array:
        found = np.zeros_like(pixels)
        if what.light:
            found += common + (2 * pixels / size - 1) @ growing + alternating
        if what.rolling:
            own = np.random.default_rng([*seed, 5, view])
            found += (pixels[:, 1:] / size[1] - 0.5) * ROLLING_PX * own.standard_normal(2)
        return found

    return errors

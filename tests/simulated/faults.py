"""Clean calibration sessions, and one fault put into them: what the diagnosis' tests and benchmark work on."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calibration.camera import CameraModel
from calibration.diagnosis.evidence import Evidence, evidence_of
from calibration.diagnosis.fit import Fit, fit
from calibration.diagnosis.view_hypotheses import CHANGES, change_message
from calibration.kinematics.stance import Stance
from calibration.preprocessing.prepare import prepare
from calibration.problem import Detection, Problem, Setup, View
from calibration.sentences.sentence import from_one
from calibration.targets import Charuco
from calibration.transforms import (
    Array,
    inverse,
    map_points,
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
    transform,
    vector_from_rotation,
)
from tests.simulated.sessions import on_a_stand

BOARD = Charuco(12, 9, 20.0, 15.0, "DICT_5X5_100")
CAMERA = CameraModel(np.array([[2400.0, 0, 640], [0, 2400, 512], [0, 0, 1]]), np.zeros(5), (1280, 1024))
SETUPS: tuple[Setup, ...] = ("eye-in-hand", "eye-to-hand")
NUMBERS = ("x", "y", "z", "q1 (w)", "q2 (x)", "q3 (y)", "q4 (z)")


@dataclass(frozen=True)
class Noise:
    """One standard deviation per axis."""

    image_px: float = 0.1
    robot_mm: float = 0.05
    robot_deg: float = 0.005


@dataclass(frozen=True, eq=False)
class Fault:
    """A session with one thing wrong, the codes that name it rightly, and what its finding must say; `after`: the view
    of a change; `fix`: a part of the advice."""

    problem: Problem
    codes: frozenset[str]
    says: tuple[str, ...] = ()
    after: int | None = None
    fix: str = ""

    def changes(self, clean: Problem) -> bool:
        """Whether anything is wrong: the order as text of fewer than ten views is that of their numbers."""
        spoilt, right = self.problem, clean
        same_views = len(spoilt.views) == len(right.views) and np.array_equal(poses_of(spoilt), poses_of(right))
        if not same_views or spoilt.setup != right.setup or spoilt.target != right.target:
            return True
        pairs = zip(spoilt.views, right.views, strict=True)
        return spoilt.camera is not right.camera or any(a.detection is not b.detection for a, b in pairs)


@dataclass(frozen=True, eq=False)
class Slip:
    """A fault of any size: `at(size)` in mm, or in what the kind counts."""

    at: Callable[[float], Fault]


def simulated_session(
    rng: np.random.Generator, n: int, noise: Noise, setup: Setup, middle_mm: Array | None = None
) -> Problem:
    """n random views of a board, tilted by up to 35 degrees, with normal errors of pixels and robot.

    `middle_mm`: place of the board's middle in every image, in the camera's frame; None: drawn for each view.
    """
    on_flange = transform(rotation_from_vector(rng.uniform(-1.8, 1.8, 3)), rng.uniform(-250, 250, 3))
    in_cell = transform(rotation_from_vector(rng.uniform(-1.8, 1.8, 3)), rng.uniform(-600, 600, 3))
    mount_T_camera, anchor_T_target = (
        (on_flange, in_cell) if setup == "eye-in-hand" else (on_a_stand(rng, in_cell), on_flange)
    )
    return Problem(
        setup,
        BOARD,
        CAMERA,
        CAMERA.image_size,
        tuple(_view(index, rng, noise, setup, mount_T_camera, anchor_T_target, middle_mm) for index in range(n)),
    )


def _view(
    index: int,
    rng: np.random.Generator,
    noise: Noise,
    setup: Setup,
    mount_T_camera: Array,
    anchor_T_target: Array,
    middle_mm: Array | None,
) -> View:
    azimuth, tilt = rng.uniform(-np.pi, np.pi), np.radians(35) * np.sqrt(rng.uniform())
    turn = rotation_from_vector(tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))
    turn = turn @ rotation_from_vector(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
    middle = np.array([*rng.uniform(-40, 40, 2), rng.uniform(550, 750)]) if middle_mm is None else middle_mm
    camera_T_target = transform(turn, middle - turn @ BOARD.points_mm.mean(axis=0))
    anchor_T_mount = anchor_T_target @ inverse(mount_T_camera @ camera_T_target)
    base_T_flange = anchor_T_mount if setup == "eye-in-hand" else inverse(anchor_T_mount)
    error = np.radians(noise.robot_deg) * rng.standard_normal(3), noise.robot_mm * rng.standard_normal(3)
    pixels = CAMERA.project(map_points(camera_T_target, BOARD.points_mm))
    seen = Detection(np.arange(len(pixels)), pixels + noise.image_px * rng.standard_normal(pixels.shape))
    return View(index, Stance(base_T_flange @ transform(rotation_from_vector(error[0]), error[1])), seen)


def poses_of(problem: Problem) -> Array:
    """(n, 4, 4)"""
    return np.array([view.base_T_flange for view in problem.views])


def with_poses(problem: Problem, base_T_flange: Array) -> Problem:
    """The same images at other robot poses."""
    pairs = zip(problem.views, base_T_flange, strict=True)
    return replace(problem, views=tuple(view.standing(base_T_flange=pose) for view, pose in pairs))


def _vector_scaled(factor: float) -> Callable[[Array], Array]:
    def spoil(poses: Array) -> Array:
        vectors = factor * vector_from_rotation(poses[:, :3, :3])
        return transform(rotation_from_vector(vectors), poses[:, :3, 3])

    return spoil


def _translation_scaled(factor: float) -> Callable[[Array], Array]:
    return lambda poses: transform(poses[:, :3, :3], factor * poses[:, :3, 3])


def _w_last(poses: Array) -> Array:
    x_first = np.roll(quaternion_from_rotation(poses[:, :3, :3]), -1, axis=1)
    return transform(rotation_from_quaternion(x_first), poses[:, :3, 3])


def _rotations_changed(change: Callable[[Array], Array]) -> Callable[[Array], Array]:
    return lambda poses: transform(change(poses[:, :3, :3]), poses[:, :3, 3])


def _euler_of(rotations: Array, order: str) -> Array:
    """Angles (n, 3) in SciPy's notation: intrinsic in capitals, extrinsic in small letters."""
    angles: Array = Rotation.from_matrix(rotations).as_euler(order)
    return angles


def _as_euler(angles_rad: Array, order: str) -> Array:
    rotations: Array = Rotation.from_euler(order, angles_rad).as_matrix()
    return rotations


CONVENTIONS: dict[str, Callable[[Array], Array]] = {
    "quaternion-w-last": _w_last,
    "poses-inverted": inverse,
    "poses-in-metres": _translation_scaled(0.001),
    "poses-in-inches": _translation_scaled(1 / 25.4),
    "poses-in-micrometres": _translation_scaled(1000.0),
    "radians-read-as-degrees": _vector_scaled(float(np.pi / 180)),
    "degrees-read-as-radians": _vector_scaled(float(180 / np.pi)),
    "poses-off-by-one": lambda poses: np.roll(poses, 1, axis=0),
    "poses-shifted": lambda poses: np.insert(poses, len(poses) // 2, poses[len(poses) // 2], axis=0)[:-1],
    "poses-reversed": lambda poses: poses[::-1],
    "poses-in-lexical-order": lambda poses: poses[sorted(range(len(poses)), key=str)],
    "poses-blocks-swapped": lambda poses: np.roll(poses, 4, axis=0),
    "rotation-transposed": _rotations_changed(lambda rotations: np.swapaxes(rotations, 1, 2)),
    "euler-order": _rotations_changed(lambda rotations: _as_euler(_euler_of(rotations, "ZYX"), "XYZ")),
    "vector-read-as-euler": _rotations_changed(lambda rotations: _as_euler(vector_from_rotation(rotations), "ZYX")),
    "euler-read-as-vector": _rotations_changed(lambda rotations: rotation_from_vector(_euler_of(rotations, "xyz"))),
}
SAME_EQUATIONS = {"poses-inverted": frozenset({"poses-inverted", "setup-swapped"})}
"""Inverted poses and the other setup differ only in which unknown transform is long."""


def in_convention(code: str) -> Callable[[Problem, np.random.Generator], Fault]:
    """All poses as another convention would write them."""
    codes = SAME_EQUATIONS.get(code, frozenset({code}))
    return lambda problem, _: Fault(with_poses(problem, CONVENTIONS[code](poses_of(problem))), codes)


def swapped(problem: Problem, rng: np.random.Generator) -> Fault:
    """Two poses exchanged."""
    i, j = sorted(_seen(problem, rng, 2))
    poses = poses_of(problem)
    poses[[i, j]] = poses[[j, i]]
    return Fault(with_poses(problem, poses), frozenset({"poses-swapped"}), (f"pictures {i + 1} and {j + 1}",))


def sign_lost(problem: Problem, rng: np.random.Generator) -> Fault:
    """One of a quaternion's larger elements with the wrong sign."""
    (row,) = _seen(problem, rng, 1)
    poses = poses_of(problem)
    quaternion = quaternion_from_rotation(poses[row, :3, :3])
    which = int(rng.choice(np.flatnonzero(np.abs(quaternion[1:]) > 0.05)) + 1)
    quaternion[which] *= -1
    poses[row, :3, :3] = rotation_from_quaternion(quaternion)
    return Fault(with_poses(problem, poses), frozenset({"pose-mistyped"}), (f"picture {row + 1}", NUMBERS[3 + which]))


def turned(problem: Problem, rng: np.random.Generator) -> Fault:
    """The board turned by 180 degrees about its middle in one view."""
    (row,) = _seen(problem, rng, 1)
    views = list(problem.views)
    seen = views[row].detection
    assert seen is not None
    last = len(problem.target.points_mm) - 1
    views[row] = replace(views[row], detection=Detection(last - seen.ids, seen.corners_px))
    return Fault(replace(problem, views=tuple(views)), frozenset({"board-turned"}), (f"picture {row + 1}",))


def other_tool(problem: Problem, rng: np.random.Generator) -> Fault:
    """From some view on the poses are a tool's, 120 mm in front of the flange and turned by 45 degrees."""
    after = _change(problem, rng)
    tool = transform(rotation_from_vector(np.array([0.0, 0.0, np.pi / 4])), np.array([10.0, 0.0, 120.0]))
    return _changed(problem, after, lambda poses: poses @ tool, "tool")


TRACK_ORDERS: dict[str, Callable[[NDArray[np.intp]], NDArray[np.intp]]] = {
    "two in a row": lambda rows: 2 * rows // len(rows),
    "three in a row": lambda rows: 3 * rows // len(rows),
    "two in turn": lambda rows: rows % 2,
    "three in turn": lambda rows: rows % 3,
    "there and back": lambda rows: np.array([0, 1, 0])[3 * rows // len(rows)],
}
"""The place of a track, 0 to 2, at which each view is taken."""


def track_left_out(problem: Problem, rng: np.random.Generator, order: str | None = None) -> Fault:
    """The arm rode on a track, from 100 mm to 1.5 m between its places, and the poses are of its base as it moved."""
    places = TRACK_ORDERS[order or str(rng.choice(list(TRACK_ORDERS)))](np.arange(len(problem.views)))
    at_mm = np.cumsum([0.0, *rng.uniform(100, 1500, 2)])[rng.permutation(3)]
    direction = np.append(rng.standard_normal(2), 0.02 * rng.standard_normal())
    poses = poses_of(problem)
    poses[:, :3, 3] -= np.outer(at_mm[places], direction / np.linalg.norm(direction))
    groups = [
        [view.index for view in problem.views if places[view.index] == place] for place in range(places.max() + 1)
    ]
    says = tuple(f"pictures {from_one(group[:12])}" for group in groups)
    return Fault(with_poses(problem, poses), frozenset({"track-not-declared"}), says)


def focal_wrong(problem: Problem, rng: np.random.Generator) -> Slip:
    """The focal length of another focus, by a share."""
    sign = float(rng.choice([-1, 1]))
    return Slip(lambda size: _lens(problem, sign * size, 0.0))


def distortion_wrong(problem: Problem, rng: np.random.Generator) -> Slip:
    """k1 of another lens."""
    sign = float(rng.choice([-1, 1]))
    return Slip(lambda size: _lens(problem, 0.0, sign * size))


def _lens(problem: Problem, focal: float, k1: float) -> Fault:
    assert problem.camera is not None
    matrix = problem.camera.matrix * np.array([[1 + focal], [1 + focal], [1.0]])
    matrix[:2, 2] = problem.camera.matrix[:2, 2]
    distortion = problem.camera.distortion.copy()
    distortion[0] += k1
    camera = CameraModel(matrix, distortion, problem.camera.image_size)
    return Fault(replace(problem, camera=camera), frozenset({"intrinsics-do-not-fit"}))


def mistyped(problem: Problem, rng: np.random.Generator) -> Slip:
    """One number of one position, by some mm."""
    (row,), axis, sign = _seen(problem, rng, 1), int(rng.integers(3)), float(rng.choice([-1, 1]))

    def at(size: float) -> Fault:
        poses = poses_of(problem)
        poses[row, axis, 3] += sign * size
        return Fault(with_poses(problem, poses), frozenset({"pose-mistyped"}), (f"picture {row + 1}",))

    return Slip(at)


def moved(problem: Problem, rng: np.random.Generator, what: str) -> Slip:
    """From some view on the `base` side (board or camera on the table) or the `tool` side is shifted by some mm."""
    after, direction = _change(problem, rng), rng.standard_normal(3)
    direction /= np.linalg.norm(direction)

    def at(size: float) -> Fault:
        shift = transform(np.eye(3), size * direction)
        return _changed(problem, after, (lambda p: shift @ p) if what == "base" else (lambda p: p @ shift), what)

    return Slip(at)


def scaled_target(problem: Problem, rng: np.random.Generator) -> Slip:
    """A print larger or smaller than described, by a share."""
    sign = float(rng.choice([-1, 1]))

    def at(size: float) -> Fault:
        poses = transform(poses_of(problem)[:, :3, :3], poses_of(problem)[:, :3, 3] * (1 + sign * size))
        return Fault(with_poses(problem, poses), frozenset({"wrong-pitch", "target-scale"}))

    return Slip(at)


def clean_fit(problem: Problem) -> tuple[Evidence, Fit]:
    """What the session says while nothing is wrong with it."""
    prepared = prepare(problem)
    evidence = evidence_of(problem, prepared.seen, prepared.camera, prepared.camera_T_target)
    return evidence, fit(evidence)


CHANGED_CODES = {
    ("eye-in-hand", "base"): "board-moved",
    ("eye-in-hand", "tool"): "camera-or-tool-changed",
    ("eye-to-hand", "base"): "camera-moved",
    ("eye-to-hand", "tool"): "board-or-tool-changed",
}


def _changed(problem: Problem, after: int, spoil: Callable[[Array], Array], what: str) -> Fault:
    poses = poses_of(problem)
    poses[after:] = spoil(poses[after:])
    code = CHANGED_CODES[problem.setup, what]
    (change,) = (change for change in CHANGES[problem.setup] if change.code == code)
    return Fault(
        with_poses(problem, poses), frozenset({code}), (change_message(change, [after]).partition(":")[0],), after
    )


def _seen(problem: Problem, rng: np.random.Generator, count: int) -> list[int]:
    seen = [row for row, view in enumerate(problem.views) if view.detection is not None]
    return [int(row) for row in rng.choice(seen, count, replace=False)]


def _change(problem: Problem, rng: np.random.Generator) -> int:
    return int(rng.integers(2, len(problem.views) - 1))

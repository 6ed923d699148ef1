"""Ways in which a whole session goes wrong, for properties over random damage: `damaged_session(rng)`."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calibration.problem import Detection, Problem, Setup, View
from calibration.targets import Chessboard
from calibration.transforms import Array, inverse, rotation_from_vector, transform
from tests.simulated.faults import SETUPS
from tests.simulated.sessions import Cell, CellNoise, random_cell

TARGET = Chessboard(7, 5, 25.0)
DISTANCE_MM = 550.0
"""About the distance from the camera to the target."""

NOISE_LEVELS = (CellNoise(0.05, 0.0, 0.0), CellNoise(), CellNoise(0.3, float(np.radians(0.03)), 0.3))
MIN_VIEWS, MAX_VIEWS = 5, 16
"""Bounds of the number of views of a session before the damage."""

Poses = Callable[[Array, np.random.Generator], Array]
"""Changes poses (n, 4, 4)."""


@dataclass(frozen=True, eq=False)
class DamagedSession:
    """A session after the `damages` (names).

    `truths`: the X (4, 4) that an accepted answer may have; `intact`: for each the session of its undamaged views.
    """

    problem: Problem
    truths: tuple[Array, ...]
    damages: tuple[str, ...]
    intact: tuple[Problem, ...]


def damaged_session(rng: np.random.Generator) -> DamagedSession:
    """A random session, its intrinsics given or not, with one to three kinds of damage."""
    setup: Setup = SETUPS[rng.integers(2)]
    noise, given = NOISE_LEVELS[rng.integers(len(NOISE_LEVELS))], bool(rng.random() < 0.7)
    names = tuple(str(name) for name in rng.choice(list(DAMAGES), rng.choice([1, 2, 3], p=[0.6, 0.3, 0.1])))
    truth, other = (_cell(rng, setup, noise, given) for _ in range(2))
    problem = truth.problem
    for name in names:
        problem = DAMAGES[name](problem, other.problem, rng)
    views = tuple(replace(view, index=index) for index, view in enumerate(problem.views))
    return DamagedSession(
        replace(problem, views=views),
        (truth.mount_T_camera, other.mount_T_camera),
        names,
        (_intact(truth.problem, problem), _intact(other.problem, problem)),
    )


def _intact(before: Problem, after: Problem) -> Problem:
    """The part of a session whose views are as they were; none when its camera or target is another."""
    same = after.camera is before.camera and after.target is before.target
    kept = [view for view in before.views if same and any(_is_same(view, seen) for seen in after.views)]
    return replace(before, views=tuple(kept))


def _is_same(view: View, seen: View) -> bool:
    return seen.detection is view.detection and np.array_equal(seen.base_T_flange, view.base_T_flange)


def _cell(rng: np.random.Generator, setup: Setup, noise: CellNoise, camera_given: bool) -> Cell:
    views = int(rng.integers(MIN_VIEWS, MAX_VIEWS + 1))
    return random_cell(rng, views, noise, setup=setup, camera_given=camera_given, target=TARGET)


def _of_poses(change: Poses) -> Callable[[Problem, Problem, np.random.Generator], Problem]:
    def damage(problem: Problem, _: Problem, rng: np.random.Generator) -> Problem:
        if not problem.views:
            return problem
        poses = change(np.array([view.base_T_flange for view in problem.views]), rng)
        pairs = zip(problem.views, poses, strict=True)
        return replace(problem, views=tuple(view.standing(base_T_flange=pose) for view, pose in pairs))

    return damage


def _of_views(
    change: Callable[[list[View], list[View], np.random.Generator], list[View]],
) -> Callable[[Problem, Problem, np.random.Generator], Problem]:
    def damage(problem: Problem, other: Problem, rng: np.random.Generator) -> Problem:
        return (
            replace(problem, views=tuple(change(list(problem.views), list(other.views), rng)))
            if problem.views
            else problem
        )

    return damage


def _some(n: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Rows of a random part of n."""
    return rng.permutation(n)[: int(rng.integers(1, n + 1))].astype(np.intp)


def _change_some(change: Poses) -> Poses:
    def damage(poses: Array, rng: np.random.Generator) -> Array:
        rows = _some(len(poses), rng)
        poses = poses.copy()
        poses[rows] = change(poses[rows], rng)
        return poses

    return damage


def _random_rotations(n: int, rng: np.random.Generator) -> Array:
    rotations: Array = Rotation.random(n, random_state=rng).as_matrix()
    return rotations


def _permute_some(poses: Array, rng: np.random.Generator) -> Array:
    rows = _some(len(poses), rng)
    poses = poses.copy()
    poses[rows] = poses[rng.permutation(rows)]
    return poses


def _scale(poses: Array, rng: np.random.Generator) -> Array:
    factor = rng.choice([1e-6, 1e-3, 1 / 25.4, 0.1, 0.5, 1.1, 2.0, 10.0, 25.4, 1e3, 1e6, 0.0, -1.0])
    return transform(poses[:, :3, :3], factor * poses[:, :3, 3])


def _turn(poses: Array, rng: np.random.Generator) -> Array:
    vectors = rng.choice([1e-3, 0.03, 0.3, 3.0]) * rng.standard_normal((len(poses), 3))
    return transform(poses[:, :3, :3] @ rotation_from_vector(vectors), poses[:, :3, 3])


def _shift(poses: Array, rng: np.random.Generator) -> Array:
    size_mm = rng.choice([1.0, 10.0, 100.0, 1e4, 1e7])
    return transform(poses[:, :3, :3], poses[:, :3, 3] + size_mm * rng.standard_normal((len(poses), 3)))


def _misread(poses: Array, rng: np.random.Generator) -> Array:
    orders = ("XYZ", "ZYX", "ZYZ", "ZXZ", "xyz", "zyx")
    read, written = rng.choice(orders, 2, replace=False)
    with np.errstate(over="ignore", invalid="ignore"):
        is_rotation = np.abs(np.linalg.det(poses[:, :3, :3]) - 1) < 0.5
    if not np.all(is_rotation):
        return poses  # of extreme numbers: no program writes angles of these
    numbers = Rotation.from_matrix(poses[:, :3, :3]).as_euler(written)
    turned = Rotation.from_rotvec(numbers) if rng.random() < 0.3 else Rotation.from_euler(read, numbers)
    return transform(turned.as_matrix(), poses[:, :3, 3])


def _extreme(poses: Array, rng: np.random.Generator) -> Array:
    poses = poses.copy()
    shape = poses[:, :3, :].shape
    sizes = rng.choice([0.0, 1e-300, 1e-9, 1e8, 9.9e7, 1e12, 1e300], shape) * rng.choice([-1.0, 1.0], shape)
    chosen = rng.random(shape) < 0.05
    chosen[:, :, :3] &= rng.random() < 0.5
    poses[:, :3, :] = np.where(chosen, sizes, poses[:, :3, :])
    return poses


def _random(poses: Array, rng: np.random.Generator) -> Array:
    spread = rng.choice([0.0, 1.0, 500.0, 1e6])
    return transform(_random_rotations(len(poses), rng), spread * rng.standard_normal((len(poses), 3)))


def _one_axis(poses: Array, rng: np.random.Generator) -> Array:
    turns = rotation_from_vector(np.outer(rng.uniform(-3, 3, len(poses)), [0, 0, 1.0]))
    return transform(turns @ poses[0, :3, :3], poses[:, :3, 3])


def _corners(change: Callable[[Detection, np.random.Generator], Detection]) -> Callable[..., list[View]]:
    def damage(views: list[View], _: list[View], rng: np.random.Generator) -> list[View]:
        rows = set(_some(len(views), rng).tolist())
        return [
            replace(view, detection=change(view.detection, rng)) if row in rows and view.detection else view
            for row, view in enumerate(views)
        ]

    return damage


def _fewer_corners(seen: Detection, rng: np.random.Generator) -> Detection:
    if not len(seen.ids):
        return seen
    kept = np.sort(_some(len(seen.ids), rng))
    return Detection(seen.ids[kept], seen.corners_px[kept])


def _extreme_corners(seen: Detection, rng: np.random.Generator) -> Detection:
    sizes = rng.choice([0.0, 1e-300, 1e5, 1e12, 1e300], seen.corners_px.shape)
    return Detection(seen.ids, np.where(rng.random(seen.corners_px.shape) < 0.05, sizes, seen.corners_px))


def _corners_off(seen: Detection, rng: np.random.Generator) -> Detection:
    size_px = 10.0 ** rng.uniform(-1, 3)
    return Detection(seen.ids, seen.corners_px + size_px * rng.standard_normal(seen.corners_px.shape))


def _doubled(views: list[View], _: list[View], rng: np.random.Generator) -> list[View]:
    return [views[row] for row in rng.integers(0, len(views), 2 * len(views))]


def _one_image(views: list[View], _: list[View], rng: np.random.Generator) -> list[View]:
    image = views[rng.integers(len(views))].detection
    return [replace(view, detection=image) for view in views]


def _mix(views: list[View], others: list[View], rng: np.random.Generator) -> list[View]:
    mixed = [*views, *others]
    return [mixed[row] for row in _some(len(mixed), rng)]


def _intrinsics(problem: Problem, _: Problem, rng: np.random.Generator) -> Problem:
    if problem.camera is None:
        return problem
    matrix = problem.camera.matrix.copy()
    matrix[:2, :2] *= rng.choice([1e-3, 0.5, 0.9, 1.1, 2.0, 1e3])
    matrix[:2, 2] += rng.choice([0.0, 50.0, 1e4]) * rng.standard_normal(2)
    distortion = problem.camera.distortion + rng.choice([0.0, 0.1, 10.0]) * rng.standard_normal(5)
    return replace(problem, camera=replace(problem.camera, matrix=matrix, distortion=distortion))


def _other_target(problem: Problem, _: Problem, rng: np.random.Generator) -> Problem:
    columns, rows, pitch_mm = TARGET.columns, TARGET.rows, TARGET.pitch_mm
    other = (Chessboard(rows, columns, pitch_mm), Chessboard(columns - 1, rows, pitch_mm))
    larger = (
        Chessboard(columns + 1, rows, pitch_mm),
        Chessboard(columns, rows, pitch_mm * rng.choice([1e-6, 0.9, 1e6])),
    )
    return replace(problem, target=(*other, *larger)[rng.integers(4)])


DAMAGES: dict[str, Callable[[Problem, Problem, np.random.Generator], Problem]] = {
    "poses permuted": _of_poses(lambda poses, rng: rng.permutation(poses)),
    "some poses permuted": _of_poses(_permute_some),
    "poses shifted": _of_poses(lambda poses, rng: np.roll(poses, int(rng.integers(1, 4)), axis=0)),
    "poses repeated": _of_poses(lambda poses, rng: poses[rng.integers(0, len(poses), len(poses))]),
    "two poses only": _of_poses(lambda poses, rng: poses[rng.integers(0, min(2, len(poses)), len(poses))]),
    "all poses equal": _of_poses(lambda poses, _: np.repeat(poses[:1], len(poses), axis=0)),
    "translations scaled": _of_poses(_scale),
    "some translations scaled": _of_poses(_change_some(_scale)),
    "rotations off": _of_poses(_turn),
    "some rotations off": _of_poses(_change_some(_turn)),
    "translations off": _of_poses(_shift),
    "some translations off": _of_poses(_change_some(_shift)),
    "another convention": _of_poses(_misread),
    "another convention in some": _of_poses(_change_some(_misread)),
    "rotations transposed": _of_poses(lambda poses, _: transform(np.swapaxes(poses[:, :3, :3], 1, 2), poses[:, :3, 3])),
    "poses inverted": _of_poses(lambda poses, _: inverse(poses)),
    "random poses": _of_poses(_random),
    "some random poses": _of_poses(_change_some(_random)),
    "extreme numbers in poses": _of_poses(_extreme),
    "one axis": _of_poses(_one_axis),
    "views doubled": _of_views(_doubled),
    "few views": _of_views(lambda views, _, rng: views[: int(rng.integers(0, 5))]),
    "one image": _of_views(_one_image),
    "two sessions": _of_views(_mix),
    "fewer corners": _of_views(_corners(_fewer_corners)),
    "corners mixed up": _of_views(_corners(lambda seen, rng: Detection(rng.permutation(seen.ids), seen.corners_px))),
    "extreme corners": _of_views(_corners(_extreme_corners)),
    "corners off": _of_views(_corners(_corners_off)),
    "intrinsics off": _intrinsics,
    "another target": _other_target,
}  # fmt: skip
"""Damage by name: (session, another session of the same kind, generator) to a session."""

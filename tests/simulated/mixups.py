"""Slips of convention and bookkeeping in a whole session, drawn at random: any Euler order, any view, any setting."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calibration.camera import CameraModel
from calibration.problem import Detection, Problem
from calibration.targets import Charuco, Chessboard, CircleGrid
from calibration.transforms import (
    Array,
    inverse,
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
    transform,
    vector_from_rotation,
)
from tests.simulated.faults import Fault, poses_of, with_poses

Rows = NDArray[np.intp]
Put = Callable[[Problem, np.random.Generator], Fault]
Grid = Charuco | Chessboard | CircleGrid
"""Targets with columns and rows of points, numbered row by row."""

AXES = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "XYX", "XZX", "YXY", "YZY", "ZXZ", "ZYZ")
ORDERS = (*AXES, *(order.lower() for order in AXES))
"""In SciPy's notation: intrinsic in capitals, extrinsic in small letters."""


def _rotations(code: str, misread: Callable[[Array, np.random.Generator], Array]) -> Put:
    def put(problem: Problem, rng: np.random.Generator) -> Fault:
        poses = poses_of(problem)
        turned = transform(misread(poses[:, :3, :3], rng), poses[:, :3, 3])
        return Fault(with_poses(problem, turned), frozenset({code}))

    return put


def _numbers(rotations: Array, order: str) -> Array:
    numbers: Array = Rotation.from_matrix(rotations).as_euler(order)
    return numbers


def _from_numbers(numbers: Array, order: str) -> Array:
    rotations: Array = Rotation.from_euler(order, numbers).as_matrix()
    return rotations


def _another_order(rotations: Array, rng: np.random.Generator) -> Array:
    written, read = rng.choice(ORDERS, 2, replace=False)
    return _from_numbers(_numbers(rotations, str(written)), str(read))


def _vector_as_euler(rotations: Array, rng: np.random.Generator) -> Array:
    return _from_numbers(vector_from_rotation(rotations), str(rng.choice(ORDERS)))


def _euler_as_vector(rotations: Array, rng: np.random.Generator) -> Array:
    return rotation_from_vector(_numbers(rotations, str(rng.choice(ORDERS))))


def _euler_scaled(factor: float) -> Callable[[Array, np.random.Generator], Array]:
    def misread(rotations: Array, rng: np.random.Generator) -> Array:
        order = str(rng.choice(ORDERS))
        return _from_numbers(factor * _numbers(rotations, order), order)

    return misread


def _scalar_taken_first(rotations: Array, _: np.random.Generator) -> Array:
    """w, x, y, z read as x, y, z, w."""
    return rotation_from_quaternion(np.roll(quaternion_from_rotation(rotations), 1, axis=1))


def _setup_swapped(problem: Problem, _: np.random.Generator) -> Fault:
    other = "eye-to-hand" if problem.setup == "eye-in-hand" else "eye-in-hand"
    return Fault(replace(problem, setup=other), frozenset({"setup-swapped"}))  # type: ignore[arg-type]


def _inverted(problem: Problem, _: np.random.Generator) -> Fault:
    return Fault(with_poses(problem, inverse(poses_of(problem))), frozenset({"poses-inverted"}))


def _paired(problem: Problem, images: Rows, poses: Rows, code: str, after: int | None = None) -> Fault:
    """Image `images[row]` with pose `poses[row]` and the axes recorded with it, numbered anew."""
    views = tuple(
        replace(problem.views[image], index=row, stance=problem.views[pose].stance)
        for row, (image, pose) in enumerate(zip(images, poses, strict=True))
    )
    return Fault(replace(problem, views=views), frozenset({code}), after=after)


def _off_by_some(problem: Problem, rng: np.random.Generator) -> Fault:
    rows, by = np.arange(len(problem.views), dtype=np.intp), int(rng.integers(1, 3))
    early, late = rows[:-by], rows[by:]
    images, poses = (early, late) if rng.random() < 0.5 else (late, early)
    return _paired(problem, images, poses, "poses-off-by-one")


def _row_lost_or_doubled(problem: Problem, rng: np.random.Generator) -> Fault:
    """From view k on every image has the pose of its neighbour; at least three views stand before it and after."""
    rows = np.arange(len(problem.views), dtype=np.intp)
    k = int(rng.integers(3, max(len(rows) - 3, 4)))
    kept, lost = rows[:-1], np.delete(rows, k)
    images, poses = (kept, lost) if rng.random() < 0.5 else (lost, kept)
    return _paired(problem, images, poses, "poses-shifted", k)


def _reversed(problem: Problem, _: np.random.Generator) -> Fault:
    rows = np.arange(len(problem.views), dtype=np.intp)
    return _paired(problem, rows, rows[::-1], "poses-reversed")


def _lexical(problem: Problem, rng: np.random.Generator) -> Fault:
    """The order as text differs from that of the numbers from ten views on."""
    rows, first = np.arange(len(problem.views), dtype=np.intp), int(rng.integers(2))
    as_text = np.array(sorted(rows.tolist(), key=lambda row: str(row + first)), np.intp)
    images, poses = (rows, as_text) if rng.random() < 0.5 else (as_text, rows)
    return _paired(problem, images, poses, "poses-in-lexical-order")


def _blocks_swapped(problem: Problem, rng: np.random.Generator) -> Fault:
    rows = np.arange(len(problem.views), dtype=np.intp)
    return _paired(problem, rows, np.roll(rows, int(rng.integers(3, len(rows) - 2))), "poses-blocks-swapped")


def _described(columns: int, rows: int) -> Put:
    """A board of other columns and rows than described, by so many."""

    def put(problem: Problem, _: np.random.Generator) -> Fault:
        target = problem.target
        assert isinstance(target, Grid)
        other = replace(target, columns=target.columns + columns, rows=target.rows + rows)
        said = f'set "columns" to {target.columns}'
        return Fault(replace(problem, target=other), frozenset({"target-not-as-described"}), fix=said)

    return put


def _transposed(problem: Problem, _: np.random.Generator) -> Fault:
    target = problem.target
    assert isinstance(target, Grid)
    other = replace(target, columns=target.rows, rows=target.columns)
    said = f'set "columns" to {target.columns} and "rows" to {target.rows}'
    return Fault(replace(problem, target=other), frozenset({"target-not-as-described"}), fix=said)


def _seen(problem: Problem, change: Callable[[int, Detection], Detection]) -> Problem:
    views = tuple(
        replace(view, detection=view.detection and change(row, view.detection))
        for row, view in enumerate(problem.views)
    )
    return replace(problem, views=views)


def _ids_from_one(problem: Problem, _: np.random.Generator) -> Fault:
    counted = _seen(problem, lambda _, seen: Detection(seen.ids + 1, seen.corners_px))
    return Fault(counted, frozenset({"target-not-as-described"}), fix="count the corners from 0")


def _mirrored(problem: Problem, rng: np.random.Generator) -> Fault:
    """The pictures are mirrored; the detector numbers the corners by what it sees, or kept the board's own ids."""
    width, height = problem.image_size
    flip = np.array([[-1.0, 1.0], [1.0, -1.0]])[rng.integers(2)]
    offset = np.where(flip < 0, [width - 1.0, height - 1.0], 0.0)
    target = problem.target
    assert isinstance(target, Grid)
    inner = target.columns - isinstance(target, Charuco)  # points a row
    # An asymmetric grid is no mirror image of itself.
    symmetric = not isinstance(target, CircleGrid) or target.layout == "symmetric"
    renumbered = rng.random() < 0.5 and symmetric

    def change(_: int, seen: Detection) -> Detection:
        ids = seen.ids // inner * inner + inner - 1 - seen.ids % inner if renumbered else seen.ids
        return Detection(ids, seen.corners_px * flip + offset)

    return Fault(_seen(problem, change), frozenset({"pictures-mirrored"}))


def _turned_after(problem: Problem, rng: np.random.Generator) -> Fault:
    """From some view on the pictures are upside down."""
    k = int(rng.integers(2, len(problem.views) - 1))
    corner = np.array(problem.image_size) - 1.0
    change = _seen(problem, lambda row, seen: Detection(seen.ids, corner - seen.corners_px) if row >= k else seen)
    return Fault(change, frozenset({"pictures-turned"}), (f"picture {k + 1}",), k)


def _camera(problem: Problem, matrix: Array, distortion: Array, says: str) -> Fault:
    assert problem.camera is not None
    camera = CameraModel(matrix, distortion, problem.camera.image_size)
    return Fault(replace(problem, camera=camera), frozenset({"intrinsics-do-not-fit"}), fix=says)


def _other_scale(problem: Problem, rng: np.random.Generator) -> Fault:
    """Intrinsics of pictures of another size."""
    assert problem.camera is not None
    factor = float(rng.choice([0.25, 0.5, 2.0, 4.0]))
    matrix = np.diag([factor, factor, 1.0]) @ problem.camera.matrix
    return _camera(problem, matrix, problem.camera.distortion, "multiply fx, fy, cx and cy by")


def _other_camera(problem: Problem, rng: np.random.Generator) -> Fault:
    """A lens of another focal length and distortion, its centre elsewhere."""
    assert problem.camera is not None
    matrix = problem.camera.matrix.copy()
    matrix[[0, 1], [0, 1]] *= rng.choice([0.5, 0.7, 0.85, 1.15, 1.4, 2.0])
    matrix[:2, 2] += 20 * rng.standard_normal(2)
    distortion = problem.camera.distortion.copy()
    distortion[:2] += 0.1 * rng.standard_normal(2)
    return _camera(problem, matrix, distortion, "leave the intrinsics out")


MIXUPS: dict[str, Put] = {
    "Euler angles in any other order": _rotations("euler-order", _another_order),
    "rotation vectors as any Euler angles": _rotations("vector-read-as-euler", _vector_as_euler),
    "any Euler angles as rotation vectors": _rotations("euler-read-as-vector", _euler_as_vector),
    "any Euler degrees as radians": _rotations("degrees-read-as-radians", _euler_scaled(float(180 / np.pi))),
    "any Euler radians as degrees": _rotations("radians-read-as-degrees", _euler_scaled(float(np.pi / 180))),
    "quaternion w first read as last": _rotations("quaternion-w-first", _scalar_taken_first),
    "the other setup": _setup_swapped,
    "poses inverted": _inverted,
    "poses off by 1 or 2": _off_by_some,
    "row lost or doubled at view k": _row_lost_or_doubled,
    "poses reversed": _reversed,
    "lexical order": _lexical,
    "two blocks swapped": _blocks_swapped,
    "board transposed": _transposed,
    "board one column less": _described(-1, 0),
    "board one column more": _described(1, 0),
    "board one row less": _described(0, -1),
    "corner ids from one": _ids_from_one,
    "pictures mirrored": _mirrored,
    "pictures turned from view k on": _turned_after,
    "intrinsics of another picture size": _other_scale,
    "intrinsics of another camera": _other_camera,
}
"""By what went wrong; the code that names it is in each."""

OF_INTRINSICS = frozenset({"intrinsics of another picture size", "intrinsics of another camera"})
"""Those that a session without intrinsics cannot have."""

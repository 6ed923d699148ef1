"""Moves blocks of points, P_base = base_T_camera @ P_camera, at memory speed.

The matrix includes the scale of units, so metres become millimetres in the same pass. `cv2.transform` is as fast as
memcpy when its destination exists and fits the cache; in place it would allocate.
"""

import math
from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from registration.errors import MotionError, UnitUnknown
from registration.points.layout import Array, Layout, Records, Triple

Unit = Literal["m", "mm"]

MILLIMETRES: dict[str, float] = {"mm": 1.0, "m": 1000.0}

MAX_TRANSLATION_MM = 1e6
"""1 km: no cell is as large."""

RIGID_TOLERANCE = 1e-5
"""Tolerance of R^T R against the identity: quaternions printed with six decimals stay within 4e-6."""

FLOAT32_REACH_MM = 20_000.0
"""Up to a translation of this length float32 arithmetic loses less than float32 storage (1 µm at 16 m)."""

LANES = 16
"""Points moved at once by the widest vector instructions (AVX-512, float32)."""


def scale_to_mm(unit: str | None) -> float:
    """Millimetres per `unit`. Raises UnitUnknown for a missing or unknown unit."""
    if unit not in MILLIMETRES:
        said = "no unit is stated" if unit is None else f"unit {unit!r} is not known"
        raise UnitUnknown(f"{said} for the cloud's coordinates", "state 'm' or 'mm'; it is never guessed")
    return MILLIMETRES[unit]


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """A rigid motion with a change of unit: `matrix` (3, 4) maps stored coordinates to coordinates to store."""

    matrix: Array
    rotation: Array

    @classmethod
    def of(cls, base_T_camera: ArrayLike, unit: str | None) -> "RigidMotion":
        """From a transform in mm and the cloud's unit, to mm. Raises MotionError, UnitUnknown."""
        a_T_b = np.asarray(base_T_camera, float)
        _require_rigid(a_T_b)
        matrix = np.hstack([a_T_b[:3, :3] * scale_to_mm(unit), a_T_b[:3, 3:]])
        return cls(matrix, a_T_b[:3, :3].copy())

    @property
    def fits_float32(self) -> bool:
        """Whether float32 coordinates may be moved in float32 arithmetic."""
        return bool(np.linalg.norm(self.matrix[:, 3]) <= FLOAT32_REACH_MM)


def _require_rigid(a_T_b: Array) -> None:
    fix = "give a 4×4 rigid transform in mm with the last row 0 0 0 1"
    if a_T_b.shape != (4, 4):
        raise MotionError(f"the transform has the shape {a_T_b.shape}", fix)
    if not np.all(np.isfinite(a_T_b)):
        raise MotionError("the transform has elements that are not finite", fix)
    if not np.array_equal(a_T_b[3], [0, 0, 0, 1]):
        raise MotionError(f"the transform's last row is {a_T_b[3].tolist()}", fix)
    farthest = float(np.abs(a_T_b[:3, 3]).max())
    if farthest > MAX_TRANSLATION_MM:
        raise MotionError(f"the transform moves by {farthest:.3g} mm, more than {MAX_TRANSLATION_MM:g}", fix)
    rotation = a_T_b[:3, :3]
    off = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if off > RIGID_TOLERANCE:
        raise MotionError(f"the transform scales or shears (R^T R is off by {off:.2g})", fix)
    if np.linalg.det(rotation) < 0:
        raise MotionError("the transform mirrors (determinant -1)", "check for a swapped axis or a left-handed frame")


def move_points(matrix: Array, points: NDArray[Any], out: NDArray[Any]) -> None:
    """`out` (n, 3) = matrix (3, 4 or 3, 3) @ points (n, 3): C-contiguous, of the same float type, in separate memory.

    A point gets the same bits wherever it stands in a block of any length: OpenCV rounds the last points of a call
    differently, so these are moved again, followed by `LANES` dummy points.
    """
    if not len(points):
        return
    cv2.transform(points[None], matrix, out[None])
    last = max(0, len(points) - LANES)
    row = np.zeros((1, 2 * LANES, 3), points.dtype)
    row[0, : len(points) - last] = points[last:]
    out[last:] = cv2.transform(row, matrix)[0, : len(points) - last]


class BlockMover:
    """Moves blocks of one layout with scratch memory of its own.

    `move` returns the block itself, changed in place where it must be writable, otherwise `into` or an internal block
    valid until the next call. `points` and `non_finite` count what was moved: a point with a NaN or infinite coordinate
    stays non-finite. Several at 0, 0, 0, as scanners write pixels without a point, become NaN. Both are counted.
    """

    def __init__(self, motion: RigidMotion, layout: Layout) -> None:
        self.points = 0
        self.non_finite = 0
        self._layout = layout
        self._xyz = _TripleMover(motion.matrix, layout, layout.xyz, motion.fits_float32)
        self._normals = layout.normals and _TripleMover(motion.rotation, layout, layout.normals, True)

    @property
    def in_place(self) -> bool:
        """Whether `move` writes into the block it is given."""
        return not self._xyz.whole_record

    def move(self, block: Records, into: Records | None = None) -> Records:
        self.points += len(block)
        moved = self._xyz.move(block, None if self.in_place else into)
        # A cheap sum shows whether there is anything to count; cv2's runs at memory speed without warnings.
        if not math.isfinite(sum(cv2.sumElems(moved[None]))):
            self.non_finite += int(len(moved) - np.count_nonzero(np.isfinite(moved).all(axis=1)))
        if self._xyz.whole_record:
            return np.ndarray(len(moved), self._layout.dtype, moved)
        self._xyz.store(moved, block)
        if self._normals:
            self._normals.store(self._normals.move(block), block)
        return block


class IntegerMover:
    """Moves records with 32-bit integer X, Y, Z in place; values that do not fit are clipped.

    `least` and `most` (3,): range of the integers stored.
    """

    def __init__(self, matrix: Array, layout: Layout) -> None:
        self.least, self.most = np.full(3, np.iinfo(np.int32).max), np.full(3, np.iinfo(np.int32).min)
        self._mover = _TripleMover(matrix, layout, layout.xyz, fits_float32=False)

    def move(self, block: Records) -> Records:
        """Move in place and return the block."""
        self._mover.store(self._mover.move(block), block)
        for axis, plane in enumerate(self._mover.planes(len(block))):
            self.least[axis] = min(self.least[axis], plane.min(initial=self.least[axis]))
            self.most[axis] = max(self.most[axis], plane.max(initial=self.most[axis]))
        return block


class _TripleMover:
    """Moves one triple of columns: directly where they lie side by side, otherwise plane by plane through scratch.

    Gathering three columns and merging them takes half as long as copying items of 12 bytes: NumPy copies 4 bytes with
    one instruction, but 12 by a call of memmove.
    """

    def __init__(self, matrix: Array, layout: Layout, names: Triple, fits_float32: bool) -> None:
        self._matrix = matrix
        self._names = names
        kind = layout.kind(names).newbyteorder("=")
        single = kind.itemsize <= 4 and kind.kind == "f" and fits_float32
        self._kind = kind if kind == np.int32 else np.dtype(np.float32 if single else float)
        self._marks = matrix.shape == (3, 4) and all(layout.dtype[name].kind == "f" for name in names)
        packed = layout.is_contiguous(names) and layout.dtype[names[0]] == self._kind
        self.whole_record = packed and layout.itemsize == 3 * self._kind.itemsize
        self._resize(0)

    def _resize(self, count: int) -> None:
        self._source, self._target = np.empty((count, 3), self._kind), np.empty((count, 3), self._kind)
        self._planes = np.empty((3, 1, 0 if self.whole_record else count), self._kind)

    def move(self, block: Records, into: Records | None = None) -> NDArray[Any]:
        """The moved triple of every record, (n, 3): in this mover's scratch or in `into` as whole records."""
        count = len(block)
        if len(self._target) < count:
            self._resize(count)
        source = self._source[:count]
        target = self._target[:count] if into is None else np.ndarray((count, 3), self._kind, into)
        if self.whole_record:
            numbers = np.ndarray((count, 3), self._kind, np.ascontiguousarray(block))
            if numbers.flags.aligned:
                source = numbers
            else:
                source[:] = numbers
        elif count:
            planes = self.planes(count)
            for plane, name in zip(planes, self._names, strict=True):
                plane[0] = block[name]
            cv2.merge(planes, source[None])
        move_points(self._matrix, source, target)
        if self._marks and (source.reshape(-1) == 0).any():
            nothing = ~source.any(axis=1)
            if np.count_nonzero(nothing) > 1:  # moved, they would lie where the scanner stands; one may be meant
                target[nothing] = np.nan
        return target

    def planes(self, count: int) -> list[NDArray[Any]]:
        """Three rows (1, count) of scratch; after `store` the columns that were stored."""
        return [plane[:, :count] for plane in self._planes]

    def store(self, moved: NDArray[Any], block: Records) -> None:
        """Write (n, 3) back into the records."""
        count = len(block)
        if not count:
            return
        planes = cv2.split(moved[None], self.planes(count))
        with np.errstate(over="ignore", invalid="ignore"):
            for plane, name in zip(planes, self._names, strict=True):
                block[name] = plane[0]

"""Robot poses as a file has them: numbers, with what the file says of their meaning and what it leaves open."""

import contextlib
import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations
from typing import Any

import numpy as np

from calibration.documents.imports.refusal import MAX_POSES, refusal
from calibration.errors import GeometryError
from calibration.kinematics.arm import Arm
from calibration.kinematics.conventions import (
    BRANDS,
    CONVENTIONS,
    LENGTH_UNITS,
    MM,
    NUMBERS,
    Convention,
    Frame,
    Kind,
    LengthUnit,
    Side,
    rotation_from_euler,
)
from calibration.problem import PosesOf, Setup
from calibration.transforms import (
    QUATERNION_NORM_TOLERANCE,
    Array,
    inverse,
    nearest_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
    transform,
)

MAX_ARM_MM, MIN_ARM_MM = 20_000.0, 50.0
"""Longest distance of a flange from its base, on tracks too, and the shortest in the median of the views."""

MIN_STATED_MM = 20.0  # no arm stays that near to its base in all views: then the unit in the header is wrong
MIXED_RATIO = 100.0
"""Poses so much nearer to the base than the farthest one are in another unit when a factor of 1000 explains it."""

MAX_MATRIX_ERROR = 5e-3
"""Largest distance of a matrix from a rotation (Frobenius); three decimals give up to 1.5e-3."""

MAX_ANGLE_RAD = 6.5
"""Slightly more than a full turn: a larger number is an angle in degrees."""

MAX_NUMBER = 1e15  # larger numbers are damaged, and their squares overflow
MAX_ANGLE_DEG = 360.0  # larger numbers are no angles of an orientation, and no joints
MAX_LAST_ROW = 1e-6  # largest deviation of a matrix' last row from 0, 0, 0, 1
NAMED = "columns "  # how the layout of numbers begins that have names
SMALL_ARM_MM, LARGE_ARM_MM = 200.0, 5000.0
"""Lengths without a unit that put the flange nearer or farther, in the median, may as well be in another."""


@dataclass(frozen=True, eq=False)
class PoseTable:
    """n poses of one source.

    labels : (n,) what the source calls each pose: a number, a name, the name of a file.
    lengths : (n, 3) translation in `unit`, None where the source does not say it.
    numbers : (n, k) of the orientation: 4, 3, or 9 row by row.
    convention : of the numbers, None where the source does not say it; by_axis: see `conventions`.
    images : (n,) names of the pictures, where the source names them; times_s: (n,) likewise.
    layout : what was understood, in words.
    side, named_frames : whose poses the names say they are, and in which direction, two where it can be meant in two
        senses (`sides.Relation`); the evidence may contradict it. opencv : the names are OpenCV's own.
    camera : the camera's poses of the same rows, where the source has both sides.
    setup, target : where the camera is and what it sees, as the source states it; the target as in session.json.
    cloud_unit : of the clouds, as scan.json states it.
    external_axes : (n, k) of the controller's axes beside the arm, mm or degrees, NaN where there is none.
    arm : of joints, which stand in `numbers`; `lengths` are empty then.
    pictures : (n,) uint8 (h, w) or (h, w, 3), where the source holds them.
    poses_of : the tool and work object of which the poses are, None for flange and base; `offsets` (n, 3 + k) are that
        tool's poses in the flange as the rows are written, with which `poses` are the flange's.
    parts : where every record has poses of several moving frames, each by the frame's name; the table is the first.
    """

    origin: str
    labels: tuple[str, ...]
    lengths: Array
    numbers: Array
    kind: Kind
    layout: str
    convention: Convention | None = None
    by_axis: bool = False
    unit: LengthUnit | None = None
    frame: Frame | None = None
    images: tuple[str, ...] | None = None
    times_s: Array | None = None
    notes: tuple[str, ...] = ()
    side: Side | None = None
    named_frames: tuple[Frame, ...] = ()
    opencv: bool = False
    camera: "PoseTable | None" = None
    setup: Setup | None = None
    target: Any = None
    cloud_unit: Any = None
    external_axes: Array | None = None
    arm: Arm | None = None
    pictures: tuple[Array, ...] = ()
    poses_of: PosesOf | None = None
    offsets: Array | None = None
    parts: "Mapping[str, PoseTable]" = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def moves(self) -> bool:
        """Whether not all of several poses are the same."""
        numbers = np.concatenate([self.lengths, self.numbers], axis=1)
        return len(numbers) == 1 or not bool(np.all(numbers == numbers[0]))

    def checked(self) -> "PoseTable":
        """The table itself. Raises DocumentError when there are no poses, too many, or numbers that are not finite."""
        if not 0 < len(self) <= MAX_POSES:
            what = "no poses in it" if not len(self) else f"{len(self)} poses, where {MAX_POSES} are read"
            raise refusal(self.origin, "poses", what, "give one pose for each picture")
        assert self.numbers.shape == (len(self), NUMBERS[self.kind])
        finite = np.all(np.abs(self.lengths) < MAX_NUMBER, axis=1) & np.all(np.abs(self.numbers) < MAX_NUMBER, axis=1)
        if not finite.all():
            place = f"pose {self.labels[finite.argmin()]}"
            raise refusal(self.origin, place, "a number is missing or not finite", "correct it")
        norms = np.linalg.norm(self.numbers, axis=1)
        wrong = np.abs(norms - 1) > QUATERNION_NORM_TOLERANCE
        if self.kind == "quaternion" and wrong.any():
            row = int(wrong.argmax())
            what = f"a quaternion of norm {norms[row]:.4g}, not 1 (of {self.layout})"
            raise refusal(self.origin, f"pose {self.labels[row]}", what, "give unit quaternions")
        reach = np.linalg.norm(self.lengths, axis=1)
        near = reach < reach.max(initial=0.0) / MIXED_RATIO
        if near.any() and np.median(reach[near]) > 0.0 and 1 / 5 < 1000 * np.median(reach[near]) / reach.max() < 5:
            row = int(near.argmax())
            what = f"{reach[row]:.4g} from the base, where others are up to {reach.max():.4g}: another unit"
            raise refusal(self.origin, f"pose {self.labels[row]}", what, "give all lengths in one unit")
        return self

    def conventions(self) -> tuple[Convention, ...]:
        """The one that the source states, or all that its numbers allow."""
        if self.convention is not None:
            return (self.convention,)
        possible = []
        for one in allowed_conventions(self.kind, self.numbers, by_axis=self.by_axis):
            with contextlib.suppress(GeometryError):
                self.poses(one, "mm", "base_T_flange")
                possible.append(one)
        return tuple(possible)

    def units(self) -> tuple[LengthUnit, ...]:
        """The one that the source states, or those for which the lengths are those of an arm."""
        if self.unit is not None:
            return (self.unit,)
        return tuple(unit for unit in LENGTH_UNITS if MIN_ARM_MM <= self.reach_mm(unit) <= MAX_ARM_MM) or ("mm",)

    def reach_mm(self, unit: LengthUnit) -> float:
        """Distance of the flange from its base in the median of the poses, with lengths in that unit."""
        return float(np.median(np.linalg.norm(self.lengths, axis=1))) * MM[unit]

    def require_reach(self, unit: LengthUnit, said_by: str) -> None:
        """Raises DocumentError when a stated unit puts the poses farther from the base than any arm, or all at it."""
        near = np.linalg.norm(self.lengths, axis=1).max() * MM[unit] < MIN_STATED_MM and len(self) > 1
        if (reach_mm := self.reach_mm(unit)) > MAX_ARM_MM or (near and said_by == "header"):
            what = f"in {unit} as stated, the poses are {reach_mm / 1000:.3g} m from the base"
            raise refusal(self.origin, said_by, what, "correct the unit")

    def frames(self) -> tuple[Frame, ...]:
        """The one that the source states, or both."""
        return ("base_T_flange", "flange_T_base") if self.frame is None else (self.frame,)

    def poses(self, convention: Convention, unit: LengthUnit, frame: Frame) -> Array:
        """base_T_flange (n, 4, 4) in mm. Raises GeometryError that names the pose."""
        if self.kind == "joints":
            if self.arm is None:
                raise GeometryError("joints are poses of a known arm only")
            poses = self.arm.forward(np.radians(self.numbers) if convention.degrees else self.numbers)
        else:
            poses = transform(rotations_of(convention, self.numbers, by_axis=self.by_axis), self.lengths * MM[unit])
        poses = poses if frame == "base_T_flange" else inverse(poses)
        if self.offsets is None:
            return poses
        turns = rotations_of(convention, self.offsets[:, 3:], by_axis=self.by_axis)
        return poses @ inverse(transform(turns, self.offsets[:, :3] * MM[unit]))

    def varying_axes(self) -> list[tuple[int, Array]]:
        """Number and readings (n,) of the external axes that move."""
        if self.external_axes is None:
            return []
        readings = enumerate(self.external_axes.T, 1)
        return [(number, one) for number, one in readings if np.all(np.isfinite(one)) and np.ptp(one) > 0]

    def may_be_offset(self, tool: "PoseTable") -> bool:
        """Whether a tool's poses in the flange stand still, and are written as these are in an arm's lengths; angles of
        which only evidence shows the convention, that of these, have to be zero."""
        alike = all(getattr(tool, name) == getattr(self, name) for name in ("kind", "convention", "by_axis", "unit"))
        share = np.linalg.norm(tool.lengths[0]) / np.linalg.norm(self.lengths, axis=1).max()
        is_clear = tool.kind != "angles" or tool.convention is not None or not tool.numbers.any()
        is_still = len(tool) == 1 or not tool.moves
        return alike and is_clear and is_still and bool(share == 0 or 1 / MIXED_RATIO < share < 1)

    def may_be_joints(self) -> bool:
        """Whether six numbers without names could be an arm's joints."""
        numbers = np.concatenate([self.lengths, self.numbers], axis=1)
        unnamed = self.kind == "angles" and self.convention is None and self.unit is None
        unnamed = unnamed and not self.by_axis and not self.layout.startswith(NAMED)
        return unnamed and bool(np.abs(numbers).max(initial=0.0) <= MAX_ANGLE_DEG)

    def take(self, rows: Sequence[int]) -> "PoseTable":
        """Only some poses, in another order."""
        chosen = list(rows)
        fields = ("lengths", "numbers", "times_s", "external_axes", "offsets")
        arrays: dict[str, Any] = {name: one[chosen] for name in fields if (one := getattr(self, name)) is not None}
        images = None if self.images is None else tuple(self.images[row] for row in chosen)
        arrays["pictures"] = tuple(self.pictures[row] for row in chosen) if self.pictures else ()
        camera = None if self.camera is None else self.camera.take(chosen)
        return replace(self, labels=tuple(self.labels[row] for row in chosen), images=images, camera=camera, **arrays)


def concatenate(tables: Sequence[PoseTable], labels: Sequence[str], origin: str) -> PoseTable:
    """One table of several files with a pose each. Raises DocumentError that names the first file of another layout."""
    first = tables[0]
    for table, label in zip(tables, labels, strict=True):
        if len(table) != 1:
            raise refusal(origin, label, f"{len(table)} poses, where the other files have one", "give one pose a file")
        if (table.kind, table.convention, table.by_axis, table.unit) != (
            first.kind, first.convention, first.by_axis, first.unit,
        ):  # fmt: skip
            what = f"another layout ({table.layout}) than {labels[0]} ({first.layout})"
            raise refusal(origin, label, what, "write all poses alike")
    cameras = [table.camera for table in tables if table.camera is not None]
    if first.camera is not None and len(cameras) < len(tables):
        missing = next(table.origin for table in tables if table.camera is None)
        raise refusal(missing, "file", "without the camera's pose that the others have", "write all poses alike")
    arrays: dict[str, Any] = {"images": None, "times_s": None}
    for name in ("lengths", "numbers", "external_axes", "offsets"):
        listed = [one for table in tables if (one := getattr(table, name)) is not None]
        arrays[name] = np.concatenate(listed) if len(listed) == len(tables) else None
    pictures = tuple(one for table in tables for one in table.pictures)
    arrays["pictures"] = pictures if len(pictures) == len(tables) else ()
    camera = None if first.camera is None else concatenate(cameras, labels, origin)
    layout = f"{len(tables)} files with one pose each: {first.layout}"
    return replace(first, origin=origin, labels=tuple(labels), layout=layout, camera=camera, **arrays).checked()


KINDS = {count: kind for kind, count in NUMBERS.items()}


def table_of_arrays(
    origin: str, labels: Sequence[str], lengths: Array, numbers: Array, layout: str, convention: str = "", **more: Any
) -> PoseTable:
    """The checked table of lengths (n, 3) and numbers (n, k), of which k says the kind; `convention` is a name.

    Without labels the poses are counted from 1.
    """
    kind, known = KINDS[numbers.shape[1]], CONVENTIONS.get(convention)
    labels = labels or [str(at + 1) for at in range(len(lengths))]
    return PoseTable(origin, tuple(labels), lengths, numbers, kind, layout, known, **more).checked()


def table_of_matrices(origin: str, labels: Sequence[str], matrices: Array, layout: str) -> PoseTable:
    """The table of matrices (n, 3 or 4, 4), row by row; a last row that holds the translation is transposed first, and
    one that is neither raises DocumentError."""
    matrices = matrices[:, :3] if not np.any(matrices[:, 3:]) else matrices  # a last row that was never written
    if matrices.shape[1] == 4:
        last = np.abs(matrices[:, 3] - [0, 0, 0, 1]).max(axis=1)
        column = np.abs(matrices[:, :, 3] - [0, 0, 0, 1]).max(axis=1)
        if np.all(column < MAX_LAST_ROW) and not np.all(last < MAX_LAST_ROW):
            layout, matrices = f"{layout}, column by column", np.swapaxes(matrices, 1, 2)
        elif not np.all(last < MAX_LAST_ROW):
            row = int(np.argmax(~(last < MAX_LAST_ROW)))
            what = "the last row of the 4 x 4 matrix is not 0, 0, 0, 1"
            raise refusal(origin, f"pose {labels[row] if labels else row + 1}", what, "write rigid transforms")
    turns = matrices[:, :3, :3].reshape(-1, 9).astype(float)
    return table_of_arrays(origin, labels, matrices[:, :3, 3].astype(float), turns, layout, "matrix")


def find_conventions(name: str) -> tuple[tuple[Convention, ...], LengthUnit | None]:
    """The conventions of a name, several of a brand, and its unit. Raises GeometryError that names the nearest."""
    if name.lower() in BRANDS:
        brand = BRANDS[name.lower()]
        return tuple(CONVENTIONS[one] for one in brand.conventions), brand.unit
    if name in CONVENTIONS:
        return (CONVENTIONS[name],), None
    near = difflib.get_close_matches(name, [*BRANDS, *CONVENTIONS], n=1, cutoff=0.4)
    hint = f"; did you mean '{near[0]}'?" if near else ""
    raise GeometryError(f"no convention is called {name!r}{hint}")


def rotations_of(convention: Convention, numbers: Array, *, by_axis: bool = False) -> Array:
    """Rotations (n, 3, 3) of the numbers (n, k).

    by_axis : the three numbers are those of the axes x, y, z, not in the order of the rotations.
    Raises GeometryError for a norm that is not 1 or a matrix that is no rotation, naming the row.
    """
    match convention.kind:
        case "quaternion":
            return _from_quaternions(numbers if convention.order == "wxyz" else np.roll(numbers, 1, axis=1))
        case "points":
            return np.tile(np.eye(3), (len(numbers), 1, 1))
        case "matrix":
            matrices = numbers.reshape(-1, 3, 3)
            return _from_matrices(matrices if convention.order == "rows" else np.swapaxes(matrices, 1, 2))
    radians = np.radians(numbers) if convention.degrees else numbers
    if convention.order == "vector":
        return rotation_from_vector(radians)
    order = convention.order
    if by_axis and order != "ZYZ":
        radians = radians[:, ["xyz".index(axis) for axis in order.lower()]]
    if order.isupper():
        return rotation_from_euler(radians, order)
    return rotation_from_euler(radians[:, ::-1], order[::-1].upper())


def _from_quaternions(wxyz: Array) -> Array:
    norms = np.linalg.norm(wxyz, axis=1)
    wrong = np.flatnonzero(~(np.abs(norms - 1) <= QUATERNION_NORM_TOLERANCE))
    if len(wrong):
        raise GeometryError(f"pose {wrong[0] + 1}: the quaternion's norm is {norms[wrong[0]]:.4g}, not 1")
    return rotation_from_quaternion(wxyz)


def _from_matrices(matrices: Array) -> Array:
    rotations = np.empty_like(matrices)
    for row, matrix in enumerate(matrices):
        rotations[row], distance = nearest_rotation(matrix)
        if not distance <= MAX_MATRIX_ERROR:
            raise GeometryError(f"pose {row + 1}: the matrix is {distance:.2g} away from a rotation")
    return rotations


def allowed_conventions(kind: Kind, numbers: Array, *, by_axis: bool = False) -> tuple[Convention, ...]:
    """The conventions under which numbers (n, k) of a kind may be meant.

    Angles beyond a full turn are degrees. By axis, orders in which an axis occurs twice are left out but for Kawasaki's
    ZYZ, which some call rx, ry, rz, and the extrinsic ones, which are the intrinsic ones reversed.
    """
    found: Sequence[Convention] = [convention for convention in CONVENTIONS.values() if convention.kind == kind]
    if kind in ("angles", "joints"):
        if np.max(np.abs(numbers), initial=0.0) > MAX_ANGLE_RAD:
            found = [convention for convention in found if convention.degrees]
        if by_axis:
            found = [one for one in found if one.order in {"vector", "ZYZ", *map("".join, permutations("XYZ"))}]
    return tuple(found)

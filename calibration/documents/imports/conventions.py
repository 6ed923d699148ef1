"""How robots and programs write an orientation: one table of conventions, and one of brands.

A name is that of the quaternion's order, the rotation vector, the matrix' order, or of Euler angles: upper case for
intrinsic rotations (about axes that turn along), lower case for extrinsic ones (about fixed axes), as scipy does.
The numbers stand in the order of the rotations; where columns are named after axes (rx, ry, rz), each is used for its
axis. An extrinsic order is the reversed intrinsic order of the reversed numbers (Diebel, Representing Attitude, 2006).
"""

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from calibration.diagnosis.orientation_readings import ORDERS, rotation_from_euler
from calibration.errors import GeometryError
from calibration.transforms import (
    QUATERNION_NORM_TOLERANCE,
    Array,
    nearest_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
)

Kind = Literal["quaternion", "angles", "matrix", "joints", "points"]
LengthUnit = Literal["m", "mm"]

MAX_MATRIX_ERROR = 5e-3
"""Largest distance of a matrix from a rotation (Frobenius); three decimals give up to 1.5e-3."""


@dataclass(frozen=True)
class Convention:
    """How the numbers of an orientation are meant; `kind` says how many: 4, 3, 9 row by row, 6 joints, or none."""

    name: str
    kind: Kind
    order: str
    degrees: bool = False

    @property
    def words(self) -> str:
        """The convention in words."""
        match self.kind:
            case "quaternion":
                return f"a quaternion {', '.join(self.order)}"
            case "points":
                return "points without an orientation"
            case "matrix":
                return "a matrix" if self.order == "rows" else "a matrix, column by column"
        unit = "degrees" if self.degrees else "radians"
        if self.kind == "joints":
            return f"joints in {unit}"
        if self.order == "vector":
            return f"a rotation vector in {unit}"
        if self.order.isupper():
            axes = ", ".join(axis + "'" * count for count, axis in enumerate(self.order))
            return f"Euler angles about {axes} (intrinsic) in {unit}"
        return f"Euler angles about fixed {', '.join(self.order)} (extrinsic) in {unit}"


CONVENTIONS: dict[str, Convention] = {
    one.name: one
    for one in (
        Convention("quaternion-wxyz", "quaternion", "wxyz"),
        Convention("quaternion-xyzw", "quaternion", "xyzw"),
        Convention("matrix", "matrix", "rows"),
        Convention("matrix-columns", "matrix", "columns"),
        Convention("joints", "joints", "joints", degrees=True),
        Convention("joints-rad", "joints", "joints"),
        Convention("points", "points", "none"),
        Convention("rotation-vector", "angles", "vector"),
        Convention("rotation-vector-deg", "angles", "vector", degrees=True),
        *(
            Convention(f"euler-{order}{'' if degrees else '-rad'}", "angles", order, degrees)
            for intrinsic in ORDERS
            for order in (intrinsic, intrinsic.lower())
            for degrees in (True, False)
        ),
    )
}
"""Every convention by its name: Euler angles are degrees, with `-rad` radians."""

NUMBERS: dict[Kind, int] = {"quaternion": 4, "angles": 3, "matrix": 9, "joints": 6, "points": 0}


@dataclass(frozen=True)
class Brand:
    """How a brand's controllers and pendants write a pose: convention for each kind of numbers, and the unit."""

    words: str
    conventions: tuple[str, ...]
    unit: LengthUnit


BRANDS: dict[str, Brand] = {
    "abb": Brand("RAPID's q1, q2, q3, q4 or EulerZYX shown as EX, EY, EZ", ("quaternion-wxyz", "euler-xyz"), "mm"),
    "kuka": Brand("A about Z, B about Y', C about X''", ("euler-ZYX",), "mm"),
    "fanuc": Brand("W, P, R about fixed X, Y, Z", ("euler-xyz",), "mm"),
    "ur": Brand("the rotation vector of p[x, y, z, rx, ry, rz]", ("rotation-vector",), "m"),
    "yaskawa": Brand("Rx, Ry, Rz about fixed X, Y, Z", ("euler-xyz",), "mm"),
    "kawasaki": Brand("O about Z, A about Y', T about Z''", ("euler-ZYZ",), "mm"),
    "staubli": Brand("Rx, Ry, Rz about X, Y', Z''", ("euler-XYZ",), "mm"),
    "doosan": Brand("A about Z, B about Y', C about Z''", ("euler-ZYZ",), "mm"),
    "franka": Brand("O_T_EE, a 4 x 4 matrix column by column", ("matrix-columns",), "m"),
    "nachi": Brand("about Z, Y', X''", ("euler-ZYX",), "mm"),
    "hyundai": Brand("about X, Y', Z''", ("euler-XYZ",), "mm"),
    "ros": Brand("a quaternion x, y, z, w, or roll, pitch, yaw", ("quaternion-xyzw", "euler-xyz-rad"), "m"),
}
"""Brands by their name. ABB: RAPID reference, EulerZYX; KUKA: KSS, frames; the others as the hand-eye samples of Zivid
list them (rotation_format_configuration.py, 2026-03). Staubli is RoboDK's (Staubli_2_Pose). Franka and ROS are in
neither, and not confirmed by a manual."""


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
    if by_axis:
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

    Angles beyond a full turn are degrees. By axis, orders in which an axis occurs twice are left out, and the extrinsic
    ones, which are the intrinsic ones reversed.
    """
    found: Sequence[Convention] = [convention for convention in CONVENTIONS.values() if convention.kind == kind]
    if kind in ("angles", "joints"):
        if np.max(np.abs(numbers), initial=0.0) > MAX_ANGLE_RAD:
            found = [convention for convention in found if convention.degrees]
        if by_axis:
            found = [
                one for one in found if one.order == "vector" or (one.order.isupper() and len(set(one.order)) == 3)
            ]
    return tuple(found)


MAX_ANGLE_RAD = 6.5
"""Slightly more than a full turn: a larger number is an angle in degrees."""

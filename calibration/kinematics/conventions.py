"""How robots and programs write lengths and orientations: the tables that import, diagnosis and export share.

A name is that of the quaternion's order, the rotation vector, the matrix' order, or of Euler angles: upper case for
intrinsic rotations (about axes that turn along), lower case for extrinsic ones (about fixed axes), as scipy does.
The numbers stand in the order of the rotations; where columns are named after axes (rx, ry, rz), each is used for its
axis. An extrinsic order is the reversed intrinsic order of the reversed numbers (Diebel, Representing Attitude, 2006).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calibration.kinematics.axis_rotations import rotation_about
from calibration.transforms import Array, quaternion_from_rotation, vector_from_rotation

Kind = Literal["quaternion", "angles", "matrix", "joints", "points"]
LengthUnit = Literal["m", "mm"]
LENGTH_UNITS: tuple[LengthUnit, ...] = ("m", "mm")
Frame = Literal["base_T_flange", "flange_T_base"]
Side = Literal["robot", "camera"]

MM: dict[str, float] = {"mm": 1.0, "m": 1000.0, "cm": 10.0, "um": 1e-3, "inches": 25.4}
"""Units of lengths in mm; those that are no LengthUnit are converted as they are read."""

ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "XYX", "XZX", "YXY", "YZY", "ZXZ", "ZYZ")
"""Intrinsic orders; the first six are of three axes (Tait and Bryan), the others of two."""

MIN_LOCK_SINE = 0.01
"""Sine of the angle from gimbal lock below which two of three Euler angles are not determined."""


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

    @property
    def angles(self) -> str:
        """The convention of its three numbers."""
        return next(one for one in self.conventions if CONVENTIONS[one].kind == "angles")


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


def numbers_of(name: str, rotation: Array) -> tuple[float, ...]:
    """The numbers of a rotation (3, 3) in the convention of that name, whose quaternions have w >= 0."""
    convention = CONVENTIONS[name]
    match convention.kind:
        case "quaternion":
            wxyz = quaternion_from_rotation(rotation)
            return tuple((wxyz if convention.order == "wxyz" else np.roll(wxyz, -1)).tolist())
        case "matrix":
            return tuple((rotation if convention.order == "rows" else rotation.T).ravel().tolist())
    if convention.order == "vector":
        radians = vector_from_rotation(rotation)
    elif convention.order.isupper():
        radians = euler_angles(rotation[None], convention.order)[0]
    else:
        radians = euler_angles(rotation[None], convention.order[::-1].upper())[0, ::-1]
    return tuple((np.degrees(radians) if convention.degrees else radians).tolist())


def rotation_from_euler(angles_rad: Array, order: str) -> Array:
    """(..., 3, 3) of intrinsic Euler angles (..., 3): R_i(a) R_j(b) R_k(c) for the order "ijk"."""
    one, two, three = (rotation_about("XYZ".index(axis), angles_rad[..., at]) for at, axis in enumerate(order))
    rotation: Array = one @ two @ three
    return rotation


def euler_angles(rotations: Array, order: str) -> Array:
    """Intrinsic Euler angles (n, 3) rad of rotations (n, 3, 3); the middle one is within pi/2, or from 0 to pi.

    The third is found after the first turn is taken away, so that the three give the rotation back in gimbal lock, too.
    """
    i, j = "XYZ".index(order[0]), "XYZ".index(order[1])
    k = 3 - i - j
    sign = 1.0 if (i, j, k) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
    r, of_two = np.moveaxis(rotations, 0, -1), order[0] == order[2]
    a = np.arctan2(r[j, i], -sign * r[k, i]) if of_two else np.arctan2(-sign * r[j, k], r[k, k])
    cosine, sine = np.cos(a), sign * np.sin(a)
    row = cosine * r[j] + sine * r[k]
    if of_two:
        b = np.arctan2(sign * (sine * r[j, i] - cosine * r[k, i]), r[i, i])
        c = np.arctan2(-sign * row[k], row[j])
    else:
        b = np.arctan2(sign * r[i, k], cosine * r[k, k] - sine * r[j, k])
        c = np.arctan2(sign * row[i], row[j])
    return np.stack([a, b, c], axis=1)


def euler_numbers(
    rotations: Array, order: str, min_lock_sine: float = MIN_LOCK_SINE
) -> tuple[Array, NDArray[np.bool_]]:
    """Both triples of intrinsic Euler angles (n, 2, 3) rad of rotations (n, 3, 3), and whether they are determined."""
    a, b, c = euler_angles(rotations, order).T
    if order[0] == order[2]:
        other, determined = -b, np.abs(np.sin(b)) > min_lock_sine
    else:
        other, determined = np.pi - b, np.abs(np.cos(b)) > min_lock_sine
    both = np.stack([np.stack([a, b, c], axis=1), np.stack([a + np.pi, other, c + np.pi], axis=1)], axis=1)
    return (both + np.pi) % (2 * np.pi) - np.pi, determined

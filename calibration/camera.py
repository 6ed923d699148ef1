"""Camera with one of OpenCV's lens models, in OpenCV's conventions. Pixel (0, 0) is the centre of the first pixel.

A lens maps ideal to distorted normalised coordinates. Pinhole: D. C. Brown, "Close-range camera calibration", 1971;
rational terms: D. Claus & A. Fitzgibbon, 2005; thin prism: J. Weng et al., 1992; tilted sensor: OpenCV's calibration
documentation. Fisheye: J. Kannala & S. Brandt, 2006.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol

import numpy as np

from calibration.transforms import Array

LensModel = Literal["pinhole", "fisheye"]

COEFFICIENT_COUNTS: dict[LensModel, tuple[int, ...]] = {"pinhole": (4, 5, 8, 12, 14), "fisheye": (4,)}
"""Numbers of coefficients that a model may have."""

BROWN = 5
"""k1, k2, p1, p2, k3."""

Slopes = tuple[Array, Array, Array, Array]
"""d x' / d x, d x' / d y, d y' / d x, d y' / d y."""


class Lens(Protocol):
    """x and y are ideal normalised coordinates, arrays of any one shape."""

    def distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Distorted x and y."""
        ...

    def slopes(self, x: Array, y: Array) -> Slopes:
        """Derivatives of `distort` by x and y."""
        ...

    def by_coefficient(self, index: int, x: Array, y: Array) -> tuple[Array, Array]:
        """Derivatives of distorted x and y by one of the coefficients; zero when the lens has no such."""
        ...


def lens_of(model: LensModel, coefficients: Array) -> Lens:
    """The lens of a model and its coefficients. Raises ValueError for a number of coefficients it cannot have."""
    count = len(coefficients)
    if count not in COEFFICIENT_COUNTS[model]:
        raise ValueError(f"a {model} lens has {COEFFICIENT_COUNTS[model]} coefficients, not {count}")
    if model == "fisheye":
        return FisheyeLens(coefficients)
    if count <= BROWN:
        return BrownLens(np.pad(coefficients, (0, BROWN - count)))
    return RationalLens(np.pad(coefficients, (0, 14 - count)))


def _power(r2: Array, exponent: int) -> Array:
    """`r2` to the power of 1, 2 or 3, by products, which are quicker than a general power."""
    return r2 if exponent == 1 else r2 * r2 if exponent == 2 else r2 * r2 * r2


@dataclass(frozen=True, eq=False)
class BrownLens:
    """`coefficients` (5,): k1, k2, p1, p2, k3."""

    coefficients: Array

    def distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        k1, k2, p1, p2, k3 = self.coefficients
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        xy2 = 2 * x * y
        return x * radial + p1 * xy2 + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + p2 * xy2

    def slopes(self, x: Array, y: Array) -> Slopes:
        k1, k2, p1, p2, k3 = self.coefficients
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))
        along_x, along_y = p2 * x, p1 * y
        across = x * y * slope + 2 * p1 * x + 2 * p2 * y
        return (
            radial + x * x * slope + 2 * along_y + 6 * along_x,
            across,
            across,
            radial + y * y * slope + 6 * along_y + 2 * along_x,
        )

    def by_coefficient(self, index: int, x: Array, y: Array) -> tuple[Array, Array]:
        r2 = x * x + y * y
        match index:
            case 0 | 1 | 4:
                power = _power(r2, 3 if index == 4 else index + 1)
                return x * power, y * power
            case 2:
                return 2 * x * y, r2 + 2 * y * y
            case 3:
                return r2 + 2 * x * x, 2 * x * y
            case _:
                return np.zeros_like(x), np.zeros_like(x)


@dataclass(frozen=True, eq=False)
class RationalLens:
    """`coefficients` (14,): k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau x, tau y."""

    coefficients: Array

    @cached_property
    def _tilt(self) -> Array:
        """(3, 3) homography of the sensor tilted by tau x and tau y."""
        (cx, sx), (cy, sy) = ((np.cos(angle), np.sin(angle)) for angle in self.coefficients[12:])
        turn = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]) @ np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
        onto = np.array([[turn[2, 2], 0, -turn[0, 2]], [0, turn[2, 2], -turn[1, 2]], [0, 0, 1]])
        return np.asarray(onto @ turn)

    def _radial(self, r2: Array) -> tuple[Array, Array, Array]:
        """Numerator, denominator and, by r², the derivative of the radial factor."""
        k1, k2, _, _, k3, k4, k5, k6 = self.coefficients[:8]
        top, below = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        by_top, by_below = k1 + r2 * (2 * k2 + 3 * r2 * k3), k4 + r2 * (2 * k5 + 3 * r2 * k6)
        return top, below, (by_top * below - top * by_below) / below**2

    def _remove_tilt(self, x: Array, y: Array) -> tuple[Array, Array]:
        p1, p2 = self.coefficients[2:4]
        s1, s2, s3, s4 = self.coefficients[8:12]
        r2 = x * x + y * y
        top, below, _ = self._radial(r2)
        radial, xy2 = top / below, 2 * x * y
        along = x * radial + p1 * xy2 + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2)
        return along, y * radial + p1 * (r2 + 2 * y * y) + p2 * xy2 + r2 * (s3 + r2 * s4)

    def distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        along, across = self._remove_tilt(x, y)
        if not np.any(self.coefficients[12:]):
            return along, across
        u, v, w = (row[0] * along + row[1] * across + row[2] for row in self._tilt)
        return u / w, v / w

    def slopes(self, x: Array, y: Array) -> Slopes:
        p1, p2 = self.coefficients[2:4]
        s1, s2, s3, s4 = self.coefficients[8:12]
        r2 = x * x + y * y
        top, below, by_r2 = self._radial(r2)
        radial, slope = top / below, 2 * by_r2
        prism_x, prism_y = 2 * (s1 + 2 * r2 * s2), 2 * (s3 + 2 * r2 * s4)
        across = x * y * slope + 2 * p1 * x + 2 * p2 * y
        xx = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x + x * prism_x
        yy = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x + y * prism_y
        return self._tilt_slopes(x, y, (xx, across + y * prism_x, across + x * prism_y, yy))

    def by_coefficient(self, index: int, x: Array, y: Array) -> tuple[Array, Array]:
        r2 = x * x + y * y
        top, below, _ = self._radial(r2)
        zero = np.zeros_like(x)
        if index in (2, 3):
            moved = BrownLens.by_coefficient(BrownLens(self.coefficients[:BROWN]), index, x, y)
        elif index < 8:
            power = _power(r2, {0: 1, 1: 2, 4: 3, 5: 1, 6: 2, 7: 3}[index])
            factor = power / below if index < BROWN else -power * top / below**2
            moved = x * factor, y * factor
        elif index < 12:
            power = r2 ** (1 + index % 2)
            moved = (power, zero) if index < 10 else (zero, power)
        else:
            moved = zero, zero
        one = np.ones_like(x)
        xx, xy, yx, yy = self._tilt_slopes(x, y, (one, zero, zero, one))
        return xx * moved[0] + xy * moved[1], yx * moved[0] + yy * moved[1]

    def _tilt_slopes(self, x: Array, y: Array, before: Slopes) -> Slopes:
        """The derivatives after the tilt, of those `before` it."""
        if not np.any(self.coefficients[12:]):
            return before
        along, across = self._remove_tilt(x, y)
        u, v, w = (row[0] * along + row[1] * across + row[2] for row in self._tilt)
        (a, b, _), (c, d, _), (e, f, _) = self._tilt
        ux, uy, vx, vy = (a - e * u / w) / w, (b - f * u / w) / w, (c - e * v / w) / w, (d - f * v / w) / w
        xx, xy, yx, yy = before
        return ux * xx + uy * yx, ux * xy + uy * yy, vx * xx + vy * yx, vx * xy + vy * yy


SMALL_RADIUS = 1e-4
"""Below it the fisheye's factor is expanded about the axis."""


@dataclass(frozen=True, eq=False)
class FisheyeLens:
    """`coefficients` (4,): k1 to k4 of the image's radius over the angle from the axis, up to 90 degrees."""

    coefficients: Array

    def _factor(self, x: Array, y: Array) -> tuple[Array, Array, Array, Array]:
        """Radius, angle, distorted over ideal radius, and that ratio's derivative over the radius."""
        radius = np.hypot(x, y)
        angle, square = np.arctan(radius), np.arctan(radius) ** 2
        k1, k2, k3, k4 = self.coefficients
        bent = angle * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
        slope = 1 + square * (3 * k1 + square * (5 * k2 + square * (7 * k3 + square * 9 * k4)))
        small = radius < SMALL_RADIUS
        safe = np.where(small, 1.0, radius)
        factor = np.where(small, 1 + (k1 - 1 / 3) * radius**2, bent / safe)
        by_radius = np.where(small, 2 * (k1 - 1 / 3), (slope / (1 + radius**2) - factor) / safe**2)
        return radius, angle, factor, by_radius

    def distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        _, _, factor, _ = self._factor(x, y)
        return x * factor, y * factor

    def slopes(self, x: Array, y: Array) -> Slopes:
        _, _, factor, by_radius = self._factor(x, y)
        across = x * y * by_radius
        return factor + x * x * by_radius, across, across, factor + y * y * by_radius

    def by_coefficient(self, index: int, x: Array, y: Array) -> tuple[Array, Array]:
        if index >= len(self.coefficients):
            return np.zeros_like(x), np.zeros_like(x)
        radius, angle, _, _ = self._factor(x, y)
        factor = angle ** (2 * index + 3) / np.where(radius < SMALL_RADIUS, 1.0, radius)
        return x * factor, y * factor


@dataclass(frozen=True, eq=False)
class CameraModel:
    """`matrix` (3, 3) in px; `image_size` (width, height) in px.

    distortion : coefficients in OpenCV's order: 4, 5 (k1, k2, p1, p2, k3), 8, 12 or 14; 4 (k1 to k4) of a fisheye.
    """

    matrix: Array
    distortion: Array
    image_size: tuple[int, int]
    lens_model: LensModel = "pinhole"

    def project(self, points_camera: Array) -> Array:
        """Pixels (n, 2) of points (n, 3) in the camera frame; NaN where a point is not in front of it."""
        z = points_camera[:, 2:]
        with np.errstate(divide="ignore", invalid="ignore"):
            xy = np.where(z > 0, points_camera[:, :2] / z, np.nan)
        x, y = self.distort(xy).T
        (fx, skew, cx), (_, fy, cy), _ = self.matrix
        return np.column_stack([fx * x + skew * y + cx, fy * y + cy])

    def distort(self, xy: Array) -> Array:
        """Distorted normalised coordinates (n, 2) of ideal ones (n, 2)."""
        return np.column_stack(self.lens.distort(xy[:, 0], xy[:, 1]))

    @cached_property
    def lens(self) -> Lens:
        """The lens alone."""
        return lens_of(self.lens_model, self.distortion)

    def normalise(self, pixels: Array) -> Array:
        """Ideal normalised coordinates (n, 2) of pixels (n, 2): the inverse of `project`, by Newton's method.

        NaN where the iteration does not converge: the distortion model has no inverse at such a pixel.
        """
        (fx, skew, cx), (_, fy, cy), _ = self.matrix
        goal_y = (pixels[:, 1] - cy) / fy
        goal_x = (pixels[:, 0] - cx - skew * goal_y) / fx
        x, y = goal_x.copy(), goal_y.copy()
        # The iteration may diverge at pixels that no ray of this lens reaches; the check after it finds them.
        with np.errstate(all="ignore"):
            for _ in range(20):
                off_x, off_y = np.subtract(self.lens.distort(x, y), (goal_x, goal_y))
                if np.all(np.abs(off_x) < 1e-13) and np.all(np.abs(off_y) < 1e-13):
                    break
                xx, xy, yx, yy = self.lens.slopes(x, y)
                determinant = xx * yy - xy * yx
                x = x - (yy * off_x - xy * off_y) / determinant
                y = y - (xx * off_y - yx * off_x) / determinant
            off_x, off_y = np.subtract(self.lens.distort(x, y), (goal_x, goal_y))
            converged = np.maximum(np.abs(off_x), np.abs(off_y)) < 1e-9
        return np.where(converged[:, None], np.column_stack([x, y]), np.nan)

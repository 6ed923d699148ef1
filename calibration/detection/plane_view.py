"""A plane seen through a lens: a homography (8 parameters) and two coefficients of radial distortion.

It predicts where points of a target lie before the camera is known, and its residual shows whether points are those of
a plane. The distortion's centre is the image's; a weak prior keeps the coefficients near zero where few points
determine them.
"""

from dataclasses import dataclass

import numpy as np

from calibration.errors import DetectionError
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array

NO_DISTORTION_WEIGHT = 1e-6
"""A coefficient of 1 costs as much as a residual of 1e-3 of half the image's diagonal."""
ITERATIONS = 10


@dataclass(frozen=True, eq=False)
class PlaneView:
    """`homography` (3, 3) from the plane to ideal image coordinates, in units of half the diagonal `scale_px` from
    `centre_px` (2,); `radial` (2,) distorts them."""

    homography: Array
    radial: Array
    centre_px: Array
    scale_px: float

    def map(self, points: Array) -> Array:
        """Pixels (n, 2) of plane points (n, 2); not finite on the horizon, meaningless beyond it."""
        uvw = np.column_stack([points, np.ones(len(points))]) @ self.homography.T
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            ideal = uvw[:, :2] / uvw[:, 2:]
            r2 = (ideal**2).sum(axis=1, keepdims=True)
            distorted = ideal * (1 + r2 * (self.radial[0] + r2 * self.radial[1]))
            return np.asarray(self.centre_px + self.scale_px * distorted)

    def jacobian(self, point: Array) -> Array:
        """d pixel / d plane (2, 2) at a plane point (2,), without the distortion."""
        u, v, w = self.homography @ np.append(point, 1.0)
        slope = (self.homography[:2, :2] - np.outer([u, v], self.homography[2, :2]) / w) / w
        return np.asarray(self.scale_px * slope)


def fit_plane_view(points: Array, pixels: Array, image_size: tuple[int, int]) -> tuple[PlaneView, Array]:
    """The least-squares view of plane points (n, 2) at pixels (n, 2), and the residuals (n, 2) in px.

    Raises DetectionError `not-planar` when no homography maps one to the other.
    """
    centre, scale = (np.array(image_size) - 1) / 2, float(np.hypot(*image_size)) / 2
    middle = points.mean(axis=0)
    size = float(np.abs(points - middle).max()) or 1.0
    plane, image = (points - middle) / size, (pixels - centre) / scale
    parameters = np.append(_direct_linear(plane, image), [0.0, 0.0])
    weight = np.diag(np.append(np.full(8, 1e-14), np.full(2, NO_DISTORTION_WEIGHT)))
    for _ in range(ITERATIONS):
        residual, jacobian = _residual(parameters, plane, image)
        if not np.all(np.isfinite(jacobian)):
            raise _no_plane()
        prior = weight @ np.append(np.zeros(8), parameters[8:])
        step = np.linalg.lstsq(jacobian.T @ jacobian + weight, jacobian.T @ residual + prior, rcond=None)[0]
        parameters -= step
        if np.abs(step).max() < 1e-10:
            break
    residual, _ = _residual(parameters, plane, image)
    if not np.all(np.isfinite(residual)):
        raise _no_plane()
    to_plane = np.array([[1, 0, -middle[0]], [0, 1, -middle[1]], [0, 0, size]]) / size
    homography = np.append(parameters[:8], 1.0).reshape(3, 3) @ to_plane
    return PlaneView(homography, parameters[8:], centre, scale), residual.reshape(2, -1).T * scale


def _no_plane() -> DetectionError:
    return DetectionError("not-planar", Sentence("seen-no-plane"), Sentence("see-target"))


def _direct_linear(plane: Array, image: Array) -> Array:
    """The first eight elements of the homography with h33 = 1, by the direct linear transform."""
    zero, one = np.zeros((len(plane), 3)), np.column_stack([plane, np.ones(len(plane))])
    rows = np.vstack([np.hstack([one, zero, -image[:, :1] * one]), np.hstack([zero, one, -image[:, 1:] * one])])
    if not np.all(np.isfinite(rows)):
        raise _no_plane()
    homography = np.linalg.eigh(rows.T @ rows)[1][:, 0]
    if abs(homography[8]) < 1e-9 * np.abs(homography).max():
        raise _no_plane()
    return np.asarray(homography[:8] / homography[8])


def _residual(parameters: Array, plane: Array, image: Array) -> tuple[Array, Array]:
    """Residual (2n,) and Jacobian (2n, 10) of projecting the plane."""
    h, (k1, k2) = np.append(parameters[:8], 1.0).reshape(3, 3), parameters[8:]
    one = np.column_stack([plane, np.ones(len(plane))])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        x, y, w = (one @ h.T).T
        x, y = x / w, y / w
        r2 = x * x + y * y
        radial, slope = 1 + r2 * (k1 + r2 * k2), 2 * (k1 + 2 * r2 * k2)
        residual = np.concatenate([x * radial - image[:, 0], y * radial - image[:, 1]])
        by_h = one / w[:, None]
        jacobian = np.empty((2, len(plane), 10))
        for row, ideal, by_x, by_y in (
            (0, x, radial + x * x * slope, x * y * slope),
            (1, y, x * y * slope, radial + y * y * slope),
        ):
            jacobian[row, :, :3] = by_x[:, None] * by_h
            jacobian[row, :, 3:6] = by_y[:, None] * by_h
            jacobian[row, :, 6:8] = -(by_x * x + by_y * y)[:, None] * by_h[:, :2]
            jacobian[row, :, 8], jacobian[row, :, 9] = ideal * r2, ideal * r2 * r2
    return residual, jacobian.reshape(-1, 10)

"""Pinhole camera with Brown's radial and tangential distortion, in OpenCV's convention.

Pixel (0, 0) is the centre of the first pixel. Source: D. C. Brown, "Close-range camera calibration", 1971.
"""

from dataclasses import dataclass

import numpy as np

from calibration.transforms import Array


@dataclass(frozen=True, eq=False)
class CameraModel:
    """`matrix` (3, 3) in px; `distortion` (5,) as k1, k2, p1, p2, k3; `image_size` (width, height) in px."""

    matrix: Array
    distortion: Array
    image_size: tuple[int, int]

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
        k1, k2, p1, p2, k3 = self.distortion
        x, y = xy[:, 0], xy[:, 1]
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return np.column_stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
            ]
        )

    def distortion_jacobian(self, xy: Array) -> Array:
        """d distort / d xy (n, 2, 2) at ideal normalised coordinates (n, 2); it is symmetric."""
        k1, k2, p1, p2, k3 = self.distortion
        x, y = xy[:, 0], xy[:, 1]
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))
        jacobian = np.empty((len(xy), 2, 2))
        jacobian[:, 0, 0] = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
        jacobian[:, 1, 1] = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
        jacobian[:, 0, 1] = jacobian[:, 1, 0] = x * y * slope + 2 * p1 * x + 2 * p2 * y
        return jacobian

    def normalise(self, pixels: Array) -> Array:
        """Ideal normalised coordinates (n, 2) of pixels (n, 2): the inverse of matrix and distortion, by Newton.

        NaN where the iteration does not settle: such a pixel lies outside what the distortion model can invert.
        """
        (fx, skew, cx), (_, fy, cy), _ = self.matrix
        y = (pixels[:, 1] - cy) / fy
        distorted = np.column_stack([(pixels[:, 0] - cx - skew * y) / fx, y])
        xy = distorted.copy()
        for _ in range(20):
            residual = self.distort(xy) - distorted
            if np.all(np.abs(residual) < 1e-13):
                break
            xy -= np.linalg.solve(self.distortion_jacobian(xy) + 1e-12 * np.eye(2), residual[..., None])[..., 0]
        settled = np.abs(self.distort(xy) - distorted).max(axis=1, initial=0.0) < 1e-9
        return np.where(settled[:, None], xy, np.nan)

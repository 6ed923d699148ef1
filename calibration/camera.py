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
        return np.column_stack(self.distort_components(xy[:, 0], xy[:, 1]))

    def distort_components(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Distorted x and y of ideal normalised x and y, arrays of any one shape."""
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        xy2 = 2 * x * y
        return x * radial + p1 * xy2 + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + p2 * xy2

    def distortion_slopes(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """Jacobian of `distort_components`, symmetric: its elements xx, xy = yx and yy, arrays of any one shape."""
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))
        along_x, along_y = p2 * x, p1 * y
        return (
            radial + x * x * slope + 2 * along_y + 6 * along_x,
            x * y * slope + 2 * p1 * x + 2 * p2 * y,
            radial + y * y * slope + 6 * along_y + 2 * along_x,
        )

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
                off_x, off_y = np.subtract(self.distort_components(x, y), (goal_x, goal_y))
                if np.all(np.abs(off_x) < 1e-13) and np.all(np.abs(off_y) < 1e-13):
                    break
                xx, xy, yy = self.distortion_slopes(x, y)
                determinant = xx * yy - xy * xy
                x = x - (yy * off_x - xy * off_y) / determinant
                y = y - (xx * off_y - xy * off_x) / determinant
            off_x, off_y = np.subtract(self.distort_components(x, y), (goal_x, goal_y))
            converged = np.maximum(np.abs(off_x), np.abs(off_y)) < 1e-9
        return np.where(converged[:, None], np.column_stack([x, y]), np.nan)

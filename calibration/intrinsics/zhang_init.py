"""Initial intrinsics in closed form: Z. Zhang, "A flexible new technique for camera calibration", 2000."""

import numpy as np

from calibration.camera import CameraModel
from calibration.detection.plane_view import PlaneView, fit_plane_view
from calibration.errors import DetectionError
from calibration.observations.observations import Observations

DEFAULT_FOCAL_OF_WIDTH = 1.2
FOCAL_RANGE_OF_WIDTH = (0.3, 20.0)
MAX_RMS_OF_EXTENT = 0.02
"""Largest RMS residual of a plane's view with two radial coefficients, as a share of the view's extent."""


def plane_views(seen: Observations, image_size: tuple[int, int]) -> list[PlaneView | None]:
    """The homography of each view; None where the points do not fit a plane."""
    return [_plane_view(seen, row, image_size) for row in range(len(seen))]


def _plane_view(seen: Observations, row: int, image_size: tuple[int, int]) -> PlaneView | None:
    used = seen.weights[row] > 0
    pixels = seen.pixels[row, used]
    try:
        view, residual = fit_plane_view(seen.points_mm[row, used, :2], pixels, image_size)
    except DetectionError:
        return None
    rms_px = float(np.sqrt(np.mean(residual**2)))
    return view if rms_px < MAX_RMS_OF_EXTENT * float(np.ptp(pixels, axis=0).max()) else None


def initial_camera(views: list[PlaneView], image_size: tuple[int, int]) -> CameraModel:
    """A camera with one focal length about the image's centre, no distortion: Eqs. (3) and (4), linear in 1 / f²."""
    products = []
    for view in views:
        h1, h2 = (view.homography[:, :2] / np.linalg.norm(view.homography[:, :2])).T
        products.append((h1[:2] @ h2[:2], h1[2] * h2[2]))
        products.append((h1[:2] @ h1[:2] - h2[:2] @ h2[:2], h1[2] ** 2 - h2[2] ** 2))
    in_image, along_axis = np.array(products).T
    inverse_f2 = -(in_image @ along_axis) / max(float(in_image @ in_image), 1e-300)
    width, scale = image_size[0], float(np.hypot(*image_size)) / 2
    focal = scale / np.sqrt(inverse_f2) if inverse_f2 > 1e-12 else DEFAULT_FOCAL_OF_WIDTH * width
    centre = (np.array(image_size) - 1) / 2
    shortest, longest = FOCAL_RANGE_OF_WIDTH
    focal = min(max(float(focal), shortest * width), longest * width)
    return CameraModel(np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1.0]]), np.zeros(5), image_size)

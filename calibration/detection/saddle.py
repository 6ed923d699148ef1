"""Sub-pixel chessboard corners: the saddle of a weighted quadratic fitted to the grey values around each.

Around a corner the image is symmetric under a half turn, so the stationary point of any smooth symmetric fit
is the corner, whatever the blur. Source: Lucchese and Mitra, "Using saddle points for subpixel feature
detection in camera calibration targets", 2002.
"""

import numpy as np
from numpy.typing import NDArray

from calibration.detection.image import Grey
from calibration.transforms import Array

ITERATIONS = 6
STEP_TOLERANCE_PX = 2e-3


def refine_saddles(image: Grey, corners_px: Array, half_window_px: int) -> tuple[Array, NDArray[np.bool_]]:
    """Saddles (n, 2) px near `corners_px` (n, 2), and which of them (n,) are saddles inside their window."""
    corners = corners_px.astype(float).copy()
    settled = np.zeros(len(corners), bool)
    inside = np.ones(len(corners), bool)
    for _ in range(ITERATIONS):
        active = np.flatnonzero(inside & ~settled)
        if active.size == 0:
            break
        step, is_saddle = _saddle_step(image, corners[active], half_window_px)
        corners[active] += step
        settled[active] = is_saddle & (np.abs(step).max(axis=1) < STEP_TOLERANCE_PX)
        inside[active] = is_saddle & (np.abs(corners[active] - corners_px[active]).max(axis=1) <= half_window_px)
    return corners, inside


def _saddle_step(image: Grey, corners: Array, half: int) -> tuple[Array, NDArray[np.bool_]]:
    """Step (n, 2) px to the stationary point of the quadratic fitted around each corner; mask (n,) of the saddles."""
    patches, weights = sample(image, corners, half)
    u, v = np.meshgrid(np.arange(-half, half + 1.0), np.arange(-half, half + 1.0))
    u, v, w = u.ravel() / half, v.ravel() / half, weights
    basis = np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])
    solver = np.linalg.solve(basis.T @ (w[:, None] * basis), (w[:, None] * basis).T)
    _, gx, gy, xx, xy, yy = solver @ patches.T
    determinant = 4 * xx * yy - xy * xy
    is_saddle = determinant < -1e-6
    safe = np.where(is_saddle, determinant, 1.0)
    step = half * np.column_stack([xy * gy - 2 * yy * gx, xy * gx - 2 * xx * gy]) / safe[:, None]
    return np.clip(np.where(is_saddle[:, None], step, 0.0), -0.5 * half, 0.5 * half), is_saddle


def sample(image: Grey, centres: Array, half: int) -> tuple[Array, Array]:
    """Bilinear patches (n, (2 half + 1)²) centred on `centres`, and the window's weights ((2 half + 1)²,)."""
    height, width = image.shape
    base = np.floor(centres).astype(np.intp)
    fu, fv = (centres - base).T[:, :, None, None]
    reach = np.arange(-half, half + 2)
    rows = np.clip(base[:, 1, None] + reach, 0, height - 1)
    columns = np.clip(base[:, 0, None] + reach, 0, width - 1)
    block = image[rows[:, :, None], columns[:, None, :]].astype(float)
    block = block[:, :, :-1] * (1 - fu) + block[:, :, 1:] * fu
    block = block[:, :-1] * (1 - fv) + block[:, 1:] * fv
    radius2 = (np.arange(-half, half + 1.0) / (half + 0.5)) ** 2
    weights = np.maximum(0.0, 1 - radius2[:, None] - radius2[None, :]).ravel()
    return block.reshape(len(centres), -1), weights

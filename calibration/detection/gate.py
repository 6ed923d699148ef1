"""Whether what was found is the target: the residual of its homography, with room for lens distortion."""

import numpy as np

from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.targets import Target
from calibration.transforms import Array

FEWEST_POINTS = 6
LARGEST_RMS_PX, LARGEST_RMS_OF_PITCH = 0.3, 0.012
"""The gate's width: what blur and noise may do, and what a bent board or an unmodelled lens may."""
LEAST_FORESHORTENING = 0.08
"""Beyond about 85° from frontal the points along the short axis fall together."""
SMALLEST_PITCH_PX = 4.0
OUTLIER_OF_RMS, LARGEST_OUTLIER_SHARE = 4.0, 0.15


def gate(detection: Detection, target: Target, image_size: tuple[int, int]) -> Detection:
    """The detection without its few stray points.

    Raises DetectionError `too-few-points`, `points-in-a-line`, `edge-on`, `too-far-away`, `not-planar`.
    """
    points, pixels = target.points_mm[detection.ids, :2], detection.corners_px
    keep = np.ones(len(points), bool)
    while True:
        _require_enough(points[keep])
        homography, residual_px = lens_homography(points[keep], pixels[keep], image_size)
        pitch_px, foreshortening = _local_scale(homography, points[keep])
        rms_px = float(np.sqrt(np.mean(residual_px**2) * 2))
        limit_px = LARGEST_RMS_PX + LARGEST_RMS_OF_PITCH * pitch_px
        worst = np.hypot(*residual_px.T)
        strays = worst > OUTLIER_OF_RMS * limit_px
        if rms_px > limit_px and not strays.any():
            strays = worst == worst.max()
        if not strays.any():
            break
        keep[np.flatnonzero(keep)[strays]] = False
        if (~keep).sum() > LARGEST_OUTLIER_SHARE * len(points):
            what = f"the points found miss a plane's by {rms_px:.2f} px RMS, the limit is {limit_px:.2f} px"
            raise DetectionError("not-planar", what, "check the target's columns, rows and kind, and that it is flat")
    if foreshortening < LEAST_FORESHORTENING:
        what = f"the target is seen edge-on ({np.degrees(np.arccos(foreshortening)):.0f}° from frontal)"
        raise DetectionError("edge-on", what, "turn the target towards the camera")
    if pitch_px < SMALLEST_PITCH_PX:
        what = f"the target's points lie {pitch_px:.1f} px apart, the least is {SMALLEST_PITCH_PX:g} px"
        raise DetectionError("too-far-away", what, "bring the camera nearer or use a target with larger squares")
    return Detection(detection.ids[keep], pixels[keep])


def _require_enough(points: Array) -> None:
    if len(points) < FEWEST_POINTS:
        what = f"only {len(points)} points of the target were found, the least is {FEWEST_POINTS}"
        raise DetectionError("too-few-points", what, "bring more of the target into view")
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spread[1] < 1e-6 * spread[0]:
        raise DetectionError(
            "points-in-a-line", "the points found lie in one line", "bring more of the target into view"
        )


def _local_scale(homography: Array, points: Array) -> tuple[float, float]:
    """Distance between neighbouring points in px, and how much shorter the short axis is than the long one."""
    centre = np.append(points.mean(axis=0), 1.0)
    u, v, w = homography @ centre
    jacobian = (homography[:2, :2] - np.outer([u, v], homography[2, :2]) / w) / w
    long, short = np.linalg.svd(jacobian, compute_uv=False)
    steps = np.unique(np.round(np.abs(points[:, None] - points[None, :64]).reshape(-1, 2), 6).max(axis=1))
    pitch_mm = float(steps[steps > 0][0])
    return float(np.sqrt(long * short)) * pitch_mm, float(short / long)


def lens_homography(points: Array, pixels: Array, image_size: tuple[int, int]) -> tuple[Array, Array]:
    """Homography (3, 3) of plane points (n, 2) to pixels (n, 2) seen through a radial lens, and residuals (n, 2) in px.

    The lens has two radial coefficients about the image's centre, held near zero where few points see them.
    """
    centre, scale = (np.array(image_size) - 1) / 2, float(np.hypot(*image_size)) / 2
    middle, size = points.mean(axis=0), float(np.abs(points - points.mean(axis=0)).max())
    plane, image = (points - middle) / size, (pixels - centre) / scale
    parameters = np.append(_direct_linear(plane, image).ravel(), [0.0, 0.0])
    for _ in range(8):
        residual, jacobian = _lens_residual(parameters, plane, image)
        damping = np.diag(np.append(np.full(8, 1e-12), [PRIOR / 4, PRIOR]))
        normal = jacobian.T @ jacobian + damping
        right = jacobian.T @ residual + damping @ np.delete(parameters, 8) * np.append(np.zeros(8), [1, 1])
        step = np.linalg.solve(normal, right)
        parameters -= np.insert(step, 8, 0.0)
    residual, _ = _lens_residual(parameters, plane, image)
    to_plane = np.array([[1, 0, -middle[0]], [0, 1, -middle[1]], [0, 0, size]]) / size
    to_pixels = np.array([[scale, 0, centre[0]], [0, scale, centre[1]], [0, 0, 1]])
    return to_pixels @ parameters[:9].reshape(3, 3) @ to_plane, residual.reshape(2, -1).T * scale


PRIOR = 1e-6
"""Weight of 'no distortion': a coefficient of 1 costs as much as a residual of 1e-3 of half the image's diagonal."""


def _direct_linear(plane: Array, image: Array) -> Array:
    """The homography by the direct linear transform, scaled to h33 = 1."""
    zero, one = np.zeros((len(plane), 3)), np.column_stack([plane, np.ones(len(plane))])
    rows = np.vstack([np.hstack([one, zero, -image[:, :1] * one]), np.hstack([zero, one, -image[:, 1:] * one])])
    _, _, vt = np.linalg.svd(rows, full_matrices=False)
    homography: Array = vt[-1].reshape(3, 3)
    if abs(homography[2, 2]) < 1e-9 * np.abs(homography).max():
        raise DetectionError("not-planar", "the points found fit no plane in front of the camera", "check the target")
    return np.asarray(homography / homography[2, 2])


def _lens_residual(parameters: Array, plane: Array, image: Array) -> tuple[Array, Array]:
    """Residual (2n,) and Jacobian (2n, 10) of projecting the plane by 8 + 2 parameters."""
    h, k1, k2 = parameters[:9].reshape(3, 3), parameters[9], parameters[10]
    one = np.column_stack([plane, np.ones(len(plane))])
    x, y, w = (one @ h.T).T
    x, y = x / w, y / w
    r2 = x * x + y * y
    radial, slope = 1 + r2 * (k1 + r2 * k2), 2 * (k1 + 2 * r2 * k2)
    residual = np.concatenate([x * radial - image[:, 0], y * radial - image[:, 1]])
    zero = np.zeros_like(one)
    dx = np.hstack([one, zero, -x[:, None] * one])[:, :8] / w[:, None]
    dy = np.hstack([zero, one, -y[:, None] * one])[:, :8] / w[:, None]
    ju = (radial + x * x * slope)[:, None] * dx + (x * y * slope)[:, None] * dy
    jv = (x * y * slope)[:, None] * dx + (radial + y * y * slope)[:, None] * dy
    lens = np.concatenate([x, y])[:, None] * np.tile(np.column_stack([r2, r2 * r2]), (2, 1))
    return residual, np.hstack([np.vstack([ju, jv]), lens])

"""Cramér-Rao bound of a corner's location from the image gradient and the sensor noise."""

from dataclasses import replace

import cv2
import numpy as np

from calibration.targets import Target
from calibration.transforms import Array
from mock_robot.scene.camera_view import render
from mock_robot.scene.optics import Optics
from tests.simulated.views import TruePicture


def bound_px(picture: TruePicture, target: Target, optics: Optics, window_px: int) -> float:
    """Smallest standard deviation per axis, RMS over the points, from the pixels within `window_px` of each.

    The inverse of the Fisher information sum(g g' / variance), with everything but the point's location known.
    """
    still = replace(optics, read_noise=0.0, electrons_per_level=0.0)
    ideal = render(picture.camera, target, picture.camera_T_target, still, np.random.default_rng(0)).astype(np.float32)
    gradient = np.stack([cv2.Scharr(ideal, cv2.CV_32F, 1, 0), cv2.Scharr(ideal, cv2.CV_32F, 0, 1)], axis=-1) / 32.0
    variance = optics.read_noise**2 + ideal / max(optics.electrons_per_level, 1e-9) + 1 / 12
    return float(np.sqrt(np.mean([_trace(gradient, variance, point, window_px) for point in picture.pixels])))


def _trace(gradient: Array, variance: Array, point: Array, window_px: int) -> float:
    """Half the trace of the inverse information."""
    u, v = np.rint(point).astype(int)
    block = slice(max(v - window_px, 0), v + window_px + 1), slice(max(u - window_px, 0), u + window_px + 1)
    g, weight = gradient[block].reshape(-1, 2).astype(float), 1 / variance[block].ravel()
    return float(np.trace(np.linalg.inv((g * weight[:, None]).T @ g)) / 2)

"""First intrinsics of a session that came without: the maximum-likelihood loop refines them with everything else."""

import cv2
import numpy as np

from calibration.camera import CameraModel
from calibration.observations import Observations


def starting_camera(seen: Observations, image_size: tuple[int, int]) -> CameraModel:
    """Zhang's method over all views, no robot involved."""
    objects = [seen.points_mm[i, seen.weights[i] > 0].astype(np.float32) for i in range(len(seen))]
    images = [seen.pixels[i, seen.weights[i] > 0].astype(np.float32) for i in range(len(seen))]
    _, matrix, distortion, _, _ = cv2.calibrateCamera(objects, images, image_size, None, None)
    return CameraModel(np.asarray(matrix), np.asarray(distortion).ravel()[:5], image_size)

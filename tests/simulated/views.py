"""Ordinary pictures of a target with known pixels: what the detection's tests and benchmark look at."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.targets import Target
from calibration.transforms import Array, map_points, rotation_from_vector, transform
from mock_robot.scene.camera_view import render
from mock_robot.scene.optics import Optics
from mock_robot.scene.printed_target import PrintOptions, print_target

ORDINARY = Optics()
BLURRED = Optics(blur_px=2.0, read_noise=3.0)


@dataclass(frozen=True, eq=False)
class TruePicture:
    """An image and where the target's points truly are in it: `pixels` (n, 2)."""

    image: NDArray[np.uint8]
    camera: CameraModel
    camera_T_target: Array
    pixels: Array


def industrial_camera(width: int, height: int) -> CameraModel:
    """A lens of about 50° with some barrel distortion, its centre a little off."""
    focal = 1.05 * width
    matrix = np.array([[focal, 0.0, 0.507 * width], [0.0, 1.001 * focal, 0.495 * height], [0.0, 0.0, 1.0]])
    return CameraModel(matrix, np.array([-0.11, 0.09, 4e-4, -3e-4, 0.0]), (width, height))


def take_picture(
    camera: CameraModel,
    target: Target,
    rng: np.random.Generator,
    optics: Optics = ORDINARY,
    largest_tilt_deg: float = 40.0,
    fill: float = 0.75,
    sheet: PrintOptions | None = None,
) -> TruePicture:
    """The target anywhere in view, rolled at will, tilted up to the limit, its sheet `fill` of the image or less."""
    camera_T_target = _pose(camera, target, rng, largest_tilt_deg, fill, sheet)
    image = render(camera, target, camera_T_target, optics, rng, sheet)
    return TruePicture(image, camera, camera_T_target, camera.project(map_points(camera_T_target, target.points_mm)))


def _pose(
    camera: CameraModel,
    target: Target,
    rng: np.random.Generator,
    largest_tilt_deg: float,
    fill: float,
    sheet: PrintOptions | None,
) -> Array:
    outline = np.column_stack([print_target(target, sheet).outline_mm, np.zeros(4)])
    middle, size = outline.mean(axis=0), float(np.hypot(*np.ptp(outline[:, :2], axis=0)))
    width, height = camera.image_size
    distance = camera.matrix[0, 0] * size / (fill * width)
    for _ in range(1000):
        azimuth, tilt = rng.uniform(-np.pi, np.pi), np.radians(largest_tilt_deg) * np.sqrt(rng.uniform())
        turn = rotation_from_vector(tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))
        turn = turn @ rotation_from_vector(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
        depth = distance * rng.uniform(1.0, 1.4)
        aside = rng.uniform(-0.2, 0.2, 2) * np.array(camera.image_size) / camera.matrix[0, 0] * depth
        camera_T_target = transform(turn, np.array([*aside, depth]) - turn @ middle)
        seen = camera.project(map_points(camera_T_target, outline))
        if np.all((seen > 10) & (seen < np.array([width, height]) - 11)):
            return camera_T_target
    raise ValueError("the target does not fit into the image: lower `fill`")

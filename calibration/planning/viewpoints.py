"""Viewpoints of a target as six parameters, their limits, and the robot poses that reach them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.likelihood.predicted_uncertainty import Scene
from calibration.problem import base_T_flange_of
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform


@dataclass(frozen=True)
class ViewpointLimits:
    """Bounds of the search.

    tilt_rad : largest angle between the board's normal and the ray to the camera.
    roll_rad : largest turn of the camera about that ray, from the board standing upright in the image.
    distance_mm : camera to the middle of the board, nearest and furthest.
    box_mm : (2, 3) lower and upper corner for the flange in the base, or None.
    image_margin : share of the image's width kept free around the target, for a guess that is a little off.
    speed_mm_s : of the arm, by whose time views are chosen; None: its way costs nothing.
    """

    tilt_rad: float
    roll_rad: float
    distance_mm: tuple[float, float]
    box_mm: Array | None = None
    image_margin: float = 0.04
    speed_mm_s: float | None = 250.0


AIM_LIMIT = 0.4
"""Largest `aim_x` and `aim_y`, in halves of the image from its middle."""


def random_viewpoints(limits: ViewpointLimits, count: int, rng: np.random.Generator) -> Array:
    """Viewpoints (count, 6), distributed uniformly within `limits`.

    A viewpoint is [tilt_x_rad, tilt_y_rad, roll_rad, distance_mm, aim_x, aim_y]; aim is the place of the target's
    middle in the image.
    """
    tilt = limits.tilt_rad * np.sqrt(rng.random(count))
    azimuth = rng.uniform(-np.pi, np.pi, count)
    return np.column_stack(
        [
            tilt * np.cos(azimuth),
            tilt * np.sin(azimuth),
            rng.uniform(-limits.roll_rad, limits.roll_rad, count),
            rng.uniform(*limits.distance_mm, count),
            rng.uniform(-AIM_LIMIT, AIM_LIMIT, (count, 2)),
        ]
    )


def clip_to_limits(limits: ViewpointLimits, viewpoints: Array) -> Array:
    """The viewpoints (n, 6) within the limits that are nearest to those given."""
    result = viewpoints.copy()
    tilt = np.linalg.norm(result[:, :2], axis=1, keepdims=True)
    result[:, :2] *= np.minimum(1.0, limits.tilt_rad / np.maximum(tilt, 1e-12))
    result[:, 2] = np.clip(result[:, 2], -limits.roll_rad, limits.roll_rad)
    result[:, 3] = np.clip(result[:, 3], *limits.distance_mm)
    result[:, 4:] = np.clip(result[:, 4:], -AIM_LIMIT, AIM_LIMIT)
    return result


def flange_poses(scene: Scene, viewpoints: Array) -> Array:
    """base_T_flange (n, 4, 4) for viewpoints (n, 6) in the scene."""
    target_T_camera = inverse(camera_T_target(scene, viewpoints))
    anchor_T_mount = scene.anchor_T_target @ target_T_camera @ inverse(scene.mount_T_camera)
    return base_T_flange_of(scene.setup, anchor_T_mount)


def camera_T_target(scene: Scene, viewpoints: Array) -> Array:
    """camera_T_target (n, 4, 4) of viewpoints (n, 6)."""
    tilts = np.column_stack([viewpoints[:, :2], np.zeros(len(viewpoints))])
    rolls = np.column_stack([np.zeros((len(viewpoints), 2)), viewpoints[:, 2]])
    rotation = rotation_from_vector(rolls) @ rotation_from_vector(tilts)
    width, height = scene.camera.image_size
    aim_px = (viewpoints[:, 4:] + 1) / 2 * [width - 1, height - 1]
    ray = np.column_stack([scene.camera.normalise(aim_px), np.ones(len(viewpoints))])
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    # Tilt is meant towards the ray, not the optical axis: turn the board with the ray.
    sine = np.linalg.norm(ray[:, :2], axis=1, keepdims=True)
    turn = np.arctan2(sine, ray[:, 2:]) / np.maximum(sine, 1e-12)
    towards_ray = rotation_from_vector(turn * np.cross([0.0, 0.0, 1.0], ray))
    centre_target = scene.target.points_mm.mean(axis=0)
    turned = towards_ray @ rotation
    return transform(turned, viewpoints[:, 3:4] * ray - turned @ centre_target)


def target_in_view(scene: Scene, base_T_flange: Array, margin: float = 0.0) -> Array:
    """Share (n,) of the target's points that lie in the image, at least `margin` of its width from the border."""
    points = map_points(scene.camera_T_target(base_T_flange), scene.target.points_mm)
    n, m = points.shape[:2]
    pixels = scene.camera.project(points.reshape(-1, 3)).reshape(n, m, 2)
    border = margin * scene.camera.image_size[0]
    upper = np.array(scene.camera.image_size) - 1 - border
    with np.errstate(invalid="ignore"):
        inside = np.all((pixels >= border) & (pixels <= upper), axis=-1)
    share: Array = inside.mean(axis=1)
    return share


def within_limits(scene: Scene, limits: ViewpointLimits, base_T_flange: Array) -> NDArray[np.bool_]:
    """Mask (n,): the whole target is in the image with the margin, and the flange in the box."""
    result: NDArray[np.bool_] = target_in_view(scene, base_T_flange, limits.image_margin) == 1.0
    if limits.box_mm is not None:
        origin = base_T_flange[:, :3, 3]
        result &= np.all((origin >= limits.box_mm[0]) & (origin <= limits.box_mm[1]), axis=1)
    return result


MIN_DISTANCE_OF_LIMIT = 0.7
"""In an alternative scene the camera keeps at least this share of the nearest distance allowed."""


def in_sight(scenes: Sequence[Scene], limits: ViewpointLimits, base_T_flange: Array) -> NDArray[np.bool_]:
    """Mask (n,): in all alternative scenes the target's box is in the image, not much nearer than the limits allow.

    The scenes have one set-up and one target.
    """
    result = np.ones(len(base_T_flange), bool)
    for camera in {scene.camera: None for scene in scenes}:  # all scenes of one in one step
        alike = [scene for scene in scenes if scene.camera is camera]
        points = alike[0].target.points_mm
        box = np.stack(np.meshgrid(*np.array([points.min(axis=0), points.max(axis=0)]).T), -1).reshape(-1, 3)
        mounts = np.array([[scene.mount_T_camera] for scene in alike])
        anchors = np.array([[scene.anchor_T_target] for scene in alike])
        poses = replace(alike[0], mount_T_camera=mounts, anchor_T_target=anchors).camera_T_target(base_T_flange)
        seen = map_points(poses, np.concatenate([box, points.mean(axis=0)[None]]))
        pixels = camera.project(seen[..., :-1, :].reshape(-1, 3)).reshape(*seen.shape[:2], len(box), 2)
        with np.errstate(invalid="ignore"):
            shown = np.all((pixels >= 0) & (pixels <= np.array(camera.image_size) - 1), axis=(2, 3))
        far = np.linalg.norm(seen[..., -1, :], axis=-1) >= MIN_DISTANCE_OF_LIMIT * limits.distance_mm[0]
        result &= np.all(shown & far, axis=0)
    return result

"""Two or more verifications of a cell with an arm as built, in which something changed before the last one."""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from calibration.kinematics.arm import Arm, UnreachablePoseError
from calibration.kinematics.arm_errors import Postures
from calibration.kinematics.stance import Stance
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, Scene
from calibration.monitoring.cell_change import DriftChangeDocument, SeenTarget, find_change
from calibration.observations.observations import observe
from calibration.observations.view_poses import candidate_poses
from calibration.problem import Detection, Problem, Setup, View, anchor_T_mount_of
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform, transform_from_vector
from mock_robot.arm.built_arm import build_arm
from tests.simulated.arms import MOUNT_T_CAMERA, REPEATABILITY, reachable_views, target_places
from tests.simulated.sessions import BOARD, CAMERA, looking

STATIONS = 5

X_ERROR = np.array([4e-4, -3e-4, 5e-4, 0.3, -0.2, 0.4])
"""rad, mm: of the calibration that is verified."""

ON_FLANGE = transform(rotation_from_vector([np.pi, 0.0, 0.0]), np.array([-80.0, 60.0, 40.0]))
"""A target held by the flange, its face away from it."""


@dataclass(frozen=True)
class Change:
    """Lengths of random motions of camera or target (turned by as many milliradians), or one axis's zero."""

    camera_mm: float = 0.0
    target_mm: float = 0.0
    axis: int = 1
    zero_rad: float = 0.0

    def __str__(self) -> str:
        if self.zero_rad:
            return f"axis-{self.axis}"
        return "camera" if self.camera_mm else "target" if self.target_mm else "nothing"


def changes_of(
    arm: Arm, change: Change, seed: int, before: int = 1, *, eye_to_hand: bool = False, same_stations: bool = True
) -> list[DriftChangeDocument]:
    """What is said of the last verification of a standard arm, after `before` others."""
    rng = np.random.default_rng([seed, 7])
    built, place = build_arm(arm, "standard", seed), target_places(rng, arm, 1)[0]
    if eye_to_hand:
        x, anchor = place @ inverse(looking(rng, BOARD, 0.2)), ON_FLANGE
        joints, other = (_held_before_camera(rng, arm, x) for _ in range(2))
    else:
        x, anchor = MOUNT_T_CAMERA, place
        joints, other = (reachable_views(rng, arm, place, STATIONS) for _ in range(2))
    moved_x, moved_anchor = (transform_from_vector(_motion(rng, mm)) for mm in (change.camera_mm, change.target_mm))
    turned = change.zero_rad * np.eye(6)[change.axis - 1]
    setup: Setup = "eye-to-hand" if eye_to_hand else "eye-in-hand"

    def truth(at: Array, changed: bool) -> Array:
        """camera_T_target (n, 4, 4)."""
        scatter = transform_from_vector(
            np.repeat([REPEATABILITY.robot_rotation_rad, REPEATABILITY.robot_translation_mm], 3)
            * rng.standard_normal((len(at), 6))
        )
        flange = built.base_T_flange(Postures(at + turned * changed)) @ scatter
        mount_T_camera, anchor_T_target = (moved_x @ x, moved_anchor @ anchor) if changed else (x, anchor)
        return inverse(mount_T_camera) @ inverse(anchor_T_mount_of(setup, flange)) @ anchor_T_target

    calibrated = x @ transform_from_vector(X_ERROR)
    noise = ExpectedNoise(REPEATABILITY.image_px, REPEATABILITY.robot_rotation_rad, REPEATABILITY.robot_translation_mm)
    scene = Scene(setup, BOARD, CAMERA, calibrated, anchor, noise)

    def seen(at: Array, changed: bool) -> SeenTarget:
        pixels = CAMERA.project(map_points(truth(at, changed), BOARD.points_mm).reshape(-1, 3)).reshape(len(at), -1, 2)
        pixels = pixels + REPEATABILITY.image_px * rng.standard_normal(pixels.shape)
        ids, poses = np.arange(pixels.shape[1]), arm.forward(at)
        views = tuple(View(row, Stance(poses[row]), Detection(ids, pixels[row])) for row in range(len(at)))
        observed, _ = observe(Problem(setup, BOARD, CAMERA, CAMERA.image_size, views))
        camera_T_target = candidate_poses(observed, CAMERA)[0][:, 0]
        return SeenTarget(at, poses, anchor_T_mount_of(setup, poses) @ calibrated @ camera_T_target)

    return find_change(
        [seen(joints, False) for _ in range(before)], seen(joints if same_stations else other, True), arm, scene
    )


def _held_before_camera(rng: np.random.Generator, arm: Arm, base_T_camera: Array) -> Array:
    """Joints (STATIONS, 6) with the target on the flange where the camera sees it."""
    found: list[Array] = []
    while len(found) < STATIONS:
        with suppress(UnreachablePoseError):
            pose = base_T_camera @ looking(rng, BOARD, float(np.radians(40))) @ inverse(ON_FLANGE)
            solutions = arm.inverse(pose)
            found.append(solutions[rng.integers(len(solutions))])
    return np.array(found)


def _motion(rng: np.random.Generator, length_mm: float) -> Array:
    direction = rng.standard_normal((2, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    motion: Array = length_mm * (direction * np.array([[1e-3], [1.0]])).ravel()
    return motion

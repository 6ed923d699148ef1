"""Distribution of simulated cells, errors of X, and their bound, shared by the hand-eye benchmarks.

The distribution: 0.02 to 0.5 px (log-uniform), 0 to 0.5 mm and 0 to 0.05 deg of the robot (uniform; zero in 15 % of the
cells), intrinsics given in 70 % of the cells, and in all with fewer than six views. The target is certified, the lens
calibrated in the session, the arm has Absolute Accuracy: all are off by as much as that says, and unknown in the bound.
"""

import numpy as np

from calibration.knowledge import Knowledge, TargetKnowledge
from calibration.likelihood.predicted_uncertainty import (
    ExpectedNoise,
    Scene,
    point_weights,
    predict,
    working_points_mm,
)
from calibration.problem import Setup
from calibration.solution import Uncertainty
from calibration.transforms import Array, inverse, vector_from_rotation
from tests.simulated.pose_pairs import PoseSession
from tests.simulated.sessions import Cell, CellNoise, random_cell

DISTANCE_MM = 550.0
"""Distance of a registered point: the middle of the distances from which the targets are seen."""

STATED = Knowledge(TargetKnowledge("certified", 0.0), "this-session", "absolute-accuracy")

SHARE_EXACT_ROBOT, SHARE_GIVEN = 0.15, 0.7
MIN_VIEWS_FREE = 6
"""Fewer views do not determine nine intrinsics."""


def draw_cell(rng: np.random.Generator, views: int, setup: Setup) -> tuple[Cell, CellNoise]:
    """A random cell of the distribution, and its noise."""
    rotation_deg, translation_mm = rng.uniform(0, 0.05), rng.uniform(0, 0.5)
    if rng.random() < SHARE_EXACT_ROBOT:
        rotation_deg = translation_mm = 0.0
    image_px = float(np.exp(rng.uniform(np.log(0.02), np.log(0.5))))
    noise = CellNoise(image_px, float(np.radians(rotation_deg)), translation_mm)
    given = views < MIN_VIEWS_FREE or bool(rng.random() < SHARE_GIVEN)
    return random_cell(rng, views, noise, setup=setup, camera_given=given, knowledge=STATED), noise


def error_of(cell: Cell | PoseSession, mount_T_camera: Array) -> Array:
    """[rotation rad, translation mm] in the camera frame."""
    off = inverse(cell.mount_T_camera) @ mount_T_camera
    return np.concatenate([vector_from_rotation(off[:3, :3]), off[:3, 3]])


def point_error_mm(cell: Cell, mount_T_camera: Array) -> float:
    """RMS error, over the working volume, of a point registered with this X."""
    error = error_of(cell, mount_T_camera)
    return float(np.sqrt(error @ point_weights(working_points_mm(cell.camera, DISTANCE_MM)) @ error))


def scene_of(cell: Cell, noise: CellNoise) -> Scene:
    """The cell with its true noise, for the prediction."""
    expected = ExpectedNoise(noise.image_px, noise.robot_rotation_rad, noise.robot_translation_mm)
    problem = cell.problem
    free = problem.camera is None
    return Scene(
        problem.setup, problem.target, cell.camera, cell.mount_T_camera, cell.anchor_T_target, expected, free,
        knowledge=problem.knowledge,
    )  # fmt: skip


def bound_of(cell: Cell, noise: CellNoise) -> Uncertainty:
    """The Cramér-Rao bound."""
    return predict(scene_of(cell, noise), np.array([view.base_T_flange for view in cell.problem.views]))


def point_bound_mm(cell: Cell, noise: CellNoise) -> float:
    """The bound of `point_error_mm`."""
    weights = point_weights(working_points_mm(cell.camera, DISTANCE_MM))
    return float(np.sqrt(np.einsum("ij,ji->", weights, bound_of(cell, noise).covariance)))

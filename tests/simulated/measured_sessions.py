"""Sessions with known truth in which the target is measured in space: as a pose, or by its points."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from calibration.kinematics.stance import Stance
from calibration.problem import MeasuredPoints, MeasuredPose, Measurement, Problem, Setup, View, base_T_flange_of
from calibration.targets import TrackedFrame
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform, vector_from_transform
from tests.simulated.sessions import BOARD, looking

Measure = Callable[[np.random.Generator, Array], Measurement]
"""A measurement of the target at its true pose in the camera (4, 4)."""

MAX_REACH_MM = 1500.0


@dataclass(frozen=True, eq=False)
class MeasuredCell:
    """A session and the true X behind it."""

    problem: Problem
    mount_T_camera: Array

    def error(self, mount_T_camera: Array) -> Array:
        """(6,) [rotation rad, translation mm] of an X, as in its covariance."""
        return vector_from_transform(inverse(self.mount_T_camera) @ mount_T_camera)


def tracker(deg: float = 0.02, mm: float = 0.1, *, known: bool = False) -> Measure:
    """A pose with normal errors per axis; `known`: with their covariance."""
    covariance = np.diag(np.repeat([np.radians(deg), mm], 3) ** 2) if known else None

    def measure(rng: np.random.Generator, camera_T_target: Array) -> Measurement:
        turn = rotation_from_vector(np.radians(deg) * rng.standard_normal(3))
        place = camera_T_target[:3, 3] + mm * rng.standard_normal(3)
        return MeasuredPose(transform(turn @ camera_T_target[:3, :3], place), covariance)

    return measure


def points(across_mm: float = 0.05, along_mm: float = 0.2) -> Measure:
    """The board's points with errors across and along the lines of sight."""

    def measure(rng: np.random.Generator, camera_T_target: Array) -> Measurement:
        seen = map_points(camera_T_target, BOARD.points_mm)
        sight = seen / np.linalg.norm(seen, axis=1, keepdims=True)
        noise = rng.standard_normal(seen.shape)
        along = np.sum(noise * sight, axis=1, keepdims=True) * sight
        return MeasuredPoints(np.arange(len(seen)), seen + across_mm * (noise - along) + along_mm * along)

    return measure


def measured_cell(
    rng: np.random.Generator,
    views: int,
    measure: Measure,
    *,
    setup: Setup = "eye-in-hand",
    robot_deg: float = 0.02,
    robot_mm: float = 0.1,
) -> MeasuredCell:
    """`views` measurements from 450 to 650 mm; what is on the flange is near it, the base is further away."""
    on_flange = transform(rotation_from_vector(rng.standard_normal(3)), 60 * rng.standard_normal(3))
    bearing = rng.standard_normal(3)
    in_cell = transform(
        rotation_from_vector(rng.standard_normal(3)), MAX_REACH_MM * 0.6 * bearing / np.linalg.norm(bearing)
    )
    X, Y = (on_flange, in_cell) if setup == "eye-in-hand" else (in_cell, on_flange)
    seen = np.array([looking(rng) for _ in range(views)])
    stands = base_T_flange_of(setup, Y @ inverse(X @ seen))
    error = transform(
        rotation_from_vector(np.radians(robot_deg) * rng.standard_normal((views, 3))),
        robot_mm * rng.standard_normal((views, 3)),
    )
    measured = [measure(rng, pose) for pose in seen]
    rows = enumerate(zip(stands @ error, measured, strict=True))
    target = BOARD if isinstance(measured[0], MeasuredPoints) else TrackedFrame()
    problem = Problem(
        setup, target, None, (0, 0), tuple(View(i, Stance(b), None, measured=m) for i, (b, m) in rows), True
    )
    return MeasuredCell(problem, X)


def with_robot_poses(problem: Problem, change: Callable[[Array], Array]) -> Problem:
    """The same measurements at changed robot poses (n, 4, 4)."""
    changed = change(np.array([view.base_T_flange for view in problem.views]))
    rows = zip(problem.views, changed, strict=True)
    return replace(problem, views=tuple(view.standing(base_T_flange=pose) for view, pose in rows))


def with_camera_poses(problem: Problem, change: Callable[[Array], Array]) -> Problem:
    """The same robot poses with changed poses (n, 4, 4) from the camera."""
    seen = [view.measured for view in problem.views]
    changed = change(np.array([one.camera_T_target for one in seen if isinstance(one, MeasuredPose)]))
    rows = zip(problem.views, changed, strict=True)
    return replace(problem, views=tuple(replace(view, measured=MeasuredPose(pose)) for view, pose in rows))

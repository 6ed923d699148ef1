"""A camera and a scanner on one mount with known truth: at every station both see the target, the robot errs once."""

from dataclasses import dataclass

import numpy as np

from calibration.kinematics.stance import Stance
from calibration.problem import Problem, Setup, View, anchor_T_mount_of
from calibration.transforms import Array, inverse, rotation_from_vector, transform, vector_from_transform
from tests.simulated.measured_sessions import Measure, points
from tests.simulated.sessions import CellNoise, random_cell

CAMERA_T_SCANNER = transform(rotation_from_vector([0.05, -0.2, 0.1]), [120.0, 10.0, -30.0])


@dataclass(frozen=True, eq=False)
class Rig:
    """The sessions of both, and the camera's true X."""

    camera: Problem
    scanner: Problem
    mount_T_camera: Array

    @property
    def problems(self) -> dict[str, Problem]:
        return {"camera": self.camera, "scanner": self.scanner}


def random_rig(
    seed: int,
    stations: int,
    noise: CellNoise,
    *,
    setup: Setup = "eye-in-hand",
    camera_given: bool = True,
    measure: Measure | None = None,
) -> Rig:
    """`stations` views of both; the scanner measures the board's points unless `measure` is given."""
    rng = np.random.default_rng(seed)
    cell = random_cell(rng, stations, noise, setup=setup, camera_given=camera_given)
    measure = measure or points()
    views = []
    for view, base_T_flange in zip(cell.problem.views, cell.base_T_flange, strict=True):
        mount_T_target = inverse(anchor_T_mount_of(setup, base_T_flange)) @ cell.anchor_T_target
        scanner_T_target = inverse(cell.mount_T_camera @ CAMERA_T_SCANNER) @ mount_T_target
        views.append(View(view.index, Stance(view.base_T_flange), None, measured=measure(rng, scanner_T_target)))
    scanner = Problem(setup, cell.problem.target, None, (0, 0), tuple(views), in_space=True)
    return Rig(cell.problem, scanner, cell.mount_T_camera)


def squared_distance(true: Array, estimated: Array, covariance: Array) -> float:
    """Squared Mahalanobis distance of a pose, of six degrees of freedom."""
    off = vector_from_transform(inverse(true) @ estimated)
    return float(off @ np.linalg.solve(covariance, off))

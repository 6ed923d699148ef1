"""Where a point is placed at joints of which nothing else is known, and how far off it may be, on simulated arms."""

import numpy as np
import pytest

from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import AXES, Postures
from calibration.kinematics.robot_accuracy import RobotNoise
from calibration.likelihood.mapped_points import point_rows
from calibration.solver.registered_points import point_variances, registered_points, unknown_covariances
from calibration.transforms import Array, map_points
from extensions.arm_identification.mathematics.identification import ArmFit, identify_arm_session
from mock_robot.arm.built_arm import build_arm
from tests.simulated.arms import (
    ArmCell,
    arm_cell,
    box_postures,
    draw_points,
    draw_scatter,
    normalised_rms,
    reachable_views,
    target_places,
)
from tests.support.cases import seeds

ARM = find_arm("IRB 2600-20/1.65")
ARMS, HELD_OUT = 8, 50


def identified(seed: int) -> tuple[np.random.Generator, ArmCell, ArmFit, Array]:
    """An arm from twelve views of one place, and that place."""
    rng = np.random.default_rng([seed, 2])
    (target,) = target_places(rng, ARM, 1)
    cell = arm_cell(rng, build_arm(ARM, "standard", seed), [reachable_views(rng, ARM, target, 12)], [target])
    return rng, cell, identify_arm_session(ARM, cell.problems), target


def placed(fit: ArmFit, joints: Array, points: Array, scatter: RobotNoise) -> tuple[Array, Array]:
    """Points (n, 3) in the base at joints of which nothing else is known, and their covariances (n, 3, 3)."""
    postures = fit.postures(joints)
    found, covariances = registered_points(fit, postures, points)
    turns = fit.model.forward(fit.parameters, postures)[:, :3, :3]
    rows = turns @ point_rows(map_points(fit.mount_T_camera, points))
    of_poses = unknown_covariances(fit, joints) + np.diag(np.repeat(scatter.levels() ** 2, 3))
    return found, covariances + rows @ of_poses @ np.swapaxes(rows, 1, 2)


def normalised_square(rng: np.random.Generator, cell: ArmCell, fit: ArmFit, joints: Array) -> float:
    """Mean square of the errors of points, over their standard deviations, that arms with play and scatter make."""
    n = len(joints)
    points, scatter = draw_points(rng, n), draw_scatter(rng, n)
    stands = cell.built.base_T_flange(Postures(joints, sides=rng.choice([-1.0, 1.0], (n, AXES)))) @ scatter
    levels = RobotNoise(float(np.sqrt(fit.variances.translation)), float(np.sqrt(fit.variances.rotation)))
    found, covariances = placed(fit, joints, points, levels)
    off = found - map_points(stands @ cell.mount_T_camera, points[:, None])[:, 0]
    return normalised_rms(off, covariances) ** 2


@pytest.mark.slow
def test_errors_are_as_large_as_claimed_where_views_were_taken_and_away_from_them() -> None:
    squares = []
    for seed in seeds(ARMS):
        rng, cell, fit, target = identified(seed)
        near, far = reachable_views(rng, ARM, target, HELD_OUT), box_postures(rng, ARM, HELD_OUT)
        squares.append([normalised_square(rng, cell, fit, joints) for joints in (near, far)])
    near_rms, far_rms = np.sqrt(np.mean(squares, axis=0))
    assert 0.9 < near_rms < 1.15, (near_rms, far_rms)
    assert 0.9 < far_rms < 1.15, (near_rms, far_rms)


def test_the_variances_of_points_are_the_traces_of_their_covariances() -> None:
    _, cell, fit, _ = identified(0)
    joints = np.array([view.stance.joints_rad for view in cell.problems[0].views[:3]])
    where, levels, none = np.array([[0.0, 0.0, 500.0], [50.0, -40.0, 600.0]]), RobotNoise(0.02, 4e-5), RobotNoise(0, 0)
    for column, point in enumerate(where):
        covariances = placed(fit, joints, np.tile(point, (3, 1)), levels)[1]
        traces = np.trace(covariances, axis1=1, axis2=2)
        np.testing.assert_allclose(point_variances(fit, joints, where, levels)[:, column], traces)
        without = placed(fit, joints, np.tile(point, (3, 1)), none)[1]
        assert np.all(traces > np.trace(without, axis1=1, axis2=2))

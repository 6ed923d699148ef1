"""The model that all estimators share: its derivatives are those of finite differences, for stacks of any shape."""

import numpy as np
import pytest

from calibration.observations.pose_model import (
    MAX_STEP,
    clip_step,
    derivative_by_flange,
    derivative_by_shared,
    pose_residuals,
    predicted_camera_T_target,
)
from calibration.problem import Setup, anchor_T_mount_of, base_T_flange_of
from calibration.transforms import Array, transform_from_vector

SETUPS: tuple[Setup, ...] = ("eye-in-hand", "eye-to-hand")
STEPS = 1e-6 * np.eye(6)


def poses(seed: int, *stack: int) -> Array:
    rng = np.random.default_rng(seed)
    turns, places = rng.uniform(-1, 1, (*stack, 3)), rng.uniform(-500, 500, (*stack, 3))
    return transform_from_vector(np.concatenate([turns, places], axis=-1))


@pytest.mark.parametrize("setup", SETUPS)
def test_the_derivatives_are_those_of_small_motions(setup: Setup) -> None:
    base_T_flange, X, Y = poses(0, 2, 3), poses(1), poses(2)
    here = predicted_camera_T_target(anchor_T_mount_of(setup, base_T_flange), X, Y)

    def slopes(by_x: Array, by_y: Array, by_flange: Array) -> Array:
        anchor_T_mount = anchor_T_mount_of(setup, base_T_flange @ transform_from_vector(by_flange))
        there = predicted_camera_T_target(
            anchor_T_mount, X @ transform_from_vector(by_x), Y @ transform_from_vector(by_y)
        )
        return pose_residuals(there, here) / 1e-6

    still = np.zeros(6)
    by_x = np.stack([slopes(step, still, still) for step in STEPS], axis=-1)
    by_y = np.stack([slopes(still, step, still) for step in STEPS], axis=-1)
    by_flange = np.stack([slopes(still, still, step) for step in STEPS], axis=-1)
    np.testing.assert_allclose(derivative_by_shared(here), np.concatenate([by_x, by_y], axis=-1), atol=0.01)
    np.testing.assert_allclose(derivative_by_flange(setup, here, X, Y), by_flange, atol=0.01)


@pytest.mark.parametrize("setup", SETUPS)
def test_the_robot_pose_of_a_mount_is_the_one_it_came_from(setup: Setup) -> None:
    base_T_flange = poses(3, 4)
    found = base_T_flange_of(setup, anchor_T_mount_of(setup, base_T_flange))
    np.testing.assert_allclose(found, base_T_flange, atol=1e-9)


def test_long_steps_are_clipped_number_by_number() -> None:
    step = np.array([0.1, -9.0, 0.2, 1e5, -3.0, 4.0] * 2 + [7.0])
    expected = [0.1, -MAX_STEP[0], 0.2, MAX_STEP[3], -3.0, 4.0] * 2 + [MAX_STEP[0]]
    np.testing.assert_array_equal(clip_step(step), expected)

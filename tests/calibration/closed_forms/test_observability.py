"""Turns about one axis are refused, also when the robot's jitter gives small turns an axis of their own.

The refusal says which part of X is missing; the least singular values of the exact views' design are the comparison.
"""

import numpy as np
import pytest

from calibration.closed_forms.observability import require_observable, travel_across_mm
from calibration.errors import UndeterminedError
from calibration.pose_pairs.residuals import PosePairs, ScaledChain, linearise
from calibration.problem import Setup
from calibration.sentences.sentence import as_sentence
from calibration.transforms import Array, inverse, rotation_from_vector, transform


def about_one_axis(rng: np.random.Generator, jitter_deg: float) -> Array:
    angles = np.radians(rng.uniform(-40.0, 40.0, 10))
    axis = rng.standard_normal(3)
    turns = rotation_from_vector(np.outer(angles, axis / np.linalg.norm(axis)))
    jitter = rotation_from_vector(np.radians(jitter_deg) * rng.standard_normal((10, 3)))
    return transform(turns @ jitter, rng.uniform(-200.0, 200.0, (10, 3)))


@pytest.mark.parametrize("jitter_deg", [0.0, 0.01, 0.05])
def test_jitter_is_no_second_axis(jitter_deg: float) -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        with pytest.raises(UndeterminedError) as refused:
            require_observable(about_one_axis(rng, jitter_deg))
        assert refused.value.code == "parallel-axes"


def test_a_second_axis_is_one() -> None:
    rng = np.random.default_rng(6)
    poses = about_one_axis(rng, 0.05)
    poses[0, :3, :3] = poses[0, :3, :3] @ rotation_from_vector(np.radians(np.array([20.0, -15.0, 10.0])))
    require_observable(poses)


MOUNT_T_CAMERA = transform(rotation_from_vector([0.3, -2.0, 0.4]), [40.0, -60.0, 90.0])
ANCHOR_T_TARGET = transform(rotation_from_vector([-0.2, 0.1, 1.4]), [700.0, 100.0, -50.0])
TOOL_DOWN = rotation_from_vector([np.pi, 0.0, 0.0])


def four_axis_poses(travel_mm: float) -> Array:
    """Poses (10, 4, 4) of a palletiser: turns about the base's z, heights, and travel across z."""
    rng = np.random.default_rng(7)
    turns = rotation_from_vector(np.outer(np.linspace(-1.0, 1.0, 10), [0.0, 0.0, 1.0]))
    travel = rng.uniform(-1.0, 1.0, (10, 3)) * [travel_mm, travel_mm, 100.0]
    return transform(turns @ TOOL_DOWN, turns @ [600.0, 0.0, 400.0] + travel)


def undetermined_directions(setup: Setup, base_T_flange: Array) -> Array:
    """The steps (k, 12) of X and of the target's pose, [rad, mm / 100] each, that change no exact view."""
    anchor_T_mount = base_T_flange if setup == "eye-in-hand" else inverse(base_T_flange)
    pairs = PosePairs(setup, base_T_flange, inverse(anchor_T_mount @ MOUNT_T_CAMERA) @ ANCHOR_T_TARGET)
    slopes = linearise(pairs, ScaledChain(MOUNT_T_CAMERA, ANCHOR_T_TARGET, 1.0)).by_shared[:, :, :12]
    units = np.tile([1.0, 1.0, 1.0, 100.0, 100.0, 100.0], 2)
    _, values, steps = np.linalg.svd((slopes * units).reshape(-1, 12) / np.tile(units[:6], len(base_T_flange))[:, None])
    return steps[values < 1e-9 * values[0]]


@pytest.mark.parametrize("setup", ["eye-in-hand", "eye-to-hand"])
def test_a_palletiser_that_travels_leaves_one_number_of_x_open(setup: Setup) -> None:
    poses = four_axis_poses(travel_mm=150.0)
    (step,) = undetermined_directions(setup, poses)
    assert np.allclose(step[:3], 0.0, atol=1e-9)
    assert np.allclose(np.cross(MOUNT_T_CAMERA[:3, :3] @ step[3:6], [0.0, 0.0, 1.0]), 0.0, atol=1e-9)
    with pytest.raises(UndeterminedError) as refused:
        require_observable(poses)
    what, fix = as_sentence(refused.value.what), as_sentence(refused.value.fix)
    assert (refused.value.code, what.id, fix.id) == ("parallel-axes", "parallel-axes-with-travel", "turn-across")
    assert what.params["axis"] == "the base's z"
    assert np.allclose([what.params[name] for name in "xyz"], [0.0, 0.0, 1.0], atol=1e-9)
    assert "(a palletiser, a SCARA), one number is missing: the camera's offset along that axis in mm" in fix


def test_a_palletiser_that_only_turns_leaves_the_rotation_open_too() -> None:
    poses = four_axis_poses(travel_mm=0.0)
    assert len(undetermined_directions("eye-in-hand", poses)) == 2
    with pytest.raises(UndeterminedError) as refused:
        require_observable(poses)
    what, fix = as_sentence(refused.value.what), as_sentence(refused.value.fix)
    assert (refused.value.code, what.id, fix.id) == (
        "parallel-axes",
        "parallel-axes-without-travel",
        "turn-across-or-travel",
    )


@pytest.mark.parametrize("travel_mm", [0.0, 5.0, 150.0])
def test_travel_is_measured_across_the_axis_alone(travel_mm: float) -> None:
    """Turns about the base's z with an arm of 600 mm and heights that differ by 200 mm are no travel."""
    found = travel_across_mm(np.array([0.0, 0.0, 1.0]), four_axis_poses(travel_mm))
    assert 0.3 * travel_mm - 1e-9 < found <= 1.5 * travel_mm + 1e-9

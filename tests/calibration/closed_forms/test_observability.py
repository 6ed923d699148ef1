"""Turns about one axis are refused also when the robot's jitter gives small turns an axis of their own."""

import numpy as np
import pytest

from calibration.closed_forms.observability import require_observable
from calibration.errors import UndeterminedError
from calibration.transforms import Array, rotation_from_vector, transform


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

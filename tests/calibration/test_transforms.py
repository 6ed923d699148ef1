"""Rotations in every form, beside scipy's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.errors import GeometryError
from calibration.transforms import (
    Array,
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
    vector_from_rotation,
)

HALF_TURNS = np.pi * np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.8, 0], [0, -0.6, 0.8], [-0.6, 0, 0.8]])
NEARLY_HALF = HALF_TURNS * (1 - 1e-7)
SMALL = np.array([[0, 0, 0], [1e-300, 0, 0], [1e-9, -1e-9, 2e-9], [0, 1e-4, 0]])
ANY = np.random.default_rng(0).normal(size=(500, 3))

CASES = {"any": ANY, "half turns": HALF_TURNS, "nearly half turns": NEARLY_HALF, "small": SMALL, "none": ANY[:0]}


@pytest.mark.parametrize("vectors", CASES.values(), ids=CASES)
def test_conversions_agree_with_scipy(vectors: Array) -> None:
    theirs = Rotation.from_rotvec(vectors)
    ours = rotation_from_vector(vectors)
    assert ours == pytest.approx(theirs.as_matrix(), abs=2e-15)
    quaternions = theirs.as_quat(canonical=True, scalar_first=True)
    assert rotation_from_quaternion(quaternions) == pytest.approx(theirs.as_matrix(), abs=2e-15)
    found = quaternion_from_rotation(ours)
    assert found == pytest.approx(quaternions, abs=2e-15) or found == pytest.approx(-quaternions, abs=2e-15)
    assert np.all(found[:, 0] >= 0)


def test_one_rotation_is_a_stack_without_an_axis() -> None:
    rotation = rotation_from_vector([0.1, -0.2, 0.3])
    assert rotation.shape == (3, 3)
    assert vector_from_rotation(rotation) == pytest.approx([0.1, -0.2, 0.3], abs=1e-15)
    assert rotation_from_quaternion(quaternion_from_rotation(rotation)) == pytest.approx(rotation, abs=1e-15)
    assert rotation_from_vector(np.zeros((2, 5, 3))).shape == (2, 5, 3, 3)


@pytest.mark.parametrize("vectors", CASES.values(), ids=CASES)
def test_a_rotation_vector_comes_back_as_the_same_rotation(vectors: Array) -> None:
    rotation = rotation_from_vector(vectors)
    vector = vector_from_rotation(rotation)
    assert np.all(np.linalg.norm(vector, axis=-1) <= np.pi + 1e-12)
    assert rotation_from_vector(vector) == pytest.approx(rotation, abs=1e-12)


def test_a_rounded_quaternion_is_taken_as_the_rotation_it_is_nearest_to() -> None:
    """ABB prints three decimals or more."""
    rounded = np.array([0.500, 0.501, 0.499, 0.500])
    rotation = rotation_from_quaternion(rounded)
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-15)
    with pytest.raises(GeometryError, match=r"norm 1\.1 is not 1"):
        rotation_from_quaternion([1.1, 0, 0, 0])

"""Properties over random rigid transforms: what a change of frame changes, and what it does not."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from calibration.problem import Problem, Setup
from calibration.solve import estimate_session
from calibration.targets import Chessboard
from calibration.transforms import (
    Array,
    difference,
    inverse,
    rotation_angle_rad,
    rotation_from_vector,
    transform,
    transform_from_vector,
    vector_from_rotation,
    vector_from_transform,
)
from tests.simulated.sessions import random_cell
from tests.simulated.spoiled_sessions import ORDINARY, QUIET

FEW = settings(max_examples=4, phases=(Phase.explicit, Phase.generate), deadline=None, derandomize=True)
"""Each example is two whole solutions; a seed is as simple as it gets."""

SMALL = Chessboard(5, 4, 25.0)
SETUPS: tuple[Setup, ...] = ("eye-in-hand", "eye-to-hand")
numbers = st.floats(-1.0, 1.0)
vectors = st.tuples(numbers, numbers, numbers)


@st.composite
def rigid(draw: st.DrawFn) -> Array:
    """A rotation by up to half a turn and a shift of up to some metres."""
    axis, angle = np.array(draw(vectors)), draw(st.floats(0.0, np.pi))
    length = float(np.linalg.norm(axis))
    turn = axis / length * angle if length > 1e-3 else np.zeros(3)
    return transform(rotation_from_vector(turn), 3000 * np.array(draw(vectors)))


def session(seed: int, setup: Setup, *, noise: bool) -> Problem:
    rng = np.random.default_rng(seed)
    return random_cell(rng, 6, ORDINARY if noise else QUIET, setup=setup, target=SMALL).problem


def moved(problem: Problem, left: Array, right: Array) -> Problem:
    """The same images, the robot's poses told in another base frame (left) and of another flange (right)."""
    views = tuple(view.standing(base_T_flange=left @ view.base_T_flange @ right) for view in problem.views)
    return replace(problem, views=views)


def solved(problem: Problem) -> tuple[Array, Array]:
    chain = estimate_session(problem).best.chain
    return chain.mount_T_camera, chain.anchor_T_target


def same(a: Array, b: Array, mm: float = 0.02, rad: float = 2e-5) -> bool:
    translation_mm, rotation_rad = difference(a, b)
    return translation_mm < mm and rotation_rad < rad


@pytest.mark.parametrize("setup", SETUPS)
@FEW
@given(seed=st.integers(0, 10_000), base=rigid())
def test_another_base_frame_moves_what_is_fixed_to_the_base(setup: Setup, seed: int, base: Array) -> None:
    problem = session(seed, setup, noise=True)
    X, Y = solved(problem)
    X_moved, Y_moved = solved(moved(problem, base, np.eye(4)))
    if setup == "eye-in-hand":
        assert same(X_moved, X) and same(inverse(base) @ Y_moved, Y)
    else:
        assert same(inverse(base) @ X_moved, X) and same(Y_moved, Y)


@pytest.mark.parametrize("setup", SETUPS)
@FEW
@given(seed=st.integers(0, 10_000), flange=rigid())
def test_another_flange_moves_what_is_fixed_to_the_flange(setup: Setup, seed: int, flange: Array) -> None:
    problem = session(seed, setup, noise=False)
    X, Y = solved(problem)
    X_moved, Y_moved = solved(moved(problem, np.eye(4), flange))
    if setup == "eye-in-hand":
        assert same(flange @ X_moved, X) and same(Y_moved, Y)
    else:
        assert same(X_moved, X) and same(flange @ Y_moved, Y)


@FEW
@given(seed=st.integers(0, 10_000), order=st.permutations(range(6)))
def test_the_order_of_the_views_does_not_matter(seed: int, order: list[int]) -> None:
    problem = session(seed, "eye-in-hand", noise=True)
    shuffled = replace(problem, views=tuple(problem.views[index] for index in order))
    assert same(solved(problem)[0], solved(shuffled)[0])


@FEW
@given(seed=st.integers(0, 10_000))
def test_the_two_set_ups_are_one_seen_from_both_ends(seed: int) -> None:
    problem = session(seed, "eye-in-hand", noise=False)
    turned_round = tuple(view.standing(base_T_flange=inverse(view.base_T_flange)) for view in problem.views)
    other = replace(problem, setup="eye-to-hand", views=turned_round)
    for one, another in zip(solved(problem), solved(other), strict=True):
        assert same(one, another)


@given(a=rigid())
def test_exponential_and_logarithm_are_inverses(a: Array) -> None:
    vector = vector_from_rotation(a[:3, :3])
    assert np.allclose(rotation_from_vector(vector), a[:3, :3], atol=1e-9)
    assert abs(rotation_angle_rad(a[:3, :3]) - np.linalg.norm(vector)) < 1e-9
    stack = np.array([[a, inverse(a)], [np.eye(4), a]])
    np.testing.assert_allclose(transform_from_vector(vector_from_transform(stack)), stack, atol=1e-9)
    np.testing.assert_allclose(vector_from_transform(a), [*vector, *a[:3, 3]], atol=1e-9)

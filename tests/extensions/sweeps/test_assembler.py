"""Profiles along the arm's path become points in the base frame, at once or while they arrive."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform
from extensions.sweeps.mathematics.assembler import MAX_WAITING_PROFILES, SweepAssembler, assemble_sweep
from registration.errors import PathError, PathGap, ProfileError, RegistrationError
from registration.profiles.profile_block import ProfileBlock
from registration.profiles.robot_path import RobotPath

X = transform(rotation_from_vector([0.3, -0.2, 1.1]), [40.0, -25.0, 120.0])
OFFSET_S = 0.037
TIMES_S = np.arange(0.0, 2.0, 0.01)


def pose_at(time_s: float) -> Array:
    """A steady sweep at 100 mm/s that turns by 0.2 rad a second."""
    turned = rotation_from_vector([np.pi, 0, 0]) @ rotation_from_vector([0.0, 0.0, 0.2 * time_s])
    return transform(turned, [800.0 + 100 * time_s, -50.0, 600.0])


PATH = RobotPath.of(TIMES_S, [pose_at(time) for time in TIMES_S])


def flat_profiles(count: int = 300) -> ProfileBlock:
    """Profiles of the plane z = 300 mm in base; the sensor's clock is OFFSET_S behind; some points are missing."""
    times = np.linspace(0.1, 1.8, count)
    x = np.linspace(-40, 40, 50)
    z = np.empty((count, len(x)))
    for row, time in enumerate(times):
        pose = pose_at(time + OFFSET_S) @ X
        z[row] = (300.0 - pose[2, 3] - pose[2, 0] * x) / pose[2, 2]
    z[::7, 3] = np.nan
    return ProfileBlock.of(times, x, z)


def test_a_path_between_its_poses_is_the_steady_motion() -> None:
    times = np.array([0.0, 0.0137, 0.5, 1.2345, TIMES_S[-1]])
    np.testing.assert_allclose(PATH.at(times), [pose_at(time) for time in times], atol=1e-9)


def test_a_path_goes_on_only_as_far_as_stated() -> None:
    late = TIMES_S[-1] + 0.02
    np.testing.assert_allclose(PATH.at(late, max_beyond_s=0.05), pose_at(late), atol=1e-9)
    with pytest.raises(PathGap) as caught:
        PATH.at([0.5, late])
    assert caught.value.outside and caught.value.gap_s == pytest.approx(0.02)


def test_a_pause_in_the_path_is_refused() -> None:
    kept = (TIMES_S < 0.5) | (TIMES_S > 0.8)
    path = RobotPath.of(TIMES_S[kept], PATH.base_T_flange[kept])
    with pytest.raises(PathGap) as caught:
        path.at([0.2, 0.6])
    assert not caught.value.outside and caught.value.time_s == pytest.approx(0.6)
    path.at([0.2, 0.9])


def test_a_sweep_over_a_plane_is_the_plane() -> None:
    block = flat_profiles()
    points = np.concatenate(list(assemble_sweep(block, PATH, X, OFFSET_S)))
    assert len(points) == np.isfinite(block.z_mm).sum()
    np.testing.assert_allclose(points[:, 2], 300.0, atol=1e-3)
    middle = inverse(pose_at(0.1 + OFFSET_S) @ X)
    np.testing.assert_allclose(map_points(middle, points[:10])[:, 1], 0.0, atol=1e-3)


@pytest.mark.parametrize(("poses_at_once", "profiles_at_once"), [(1, 2), (25, 37), (200, 1), (10, 300)])
def test_a_sweep_that_arrives_in_pieces_is_the_same(poses_at_once: int, profiles_at_once: int) -> None:
    block, sweep, found = flat_profiles(), SweepAssembler(X, OFFSET_S), []
    for step in range(max(len(TIMES_S) // poses_at_once, len(block) // profiles_at_once) + 1):
        poses = slice(step * poses_at_once, (step + 1) * poses_at_once)
        sweep.add_profiles(block[step * profiles_at_once : (step + 1) * profiles_at_once])
        sweep.add_poses(TIMES_S[poses], PATH.base_T_flange[poses])
        found += list(sweep.blocks())
    sweep.require_finished()
    np.testing.assert_allclose(
        np.concatenate(found), np.concatenate(list(assemble_sweep(block, PATH, X, OFFSET_S))), atol=1e-3
    )


def test_profiles_without_poses_are_named() -> None:
    sweep = SweepAssembler(X)
    sweep.add_profiles(flat_profiles())
    assert list(sweep.blocks()) == []
    with pytest.raises(PathGap):
        sweep.require_finished()
    long = ProfileBlock.of(np.full(MAX_WAITING_PROFILES, 2.0), [0.0], np.zeros((MAX_WAITING_PROFILES, 1)))
    with pytest.raises(ProfileError, match="wait for the robot's poses"):
        sweep.add_profiles(long)


@pytest.mark.parametrize(
    ("times", "poses"),
    [
        ([0.0, 1.0], [np.eye(4)]),
        ([0.0], [np.eye(4)]),
        ([0.0, np.nan], [np.eye(4)] * 2),
        ([0.0, 0.0], [np.eye(4)] * 2),
        ([0.0, 1.0], [np.eye(4), np.diag([1.0, 1.0, -1.0, 1.0])]),
        ([0.0, 1.0], [np.eye(4), 2 * np.eye(4)]),
        ([0.0, 1.0], [np.eye(4), np.full((4, 4), np.nan)]),
    ],
)
def test_what_is_no_path_is_refused(times: list[float], poses: list[Array]) -> None:
    with pytest.raises(PathError):
        RobotPath.of(times, poses)


@pytest.mark.parametrize(
    ("times", "x", "z"),
    [
        ([0.0], [1.0, 2.0], [[1.0]]),
        ([0.0, 1.0], [1.0], [[1.0]]),
        ([1.0, 0.0], [1.0], [[1.0], [1.0]]),
        ([np.inf], [1.0], [[1.0]]),
        ([0.0], ["a"], [["b"]]),
        ([0.0], np.zeros(70_000), np.zeros((1, 70_000))),
    ],
)
def test_what_is_no_profile_is_refused(times: list[float], x: object, z: object) -> None:
    with pytest.raises(ProfileError):
        ProfileBlock.of(times, x, z)  # type: ignore[arg-type]


FLOATS = st.floats(allow_nan=True, allow_infinity=True)


@given(
    times=arrays.arrays(float, st.integers(0, 4), elements=FLOATS | st.sampled_from([0.0, 0.01, 0.02])),
    z=arrays.arrays(float, arrays.array_shapes(min_dims=1, max_dims=2, max_side=4), elements=FLOATS),
    pose_times=st.sampled_from([[], [0.0], [0.0, 0.01, 0.03], [0.0, np.nan], [0.0, 1e300]]),
    offset_s=FLOATS | st.just(0.0),
)
def test_any_numbers_give_points_or_a_typed_error(
    times: Array, z: Array, pose_times: list[float], offset_s: float
) -> None:
    try:
        sweep = SweepAssembler(X, offset_s)
        sweep.add_profiles(ProfileBlock.of(times, z, z))
        sweep.add_poses(pose_times, np.tile(np.eye(4), (len(pose_times), 1, 1)))
        for points in sweep.blocks():
            assert np.isfinite(points).all()
        sweep.require_finished()
    except RegistrationError as error:
        assert error.what and error.fix

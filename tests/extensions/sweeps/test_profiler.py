"""X and the clock offset of a line profiler, from sweeps over a sphere and over planes; else refused."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from calibration.kinematics.robot_accuracy import RobotNoise
from calibration.solution import Solution
from calibration.transforms import Array, difference, inverse, rotation_from_vector, transform, vector_from_transform
from extensions.sweeps.mathematics.profile_solver import _rate
from extensions.sweeps.mathematics.profiler import ArtefactSweep, solve_profiler
from registration.calibrate.outcome import judge_scan
from registration.errors import ProfileError, RegistrationError
from registration.profiles.profile_block import ProfileBlock
from registration.profiles.robot_path import RobotPath
from tests.extensions.sweeps.profile_sweeps import FLANGE_T_PROFILER, OFFSET_S, RADIUS_MM, SensorNoise, sweep, sweeps
from tests.support.cases import by_night, seeds

ROBOT = RobotNoise(0.2, float(np.radians(0.02)))
STILL = RobotNoise(0.0, 0.0)
ROUGH = FLANGE_T_PROFILER @ transform(rotation_from_vector([0.05, -0.04, 0.05]), [3.0, 3.0, -4.0])
SPHERE, PLANES, BOTH = [None] * 8, [0, 1, 2] * 4, [None, 0, 1, 2] * 3


def named(surfaces: Sequence[int | None], data: Sequence[tuple[ProfileBlock, RobotPath]]) -> list[ArtefactSweep]:
    return [
        ArtefactSweep(block, path, str(surface), RADIUS_MM if surface is None else None)
        for surface, (block, path) in zip(surfaces, data, strict=True)
    ]


def errors_of(solution: Solution) -> Array:
    """(7,): what the solution lacks to the truth, [rad, mm] in the profiler frame and s."""
    assert solution.mount_T_camera is not None and solution.clock_offset is not None
    off = vector_from_transform(inverse(solution.mount_T_camera) @ FLANGE_T_PROFILER)
    return np.append(off, OFFSET_S - solution.clock_offset.offset_s)


@pytest.mark.parametrize(
    "surfaces", [SPHERE, pytest.param(BOTH, marks=pytest.mark.slow)], ids=["sphere", "sphere and planes"]
)
def test_x_and_the_clock_offset_are_found_without_a_first_guess(surfaces: list[int | None]) -> None:
    solution = solve_profiler(named(surfaces, sweeps(surfaces, 1, ROBOT)))
    off = errors_of(solution)
    assert np.abs(off[:3]).max() < 2e-3 and np.abs(off[3:6]).max() < 0.6 and abs(off[6]) < 3e-3
    assert all(view.status == "used" for view in solution.views)
    assert judge_scan(solution).accepted


def test_without_noise_x_is_exact() -> None:
    solution = solve_profiler(named(SPHERE, sweeps(SPHERE, 2, STILL, SensorNoise(1e-4))), ROUGH)
    off = errors_of(solution)
    assert np.abs(off[:3]).max() < 2e-5 and np.abs(off[3:6]).max() < 5e-3 and abs(off[6]) < 1e-4


ERRORS: dict[str, tuple[list[int | None], float, float]] = {
    "sphere, poor arm": (SPHERE, 0.8, 0.0),
    "planes, jitter": (PLANES, 0.2, 0.001),
    "both": (BOTH, 0.2, 0.0),
}
"""Surfaces, and the errors of the robot, mm, and of the times, s."""

MORE_ERRORS: dict[str, tuple[list[int | None], float, float]] = {
    "sphere, good arm": (SPHERE, 0.05, 0.0),
    "sphere, jitter": (SPHERE, 0.2, 0.001),
    "planes": (PLANES, 0.2, 0.0),
}
"""Those of the night."""


@pytest.mark.slow
@pytest.mark.parametrize("errors", {**ERRORS, **(MORE_ERRORS if by_night() else {})})
def test_the_covariance_is_that_of_the_errors(errors: str) -> None:
    """Normalised errors of 20 calibrations by night, and of 7: 49 degrees of freedom scatter by 10 %."""
    surfaces, robot_mm, time_s = {**ERRORS, **MORE_ERRORS}[errors]
    squares = []
    for seed in seeds(20):
        robot = RobotNoise(robot_mm, float(np.radians(robot_mm / 10)))
        solution = solve_profiler(named(surfaces, sweeps(surfaces, 50 + seed, robot, SensorNoise(0.02, time_s))), ROUGH)
        assert solution.uncertainty is not None and solution.clock_offset is not None
        off = errors_of(solution)
        squares.append(off[:6] @ np.linalg.solve(solution.uncertainty.covariance, off[:6]) / 7)
        squares[-1] += (off[6] / solution.clock_offset.sigma_s) ** 2 / 7
    assert 0.8 < np.sqrt(np.mean(squares)) < 1.2


@pytest.mark.parametrize(
    ("tilt", "along", "named_unknowns"),
    [
        (0.0, None, "translation along"),
        (0.45, np.array([0.0, 1.0, 0.0]), "clock offset"),
    ],
    ids=["never turned", "always one way"],
)
def test_what_the_sweeps_do_not_determine_is_named(tilt: float, along: Array | None, named_unknowns: str) -> None:
    random = np.random.default_rng(3)
    data = [sweep(None, random, STILL, tilt=tilt, along=along, turning_rad_s=0.0) for _ in range(8)]
    solution = solve_profiler(named(SPHERE, data), ROUGH)
    assert solution.mount_T_camera is None and solution.clock_offset is None
    (finding,) = solution.findings
    assert finding.code == "profiler-unobservable"
    assert named_unknowns in finding.message
    assert not judge_scan(solution).accepted


def test_one_plane_seen_from_one_side_does_not_determine_x() -> None:
    random = np.random.default_rng(4)
    solution = solve_profiler(named([0] * 6, [sweep(0, random, ROBOT, tilt=0.0) for _ in range(6)]), ROUGH)
    assert solution.mount_T_camera is None
    assert "rotation about z and translation along x" in solution.findings[0].message


def test_a_sweep_beside_the_sphere_is_rejected_with_a_reason() -> None:
    data = [*sweeps(SPHERE, 5, ROBOT), sweep(0, np.random.default_rng(0), ROBOT)]
    solution = solve_profiler(named([*SPHERE, None], data), ROUGH)
    assert [view.status for view in solution.views] == ["used"] * 8 + ["rejected"]
    assert (solution.views[-1].reason or "").startswith("artefact-not-found")
    assert np.abs(errors_of(solution)[3:6]).max() < 0.6


def test_a_wrong_radius_and_other_times_are_refused() -> None:
    data = sweeps(SPHERE[:3], 6, ROBOT)
    small = solve_profiler([ArtefactSweep(block, path, "ball", 0.9 * RADIUS_MM) for block, path in data])
    assert small.mount_T_camera is None and all("radius" in (view.reason or "") for view in small.views)
    late = [ArtefactSweep(_later(block, 3600.0), path, "ball", RADIUS_MM) for block, path in data]
    assert all("not of the same time" in (view.reason or "") for view in solve_profiler(late).views)
    with pytest.raises(ProfileError, match="two radii"):
        solve_profiler([ArtefactSweep(*data[0], "ball", 25.0), ArtefactSweep(*data[1], "ball", 12.5)])


def _stand(data: Sequence[tuple[ProfileBlock, RobotPath]]) -> list[tuple[ProfileBlock, RobotPath]]:
    """One profile of each sweep, near its middle, and the arm as if it had stood there."""
    taken = []
    for index, (block, path) in enumerate(data):
        at = len(block) // 2 + 8 * (index % 5 - 2)
        pose = path.at(block.times_s[at] + OFFSET_S)
        still = RobotPath.of(block.times_s[at] + np.array([-0.5, 0.5]), np.stack([pose, pose]))
        taken.append((block[at : at + 1], still))
    return taken


@pytest.mark.parametrize("surfaces", [[None] * 16, [0, 1, 2] * 6], ids=["sphere", "planes"])
def test_one_profile_at_each_pose_determines_x_and_no_clock(surfaces: list[int | None]) -> None:
    solution = solve_profiler(named(surfaces, _stand(sweeps(surfaces, 9, RobotNoise(0.05, 1e-4)))))
    assert solution.mount_T_camera is not None and solution.clock_offset is None and solution.uncertainty is not None
    off = vector_from_transform(inverse(solution.mount_T_camera) @ FLANGE_T_PROFILER)
    assert np.all(np.abs(off) < 4 * np.sqrt(np.diag(solution.uncertainty.covariance)))
    assert np.abs(off[:3]).max() < 0.02 and np.abs(off[3:]).max() < 1.5


def test_an_arm_that_stands_has_no_rate_from_which_a_clock_could_follow() -> None:
    random, times_s = np.random.default_rng(3), np.linspace(-0.15, 0.15, 7)
    pose = transform(rotation_from_vector(random.normal(0, 2, 3)), random.normal(0, 500, 3))
    poses = np.stack([pose] * len(times_s))
    poses[:, :3, 3] += random.normal(0, 1e-4, (len(times_s), 3))  # the last digit that a controller gives
    assert not _rate(RobotPath.of(times_s, poses), times_s).any()


@pytest.mark.parametrize("ratio", [0.8, 1.15])
def test_profiles_taken_standing_with_a_wrong_radius_are_not_accepted(ratio: float) -> None:
    data = _stand(sweeps([None] * 16, 9, RobotNoise(0.05, 1e-4)))
    solution = solve_profiler([ArtefactSweep(block, path, "ball", ratio * RADIUS_MM) for block, path in data])
    assert not judge_scan(solution).accepted


def _later(block: ProfileBlock, by_s: float) -> ProfileBlock:
    return ProfileBlock(block.times_s + by_s, block.x_mm, block.z_mm)


WORN = sweeps([None] * 3, 7, ROBOT)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    kept=st.integers(0, 3),
    radius_mm=st.sampled_from([None, 25.0, -1.0, 0.0, 1e-9, 1e300, float("nan"), float("inf")]),
    scale=st.sampled_from([0.0, 1.0, -1.0, 1e-30, 1e30, float("nan"), float("inf")]),
    by_s=st.sampled_from([0.0, 0.5, 1e300]),
    rows=st.integers(0, 40),
)
def test_bad_sweeps_give_a_reason_and_no_traceback(
    kept: int, radius_mm: float | None, scale: float, by_s: float, rows: int
) -> None:
    with np.errstate(all="ignore"):
        worn = [
            ArtefactSweep(ProfileBlock(block.times_s[:rows] + by_s, block.x_mm[:rows], scale * block.z_mm[:rows]), path,
                          "ball", radius_mm)
            for block, path in WORN[:kept]
        ]  # fmt: skip
    try:
        solution = solve_profiler(worn, FLANGE_T_PROFILER)
    except RegistrationError as error:
        assert error.what and error.fix
        return
    assert solution.mount_T_camera is not None or solution.findings[0].message
    if solution.mount_T_camera is not None:
        assert difference(solution.mount_T_camera, FLANGE_T_PROFILER)[0] < np.inf

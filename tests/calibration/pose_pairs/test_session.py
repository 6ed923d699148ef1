"""Sessions of poses and of points in space: solved like images, with the same uncertainty, causes and verdict."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from calibration.diagnosis.convention_hypotheses import change_quaternion_order
from calibration.kinematics.conventions import euler_numbers, rotation_from_euler
from calibration.knowledge import CameraSource, Knowledge
from calibration.likelihood.mapped_points import point_sigmas_mm, scale_variance_mm2
from calibration.problem import MeasuredPoints, MeasuredPose, Setup
from calibration.solution import Solution
from calibration.solve import solve_hand_eye
from calibration.transforms import Array, inverse, map_points, transform, vector_from_rotation
from calibration.verdict import DEFAULT_VERDICT_LIMITS, VerdictLimits, judge, weigh
from tests.simulated.measured_sessions import (
    Measure,
    measured_cell,
    points,
    tracker,
    with_camera_poses,
    with_robot_poses,
)
from tests.simulated.sessions import BOARD
from tests.support.cases import by_night, crossed, seeds

SETUPS: tuple[Setup, ...] = ("eye-in-hand", "eye-to-hand")
CAMERA_SOURCES: tuple[CameraSource, ...] = ("this-session", "file", "nominal")
MEASURES = {"poses": tracker(), "poses with covariance": tracker(known=True), "points": points()}


def codes(solution: Solution) -> list[str]:
    weighed = (weigh(finding, None, DEFAULT_VERDICT_LIMITS) for finding in solution.findings)
    return [finding.code for finding in weighed if finding.severity != "info"]


@pytest.mark.parametrize("setup", SETUPS)
@pytest.mark.parametrize("measure", MEASURES.values(), ids=MEASURES)
def test_a_clean_session_is_accepted_and_true_within_its_uncertainty(measure: Measure, setup: Setup) -> None:
    cell = measured_cell(np.random.default_rng(4), 18, measure, setup=setup)
    solution = solve_hand_eye(cell.problem)

    assert judge(cell.problem, solution).accepted
    assert codes(solution) == []
    assert solution.mount_T_camera is not None
    assert solution.uncertainty is not None
    error = cell.error(solution.mount_T_camera)
    assert error @ np.linalg.solve(solution.uncertainty.covariance, error) < 25
    assert solution.uncertainty.point_mm < 0.5
    assert solution.hold_out is not None
    assert solution.hold_out.base_error_mm < 1.0


@pytest.mark.parametrize("views", [3, 4, 5])
def test_lengths_of_a_usual_print_are_within_the_uncertainty_of_few_views(views: int) -> None:
    squares = []
    for seed in range(8):
        rng = np.random.default_rng([views, seed])
        cell = measured_cell(rng, views, tracker(0.005, 0.05), robot_deg=0.005, robot_mm=0.05)
        solution = solve_hand_eye(with_camera_poses(cell.problem, longer(1.002)))
        assert solution.mount_T_camera is not None and solution.uncertainty is not None
        error = cell.error(solution.mount_T_camera)
        squares.append(error @ np.linalg.solve(solution.uncertainty.covariance, error))
    assert np.mean(squares) < 9  # of six numbers


def deeper(factor: float) -> Callable[[Array], Array]:
    """The depth of the board's middle as another focal length makes it."""
    middle = np.append(BOARD.points_mm.mean(axis=0), 1.0)
    return lambda poses: poses + np.pad((factor - 1) * (poses[:, 2:3, None] @ middle), ((0, 0), (2, 1), (3, 0)))


FOCAL_LENGTHS = [(5, 0.008, False), (6, 0.006, False), (10, -0.01, True), (20, 0.01, True)]
"""Views, share by which depths are off, and whether they show it."""


@pytest.mark.parametrize(("views", "share", "shows"), FOCAL_LENGTHS)
def test_depths_of_another_focal_length_are_within_the_uncertainty(views: int, share: float, shows: bool) -> None:
    squares = []
    for seed in range(4):
        cell = measured_cell(
            np.random.default_rng([views, seed]), views, tracker(0.01, 0.05), robot_deg=0.01, robot_mm=0.05
        )
        solution = solve_hand_eye(with_camera_poses(cell.problem, deeper(1 + share)))
        assert solution.mount_T_camera is not None and solution.uncertainty is not None
        error = cell.error(solution.mount_T_camera)
        squares.append(error @ np.linalg.solve(solution.uncertainty.covariance, error))
        assert shows == any(finding.code == "focal-length-off" for finding in solution.findings)
    assert np.mean(squares) < 11  # of six numbers; 18 to 34 where the focal length counts as exact


@pytest.mark.parametrize(("measure", "focal"), [(tracker(), True), (points(), False)], ids=["poses", "points"])
def test_a_statement_of_the_focal_length_counts_for_poses_alone(measure: Measure, focal: bool) -> None:
    problem = measured_cell(np.random.default_rng(3), 5, measure).problem
    sigmas_mm = []
    for camera in CAMERA_SOURCES:
        solution = solve_hand_eye(replace(problem, knowledge=Knowledge(camera=camera)))
        assert solution.uncertainty is not None
        sigmas_mm.append(solution.uncertainty.point_mm)
    sure, usual, nominal = sigmas_mm
    assert sure < usual < nominal if focal else sure == usual == nominal


@pytest.mark.parametrize(("views", "seed"), [(8, 12), (10, 8)])
def test_a_few_views_and_lengths_a_little_off_are_not_taken_for_drift(views: int, seed: int) -> None:
    """Independent errors that look like those of odometry by chance; U is 1 to 2 mm."""
    cell = measured_cell(np.random.default_rng([3, views, seed, 10020]), views, tracker())
    problem = with_camera_poses(cell.problem, longer(1.002))
    solution = solve_hand_eye(problem)
    assert judge(problem, solution, VerdictLimits().with_tolerance(4.0)).accepted
    assert solution.mount_T_camera is not None and solution.uncertainty is not None
    error = cell.error(solution.mount_T_camera)
    assert error @ np.linalg.solve(solution.uncertainty.covariance, error) < 6 * 2.0**2


@pytest.mark.slow
@pytest.mark.parametrize(("measured", "of"), crossed(MEASURES, product([6, 24, *[12] * by_night()], SETUPS)), ids=repr)
def test_errors_have_the_size_that_is_claimed(measured: str, of: tuple[int, Setup]) -> None:
    measure, (views, setup), squares = MEASURES[measured], of, []
    for seed in seeds(20):
        cell = measured_cell(np.random.default_rng([7, seed]), views, measure, setup=setup)
        solution = solve_hand_eye(cell.problem)
        assert solution.mount_T_camera is not None
        assert solution.uncertainty is not None
        error = cell.error(solution.mount_T_camera)
        squares.append(error @ np.linalg.solve(solution.uncertainty.covariance, error) / 6)
    assert 0.4 < np.mean(squares) < 1.7


def longer(factor: float) -> Callable[[Array], Array]:
    return lambda poses: transform(poses[:, :3, :3], factor * poses[:, :3, 3])


def read_as(wrote: str, read: str) -> Callable[[Array], Array]:
    def change(poses: Array) -> Array:
        return transform(rotation_from_euler(euler_numbers(poses[:, :3, :3], wrote)[0][:, 0], read), poses[:, :3, 3])

    return change


def vector_as_euler(poses: Array) -> Array:
    return transform(rotation_from_euler(vector_from_rotation(poses[:, :3, :3]), "ZYX"), poses[:, :3, 3])


def transposed(poses: Array) -> Array:
    return transform(np.swapaxes(poses[:, :3, :3], 1, 2), poses[:, :3, 3])


def w_read_last(poses: Array) -> Array:
    return change_quaternion_order(change_quaternion_order(change_quaternion_order(poses)))


MISTAKES = {
    "robot in metres": (with_robot_poses, longer(1e-3), "poses-in-metres"),
    "camera in metres": (with_camera_poses, longer(1e-3), "camera-poses-in-metres"),
    "camera in inches": (with_camera_poses, longer(1 / 25.4), "camera-poses-in-inches"),
    "robot inverted": (with_robot_poses, inverse, "poses-inverted"),
    "camera inverted": (with_camera_poses, inverse, "camera-poses-inverted"),
    "robot's quaternions": (with_robot_poses, w_read_last, "quaternion-w-last"),
    "camera's quaternions": (with_camera_poses, w_read_last, "camera-quaternion-w-last"),
    "robot's Euler order": (with_robot_poses, read_as("ZYX", "XYZ"), "euler-order"),
    "camera's Euler order": (with_camera_poses, read_as("ZYX", "XYZ"), "camera-euler-order"),
    "camera's vectors": (with_camera_poses, vector_as_euler, "camera-vector-read-as-euler"),
    "camera transposed": (with_camera_poses, transposed, "camera-rotation-transposed"),
    "one row late": (with_robot_poses, lambda poses: np.roll(poses, 1, axis=0), "poses-off-by-one"),
    "camera 2 % long": (with_camera_poses, longer(1.02), "camera-scale"),
}


@pytest.mark.parametrize(("mistake", "setup"), crossed(MISTAKES, SETUPS))
def test_a_mistake_is_named_and_refused(mistake: str, setup: Setup) -> None:
    where, change, code = MISTAKES[mistake]
    problem = where(measured_cell(np.random.default_rng(3), 14, tracker(), setup=setup).problem, change)
    solution = solve_hand_eye(problem)
    assert code in codes(solution), solution.findings
    assert not judge(problem, solution).accepted


def test_both_in_metres_is_named_though_nothing_contradicts() -> None:
    problem = measured_cell(np.random.default_rng(3), 14, tracker()).problem
    metres = with_camera_poses(with_robot_poses(problem, longer(1e-3)), longer(1e-3))
    assert codes(solve_hand_eye(metres)) == ["poses-in-metres"]


def test_points_in_metres_are_named() -> None:
    problem = measured_cell(np.random.default_rng(3), 8, points()).problem
    views = []
    for view in problem.views:
        assert isinstance(view.measured, MeasuredPoints)
        views.append(replace(view, measured=MeasuredPoints(view.measured.ids, view.measured.points_mm / 1000)))
    assert codes(solve_hand_eye(replace(problem, views=tuple(views)))) == ["points-in-metres"]


@pytest.mark.slow
@pytest.mark.parametrize("setup", SETUPS)
def test_a_covariance_that_is_too_small_does_not_make_x_too_sure(setup: Setup) -> None:
    """Errors five times as large as their covariance: the excess is found."""
    squares = []
    for seed in range(4):
        cell = measured_cell(np.random.default_rng(seed), 18, tracker(0.1, 0.5), setup=setup)
        said = np.diag(np.repeat([np.radians(0.02), 0.1], 3) ** 2)
        views = [
            replace(view, measured=MeasuredPose(view.measured.camera_T_target, said))
            for view in cell.problem.views
            if isinstance(view.measured, MeasuredPose)
        ]
        solution = solve_hand_eye(replace(cell.problem, views=tuple(views)))
        assert solution.mount_T_camera is not None
        assert solution.uncertainty is not None
        error = cell.error(solution.mount_T_camera)
        squares.append(error @ np.linalg.solve(solution.uncertainty.covariance, error) / 6)
    assert np.mean(squares) < 3


def test_a_wrong_view_and_wrong_points_are_left_out() -> None:
    cell = measured_cell(np.random.default_rng(5), 12, points())
    views = list(cell.problem.views)
    views[3] = views[3].standing(base_T_flange=views[3].base_T_flange @ transform(np.eye(3), [40.0, 0.0, 0.0]))
    for place in (6, 7):
        measured = views[place].measured
        assert isinstance(measured, MeasuredPoints)
        damaged = measured.points_mm.copy()
        damaged[[5, 40]] += [0.0, 0.0, 60.0]
        views[place] = replace(views[place], measured=MeasuredPoints(measured.ids, damaged))
    solution = solve_hand_eye(replace(cell.problem, views=tuple(views)))

    assert [view.index for view in solution.views if view.status == "rejected"] == [3]
    assert "4 points" in next(found.message for found in solution.findings if found.code == "points-left-out")
    assert solution.mount_T_camera is not None
    assert np.linalg.norm(cell.error(solution.mount_T_camera)[3:]) < 1.0


def test_points_that_cannot_be_used_are_refused_with_the_reason() -> None:
    problem = measured_cell(np.random.default_rng(5), 10, points()).problem
    views = list(problem.views)
    row, two, lost = np.arange(11), np.arange(2), np.full((4, 3), np.nan)
    for place, (ids, taken) in enumerate(((row, row), (two, two), (np.arange(4), None), (np.arange(4) + 86, row[:4]))):
        measured = views[place].measured
        assert isinstance(measured, MeasuredPoints)
        there = lost if taken is None else measured.points_mm[taken]
        views[place] = replace(views[place], measured=MeasuredPoints(ids, there))
    solution = solve_hand_eye(replace(problem, views=tuple(views)))
    reasons = [view.reason for view in solution.views][:4]
    assert reasons == ["points-on-a-line", "too-few-points", "points-damaged", "corner-id-unknown"]
    assert solution.mount_T_camera is not None


def test_motions_that_do_not_determine_x_are_refused() -> None:
    problem = measured_cell(np.random.default_rng(5), 10, tracker()).problem
    still = with_robot_poses(problem, lambda poses: np.repeat(poses[:1], len(poses), axis=0))
    solution = solve_hand_eye(still)
    assert solution.mount_T_camera is None
    assert codes(solution)[0] == "too-few-poses"


@pytest.mark.parametrize("size", [1e9, 1e300])
def test_poses_of_no_cell_leave_nothing_to_solve(size: float) -> None:
    problem = measured_cell(np.random.default_rng(3), 6, tracker()).problem
    poses = [transform(view.base_T_flange[:3, :3], [size, 0.0, 0.0]) for view in problem.views]
    views = tuple(view.standing(base_T_flange=pose) for view, pose in zip(problem.views, poses, strict=True))
    solution = solve_hand_eye(replace(problem, views=views))
    assert solution.mount_T_camera is None
    assert [finding.code for finding in solution.findings] == ["too-few-poses"]
    assert {view.reason for view in solution.views} != {None}


def test_a_registered_point_is_uncertain_by_the_lengths_of_the_camera() -> None:
    """The camera's poses are long by a share that hardly shows, and deep by another; X takes up what both shift."""
    seen_mm, squares = np.array([[0.0, 0.0, 700.0]]), []
    for seed in range(8):
        rng = np.random.default_rng([77, seed])
        cell = measured_cell(rng, 10, tracker())
        factor, depth = 1 + 1e-3 * rng.standard_normal(2)
        solution = solve_hand_eye(with_camera_poses(with_camera_poses(cell.problem, longer(factor)), deeper(depth)))
        assert solution.mount_T_camera is not None and solution.uncertainty is not None
        scale = solution.uncertainty.arm_scale
        assert scale is not None
        off = map_points(solution.mount_T_camera, seen_mm) - map_points(
            cell.mount_T_camera, seen_mm / factor / [1.0, 1.0, depth]
        )
        by_x = point_sigmas_mm(solution.uncertainty.covariance, seen_mm)[0] ** 2
        squares.append(np.sum(off**2) / (by_x + scale_variance_mm2(scale, seen_mm[0])))
    assert 0.4 < np.mean(squares) < 1.7

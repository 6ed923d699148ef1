"""The points that matter: their uncertainty agrees with errors drawn at random, and the worst one counts."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.likelihood.mapped_points import at_points, box_points, point_sigmas_mm
from calibration.problem import Problem, Setup
from calibration.solution import NamedPoint, Solution
from calibration.transforms import Array, inverse, map_points, transform_from_vector
from tests.simulated.spoiled_sessions import solved_session

PROBLEM, SOLVED = solved_session()


def drawn_errors_mm(solution: Solution, point_mm: Array, count: int = 4000) -> Array:
    """Errors (count,) of a point of the camera's frame, mapped through X with errors as the covariance says."""
    assert solution.mount_T_camera is not None
    assert solution.uncertainty is not None
    steps = np.random.default_rng(1).multivariate_normal(np.zeros(6), solution.uncertainty.covariance, count)
    moved = np.array([map_points(transform_from_vector(step), point_mm[None])[0] for step in steps])
    return np.asarray(np.linalg.norm(moved - point_mm, axis=1))


def test_the_standard_deviation_is_that_of_errors_drawn_at_random() -> None:
    point_mm = np.array([120.0, -80.0, 600.0])
    assert SOLVED.uncertainty is not None
    sigma_mm = point_sigmas_mm(SOLVED.uncertainty.covariance, point_mm[None])[0]
    errors_mm = drawn_errors_mm(SOLVED, point_mm)
    assert np.sqrt(np.mean(errors_mm**2)) == pytest.approx(sigma_mm, rel=0.05)
    assert np.mean(errors_mm < 2 * sigma_mm) > 0.95


def test_without_any_the_working_volume_counts() -> None:
    assert SOLVED.uncertainty is not None
    points = SOLVED.uncertainty.points
    assert len({point.name for point in points}) == 27
    rms_mm = np.sqrt(np.mean([point.sigma_mm**2 for point in points]))
    assert rms_mm == pytest.approx(SOLVED.uncertainty.point_mm)
    assert SOLVED.uncertainty.worst_point.sigma_mm > SOLVED.uncertainty.point_mm
    assert at_points(PROBLEM, SOLVED, ()) is SOLVED


def test_a_point_of_the_camera_is_evaluated_where_it_is() -> None:
    near, far = (NamedPoint(name, "camera", (0.0, 0.0, z)) for name, z in (("near", 100.0), ("far", 5000.0)))
    at = at_points(PROBLEM, SOLVED, (near, far)).uncertainty
    assert at is not None
    assert at.worst_point.name == "far"
    assert at.points[0].sigma_mm == point_sigmas_mm(at.covariance, np.array([near.position_mm]))[0]


@pytest.mark.parametrize("setup", ["eye-in-hand", "eye-to-hand"])
def test_a_point_of_the_base_is_evaluated_where_the_camera_saw_it(setup: Setup) -> None:
    problem: Problem = replace(PROBLEM, setup=setup)
    solution = replace(SOLVED, setup=setup)
    assert solution.mount_T_camera is not None
    anchor_T_mount = np.array([problem.anchor_T_mount(view) for view in problem.views])
    base_T_camera = (
        anchor_T_mount @ solution.mount_T_camera if setup == "eye-in-hand" else solution.mount_T_camera[None]
    )
    position_mm = map_points(base_T_camera[0], np.array([[0.0, 0.0, 600.0]]))[0]
    at = at_points(problem, solution, (NamedPoint("hinge", "base", tuple(position_mm)),)).uncertainty
    assert at is not None
    everywhere = point_sigmas_mm(at.covariance, map_points(inverse(base_T_camera), position_mm[None])[:, 0])
    assert everywhere[0] <= at.points[0].sigma_mm <= everywhere.max()


def test_no_point_of_a_box_is_worse_than_its_worst_corner() -> None:
    assert SOLVED.uncertainty is not None
    box_mm = np.array([[-300.0, -200.0, 400.0], [300.0, 250.0, 900.0]])
    corners_mm = np.array([corner.position_mm for corner in box_points(box_mm)])
    assert len(np.unique(corners_mm, axis=0)) == 8
    inside_mm = np.random.default_rng(2).uniform(*box_mm, (2000, 3))
    covariance = SOLVED.uncertainty.covariance
    assert point_sigmas_mm(covariance, inside_mm).max() <= point_sigmas_mm(covariance, corners_mm).max()

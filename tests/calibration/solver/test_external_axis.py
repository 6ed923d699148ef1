"""A track or a turntable that the controller leaves out of its poses: its axis is found with X, by the same views."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calibration.kinematics.external_axis import AxisKind, ExternalAxis
from calibration.likelihood.predicted_uncertainty import ExpectedNoise
from calibration.planning.scene_belief import ScenePrior
from calibration.problem import Setup
from calibration.solution import Solution
from calibration.solve import poses_at_zero, solve_hand_eye
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform, vector_from_transform
from calibration.verdict import DEFAULT_VERDICT_LIMITS, judge
from tests.simulated.external_axes import AxisCell, axes_at, axis_cell, direction_off_deg
from tests.support.cases import seeds

KINDS = ("track", "turntable")
POINT = np.array([[30.0, -20.0, 550.0]])


@cache
def solved(kind: AxisKind, seed: int, setup: Setup = "eye-in-hand") -> tuple[AxisCell, Solution]:
    cell = axis_cell(kind, seed, setup=setup)
    return cell, solve_hand_eye(cell.problem)


def normalised_error(given: AxisCell, solution: Solution) -> float:
    """Mean square of the errors of X and the axis, in standard deviations."""
    found = solution.external_axis
    assert found is not None and solution.mount_T_camera is not None
    by = found.axis.by_vectors()
    of_axis = np.concatenate([found.axis.direction - given.axis.direction, found.axis.point_mm - given.axis.point_mm])
    of_x = vector_from_transform(inverse(given.cell.mount_T_camera) @ solution.mount_T_camera)
    error = np.concatenate([of_x, by.T @ of_axis])
    spread = np.zeros((len(error), 12))
    spread[:6, :6], spread[6:, 6:] = np.eye(6), by.T
    return float(error @ np.linalg.solve(spread @ found.covariance @ spread.T, error)) / len(error)


def registered(axis: ExternalAxis, X: Array, base_T_flange: Array, reading: float) -> Array:
    """A point before the camera, in the base at zero."""
    return map_points(axis.at_zero(base_T_flange, reading) @ X, POINT)[0]


@pytest.mark.parametrize("kind", KINDS)
def test_a_point_registered_anywhere_along_the_axis_is_where_it_is(kind: AxisKind) -> None:
    given, solution = solved(kind, 1)
    found = solution.external_axis
    assert found is not None and solution.mount_T_camera is not None
    assert direction_off_deg(found.axis.direction, given.axis.direction) < 0.01
    drawn = given.problem.external_axis
    assert drawn is not None
    assert direction_off_deg(drawn.direction, given.axis.direction) > 0.2
    off = []
    for view, at_zero in zip(given.problem.views, given.cell.base_T_flange, strict=True):
        reading = given.axis.reading(view.stance.external_axes) or 0.0
        stands = inverse(given.axis.motion(reading)) @ at_zero
        truth = registered(given.axis, given.cell.mount_T_camera, stands, reading)
        off.append(np.linalg.norm(registered(found.axis, solution.mount_T_camera, stands, reading) - truth))
    assert max(off) < found.expanded_mm < 0.4
    verdict = judge(poses_at_zero(given.problem, solution), solution)
    assert verdict.accepted
    assert [finding.code for finding in verdict.findings] == ["external-axis"]


def test_a_camera_beside_the_robot_sees_the_track_as_well() -> None:
    given, solution = solved("track", 1, "eye-to-hand")
    assert normalised_error(given, solution) < 2.2  # chi-square of eight: 97.5 %


@pytest.mark.slow  # ten solutions of each kind
@pytest.mark.parametrize("kind", KINDS)
def test_the_stated_uncertainty_is_right(kind: AxisKind) -> None:
    errors = [normalised_error(*solved(kind, seed)) for seed in seeds(10)]
    print(f"normalised error of {kind}, mean square of {len(errors)} sessions: {np.mean(errors):.2f}")
    assert 0.6 < np.mean(errors) < 1.4  # 80 values by night: 1 +- 0.16


def test_a_view_with_a_mistyped_reading_is_left_out() -> None:
    given = axis_cell("track", 2, views=9)
    views = list(given.problem.views)
    reading = given.axis.reading(views[4].stance.external_axes) or 0.0
    views[4] = views[4].standing(external_axes=axes_at(given.axis, reading + 30.0))
    solution = solve_hand_eye(replace(given.problem, views=tuple(views)))
    assert [view.index for view in solution.views if view.status == "rejected"] == [4]
    assert solution.external_axis is not None
    assert direction_off_deg(solution.external_axis.axis.direction, given.axis.direction) < 0.01


@pytest.mark.parametrize("kind", KINDS)
def test_one_position_is_refused_with_what_to_do(kind: AxisKind) -> None:
    given = axis_cell(kind, 1)
    views = tuple(view.standing(external_axes=axes_at(given.axis, 0.1)) for view in given.problem.views)
    solution = solve_hand_eye(replace(given.problem, views=views))
    assert solution.mount_T_camera is None
    assert solution.findings[0].code == "axis-not-moved"
    assert f"at two {'positions' if kind == 'track' else 'angles'} of the {kind}" in solution.findings[0].fix


def test_a_direction_with_the_wrong_sign_is_turned_round_and_warned_of() -> None:
    given, right = solved("turntable", 1)
    drawn = given.problem.external_axis
    assert drawn is not None and right.external_axis is not None
    problem = replace(given.problem, external_axis=replace(drawn, direction=-drawn.direction))
    solution = solve_hand_eye(problem)
    assert solution.external_axis is not None
    assert direction_off_deg(solution.external_axis.axis.direction, right.external_axis.axis.direction) < 1e-3
    assert solution.external_axis.axis.direction @ right.external_axis.axis.direction > 0
    (finding,) = judge(poses_at_zero(problem, solution), solution).findings
    assert (finding.severity, finding.code) == ("warning", "external-axis")
    assert "correct direction" in finding.fix


def test_a_looser_axis_than_the_tolerance_allows_is_refused() -> None:
    given, solution = solved("track", 1)
    verdict = judge(
        poses_at_zero(given.problem, solution), solution, DEFAULT_VERDICT_LIMITS.with_tolerance(0.2)
    )  # U of X alone is 0.22 mm
    assert not verdict.accepted
    assert "move-the-track" in {getattr(finding.fix, "id", "") for finding in verdict.findings}


def test_zero_is_the_reading_at_which_nothing_moves() -> None:
    axis = ExternalAxis("track", 1, np.array([0.0, 1.0, 0.0]), np.zeros(3), zero=5000.0)
    assert np.array_equal(axis.motion(5000.0), np.eye(4))
    assert np.array_equal(axis.motion(5250.0)[:3, 3], [0.0, 250.0, 0.0])


def test_a_point_of_a_turned_table_is_mapped_to_where_it_was() -> None:
    axis = ExternalAxis("turntable", 1, np.array([0.0, 0.0, 1.0]), np.array([1000.0, 100.0, 0.0]))
    quarter_turn_on = np.array([[900.0, 350.0, 80.0]])
    assert np.allclose(map_points(axis.motion(np.pi / 2), quarter_turn_on), [[1250.0, 200.0, 80.0]])


def test_the_target_is_planned_for_where_it_is_seen_from_the_moved_base() -> None:
    given = axis_cell("track", 1).problem
    axis = ExternalAxis("track", 1, np.array([0.0, 1.0, 0.0]), np.zeros(3))
    guess = ScenePrior("eye-in-hand", given.target, None, np.eye(4), np.eye(4), ExpectedNoise(0.05, 1e-4, 0.05))
    there = guess.at_reading(axis, 500.0)
    assert there.mount_T_camera is guess.mount_T_camera
    assert there.anchor_T_target is not None
    assert np.array_equal(there.anchor_T_target[:3, 3], [0.0, -500.0, 0.0])


def test_the_derivatives_are_those_of_the_motion() -> None:
    step, pose = 1e-4, transform(rotation_from_vector([0.3, -0.2, 0.5]), [900.0, 100.0, 400.0])
    axis = ExternalAxis("turntable", 1, np.array([0.0, 0.6, 0.8]), np.array([1000.0, 30.0, 0.0]))
    at_zero = axis.at_zero(pose, 0.7)
    jacobian = axis.jacobian(at_zero[None], np.array([0.7]))[0]
    for place in range(4):
        moved = axis.apply_step(step * np.eye(4)[place]).at_zero(pose, 0.7)
        assert np.allclose(
            vector_from_transform(inverse(at_zero) @ moved) / step, jacobian[:, place], rtol=1e-3, atol=1e-3
        )

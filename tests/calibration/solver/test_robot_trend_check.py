"""Errors that all views share: told and taken up where the data insist, in the uncertainty where they cannot tell."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.problem import Problem
from calibration.solve import estimate_session, solve_hand_eye
from calibration.transforms import inverse, rotation_from_vector, transform, vector_from_rotation
from tests.simulated.sessions import Cell, CellNoise
from tests.simulated.spoiled_sessions import Array, cell, error_of

pytestmark = pytest.mark.slow

SHARP = CellNoise(0.05, float(np.radians(0.01)), 0.05)


def with_centre_off(truth: Cell, shift_px: list[float]) -> Problem:
    """The given camera's principal point is stated wrongly by so much."""
    camera = truth.problem.camera
    assert camera is not None
    matrix = camera.matrix.copy()
    matrix[:2, 2] += shift_px
    return replace(truth.problem, camera=replace(camera, matrix=matrix))


def error_vector(mount_T_camera: Array | None, truth: Cell) -> Array:
    """[rotation rad, translation mm] in the camera's frame."""
    assert mount_T_camera is not None
    off = inverse(truth.mount_T_camera) @ mount_T_camera
    return np.concatenate([vector_from_rotation(off[:3, :3]), off[:3, 3]])


def test_a_principal_point_that_is_off_is_found_reported_and_corrected() -> None:
    truth = cell(41, 20, SHARP)
    solution = solve_hand_eye(with_centre_off(truth, [1.5, -1.0]))
    finding = next(f for f in solution.findings if f.code == "principal-point-off")
    assert finding.severity == "info" and "px" in finding.message
    assert solution.camera is not None and solution.camera_source == "estimated"
    assert np.allclose(solution.camera.matrix[:2, 2], truth.camera.matrix[:2, 2], atol=0.5)
    # One pixel and a half is a rotation of X by 0.036 degrees.
    assert error_of(solution.mount_T_camera, truth)[1] < 0.015


@pytest.mark.parametrize("shift_px", [0.3, 1.0])
def test_errors_are_as_large_as_stated_though_the_principal_point_is_off(shift_px: float) -> None:
    normalised = []
    for seed in range(24):
        truth = cell(600 + seed, (5, 10, 20)[seed % 3], CellNoise(0.1, float(np.radians(0.02)), 0.2))
        turn = 2 * np.pi * seed / 24
        problem = with_centre_off(truth, [shift_px * np.cos(turn), shift_px * np.sin(turn)])
        best = estimate_session(problem).best
        error = error_vector(best.chain.mount_T_camera, truth)
        normalised.append(error / np.sqrt(np.diagonal(best.step.covariance)[:6]))
    assert 0.75 < float(np.sqrt(np.mean(np.square(normalised)))) < 1.35


def with_robot_trend(truth: Cell, rng: np.random.Generator, rotation_rad: float, translation_mm: float) -> Problem:
    """The robot's errors follow the place, as those of a badly known arm do, and are not zero amid its poses.

    X takes up what is alike in all views.
    """
    places = truth.base_T_flange[:, :3, 3]
    where = (places - places.mean(axis=0)) / np.sqrt(np.mean(np.sum((places - places.mean(axis=0)) ** 2, axis=1)))
    slopes, alike = rng.standard_normal((3, 6)), rng.standard_normal(6)
    follow = (where @ slopes + alike) * np.repeat([rotation_rad, translation_mm], 3)
    errors = transform(rotation_from_vector(follow[:, :3]), follow[:, 3:])
    views = [
        view.standing(base_T_flange=view.base_T_flange @ error)
        for view, error in zip(truth.problem.views, errors, strict=True)
    ]
    return replace(truth.problem, views=tuple(views))


def test_errors_that_follow_the_robots_pose_are_reported_and_counted() -> None:
    told, normalised = 0, []
    for seed in range(5):
        truth = cell(700 + seed, 30, CellNoise(0.05, float(np.radians(0.003)), 0.02))
        problem = with_robot_trend(truth, np.random.default_rng(seed), float(np.radians(0.02)), 0.2)
        selection = estimate_session(problem).selection
        told += selection.best.model.trend_terms > 0
        error = error_vector(selection.best.chain.mount_T_camera, truth)
        normalised.append(error / np.sqrt(np.diagonal(selection.best.step.covariance)[:6]))
    assert told == 5
    assert 0.6 < float(np.sqrt(np.mean(np.square(normalised)))) < 1.5


def test_a_robots_trend_is_said() -> None:
    truth = cell(700, 30, CellNoise(0.05, float(np.radians(0.003)), 0.02))
    problem = with_robot_trend(truth, np.random.default_rng(0), float(np.radians(0.02)), 0.2)
    finding = next(f for f in solve_hand_eye(problem).findings if f.code == "robot-trend")
    assert "follow the pose" in finding.message


def test_without_such_errors_nothing_is_doubted() -> None:
    for seed in range(30):
        truth = cell(800 + seed, (5, 10, 20)[seed % 3], SHARP, camera_given=seed % 4 > 0)
        best = estimate_session(truth.problem).best
        assert not best.model.trend_terms, seed
        assert best.nuisances is not None
        assert not best.differs([best.nuisances.size]), seed

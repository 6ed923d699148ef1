"""Photographs and rendered images that nobody made for this solver."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.camera import CameraModel
from calibration.problem import Problem
from calibration.solution import Solution
from calibration.solve import solve_hand_eye
from calibration.targets import Chessboard
from calibration.transforms import Array, difference, transform_from_quaternion
from daemon.sessions.session_reader import load_problem, open_session
from tests.simulated.faults import moved

pytestmark = [pytest.mark.data, pytest.mark.timeout(900), pytest.mark.slow]


def solved(folder: Path) -> Solution:
    return solve_hand_eye(load_problem(open_session(folder)))


@pytest.mark.parametrize(("name", "base_error_mm"), [("ic_charuco", 1.6), ("ic_circles", 7.7)])
def test_views_left_out_are_predicted(real_data: Path, name: str, base_error_mm: float) -> None:
    held = solved(real_data / name).hold_out
    assert held is not None
    assert held.base_error_mm <= base_error_mm


@pytest.fixture(scope="module")
def rendered(real_data: Path) -> Problem:
    return load_problem(open_session(real_data / "metric_1"))


@pytest.fixture(scope="module")
def clean(rendered: Problem) -> Solution:
    return solve_hand_eye(rendered)


@pytest.fixture(scope="module")
def agreeing(rendered: Problem, clean: Solution) -> Problem:
    """The views that agree, with the camera that fits."""
    used = {view.index for view in clean.views if view.status != "rejected"}
    return replace(rendered, views=tuple(view for view in rendered.views if view.index in used), camera=clean.camera)


@pytest.fixture(scope="module")
def truth(real_data: Path) -> Array:
    pose = json.loads((real_data / "metric_1" / "truth.json").read_text())["base_T_camera"]
    return transform_from_quaternion(pose["translation_mm"], pose["quaternion_wxyz"])


def test_the_rendered_cell_is_near_its_truth(clean: Solution, truth: Array) -> None:
    assert clean.mount_T_camera is not None and clean.uncertainty is not None
    translation_mm, rotation_rad = difference(truth, clean.mount_T_camera)
    assert np.degrees(rotation_rad) <= 0.06
    # Its principal point is given a pixel off in both directions.
    assert "principal-point-off" in {finding.code for finding in clean.findings}
    assert translation_mm < 3 * np.linalg.norm(clean.uncertainty.translation_mm)


@pytest.mark.xfail(strict=True, reason="3.1 deviations along the base's x: all corners err alike, as no residual shows")
def test_the_rendered_cell_is_within_three_deviations_along_each_axis(clean: Solution, truth: Array) -> None:
    assert clean.mount_T_camera is not None and clean.uncertainty is not None
    assert np.all(np.abs(truth - clean.mount_T_camera)[:3, 3] <= 3 * clean.uncertainty.translation_mm)


@pytest.mark.parametrize(("first", "factor"), [(17, 2.0), (48, 0.7), (40, 2.0)])
def test_a_lens_is_another_one_although_other_points_of_the_board_fit(
    agreeing: Problem, first: int, factor: float
) -> None:
    """Twenty views of a small board leave 0.06 px with its points moved by 0.5 mm, and 0.02 px with the right lens."""
    assert agreeing.camera is not None
    matrix = np.diag([factor, factor, 1.0]) @ agreeing.camera.matrix
    matrix[:2, 2] = agreeing.camera.matrix[:2, 2] + (-12.0, 20.0)
    camera = CameraModel(matrix, agreeing.camera.distortion, agreeing.camera.image_size)
    other = replace(agreeing, views=agreeing.views[first : first + 20], camera=camera)
    assert "intrinsics-do-not-fit" in {finding.code for finding in solve_hand_eye(other).findings}


def test_a_move_is_named_before_the_size_that_seems_to_follow_from_it(agreeing: Problem) -> None:
    part = replace(agreeing, views=agreeing.views[33:53])
    slipped = moved(part, np.random.default_rng(1), "base").at(1.5).problem
    both = ("camera-moved", "target-scale")
    assert tuple(finding.code for finding in solve_hand_eye(slipped).findings if finding.code in both) == both


def test_a_board_that_would_have_to_be_bent_is_another_board(agreeing: Problem) -> None:
    """In 20 of these views five columns fit a board whose points are 15 mm out of its plane."""
    described = replace(agreeing, views=agreeing.views[40:60], target=Chessboard(5, 3, 50.0))
    assert "target-not-as-described" in {finding.code for finding in solve_hand_eye(described).findings}

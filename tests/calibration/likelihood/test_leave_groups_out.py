"""Uncertainty by leaving out groups of views: as expected under the model, larger where neighbours share an error."""

import numpy as np
import pytest

from calibration.likelihood.leave_out import split
from calibration.solve import solve_hand_eye
from calibration.verdict import judge
from tests.simulated.imperfect_sessions import IMPERFECTIONS, NOTHING, imperfect_cell


@pytest.mark.parametrize(("views", "count"), [(8, 4), (9, 4), (40, 8), (23, 23)])
def test_every_view_is_in_one_group_and_the_groups_are_about_as_large(views: int, count: int) -> None:
    groups = split(np.random.default_rng(views).standard_normal((views, 3)), count)
    assert sorted(np.concatenate(groups).tolist()) == list(range(views))
    sizes = [len(group) for group in groups]
    assert len(groups) == count and min(sizes) >= 1 and max(sizes) <= 2 * min(sizes) + 1


def test_neighbours_are_in_one_group() -> None:
    places = np.array([[0.0, 0], [10, 0], [0, 1], [10, 1], [0, 2], [10, 2]])
    assert {tuple(sorted(group.tolist())) for group in split(places, 2)} == {(0, 2, 4), (1, 3, 5)}


@pytest.mark.slow
def test_under_the_model_the_ratio_is_one_in_the_mean() -> None:
    ratios, weights = [], []
    for number in range(16):
        left_out = solve_hand_eye(imperfect_cell((11, number), NOTHING).cell.problem).leave_out
        assert left_out is not None
        ratios.append(left_out.ratio)
        weights.append(left_out.inflation)
    # the largest of three groupings each
    assert 0.7 < float(np.mean(ratios)) < 1.8
    assert float(np.median(weights)) == 1.0  # a ratio counts only where it is significant


@pytest.mark.slow
def test_a_lens_beyond_the_model_is_seen_by_leaving_out_parts_of_the_image() -> None:
    imperfect = imperfect_cell((12, 3), IMPERFECTIONS["small board, many views"])
    problem = imperfect.cell.problem
    solution = solve_hand_eye(problem)
    left_out = solution.leave_out
    assert left_out is not None and left_out.share > 0.9 and left_out.ratio > 2
    assert "leave-out-larger" in [finding.code for finding in judge(problem, solution).findings]
    assert solution.uncertainty is not None
    assert imperfect.point_error_mm(solution) < 3 * solution.uncertainty.point_mm


def test_few_views_leave_none_out() -> None:
    problem = imperfect_cell((11, 0), NOTHING).cell.problem
    few = type(problem)(problem.setup, problem.target, problem.camera, problem.image_size, problem.views[:6])
    assert solve_hand_eye(few).leave_out is None

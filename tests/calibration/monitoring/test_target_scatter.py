"""Tab. 1: points in base coordinates, and what an error of X does to their scatter."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.documents.calibration import calibration_document
from calibration.documents.pose import PoseDocument
from calibration.documents.target import document_of_target
from calibration.kinematics.stance import Stance
from calibration.monitoring.target_scatter import VerificationError, verify
from calibration.problem import Detection, Problem, View
from calibration.solve import solve_hand_eye
from calibration.transforms import inverse, map_points, rotation_from_vector, transform
from calibration.verdict import VerdictLimits, judge
from daemon.api.plain_text import run_text
from daemon.model.records import RunRecord
from daemon.model.run_states import RunState
from daemon.runs.verification_run import document_of
from tests.daemon.calibrations import a_calibration
from tests.daemon.fakes import BASE_T_TARGET, BOARD, CAMERA, FLANGE_T_CAMERA, poses_around_the_target
from tests.simulated.described_wrongly import LOW, Wrong, wrong_session


def a_problem(views: int = 3, seen: int = 88) -> Problem:
    """Perfect pixels of the board; the k-th view sees `seen` points from the k-th on."""
    made = []
    for index, base_T_flange in enumerate(poses_around_the_target(5)[:views]):
        camera_T_target = inverse(base_T_flange @ FLANGE_T_CAMERA) @ BASE_T_TARGET
        ids = np.arange(88)[index * (88 - seen) :][:seen]
        pixels = CAMERA.project(map_points(camera_T_target, BOARD.points_mm[ids]))
        made.append(View(index, Stance(base_T_flange), Detection(ids, pixels)))
    return Problem("eye-in-hand", BOARD, CAMERA, CAMERA.image_size, tuple(made))


def test_a_true_calibration_puts_every_point_where_it_is_from_everywhere() -> None:
    found = verify(a_problem(), a_calibration("c"))
    truth = map_points(BASE_T_TARGET, BOARD.points_mm)
    np.testing.assert_allclose(found.points_mm, np.broadcast_to(truth, (3, 88, 3)), atol=1e-5)
    np.testing.assert_allclose(found.sigma_mm, 0, atol=1e-5)
    assert found.stations == (1, 2, 3)


def test_a_wrong_calibration_shows_in_sigma() -> None:
    wrong = transform(rotation_from_vector([0, 0.003, 0]), [0.0, 2.0, 0]) @ FLANGE_T_CAMERA
    calibration = a_calibration("c").model_copy(update={"flange_T_camera": PoseDocument.of(wrong)})
    found = verify(a_problem(), calibration)
    expected = [
        map_points(view.base_T_flange @ wrong @ inverse(view.base_T_flange @ FLANGE_T_CAMERA) @ BASE_T_TARGET,
                   BOARD.points_mm) for view in a_problem().views
    ]  # fmt: skip
    np.testing.assert_allclose(found.points_mm, expected, atol=1e-4)
    np.testing.assert_allclose(found.sigma_per_point_mm, np.std(expected, axis=0, ddof=1), atol=1e-4)
    assert found.sigma_mm.max() > 0.5


def test_only_points_seen_from_every_position_are_compared() -> None:
    found = verify(a_problem(seen=80), a_calibration("c"))
    assert found.ids.tolist() == list(range(16, 80))


def test_the_cross_spans_the_target() -> None:
    found = verify(a_problem(), a_calibration("c"))
    assert found.ids[found.cross()].tolist() == [0, 10, 38, 77, 87] or set(found.ids[found.cross()]) >= {0, 10, 77, 87}


@pytest.mark.parametrize("problem", [a_problem(views=1), a_problem(seen=30)])
def test_positions_that_share_nothing_are_reported(problem: Problem) -> None:
    with pytest.raises(VerificationError, match="share no point"):
        verify(problem, a_calibration("c"))


def test_positions_at_one_place_are_compared_too() -> None:
    problem, rng = a_problem(views=1), np.random.default_rng(0)
    first = problem.views[0]
    assert first.detection is not None
    again = Detection(first.detection.ids, first.detection.corners_px + rng.normal(0, 0.05, (88, 2)))
    found = verify(replace(problem, views=(first, replace(first, index=1, detection=again))), a_calibration("c"))
    assert found.stations == (1, 2)


def test_the_table_in_words_is_the_seeds() -> None:
    found = verify(a_problem(), a_calibration("cal-7"))
    result = {"calibration_id": "cal-7", "verification": document_of(found, a_calibration("cal-7"), VerdictLimits())}
    run = RunRecord("r", "verify", RunState.FINISHED, 3, 3, "", "", result=result)
    words = run_text(run)
    for part in ("(a) Position 1", "(b) Position 2", "(c) Position 3", "sigma x", "sigma z", "over all 88 points"):
        assert part in words
    x, y, z = map_points(BASE_T_TARGET, BOARD.points_mm[:1])[0]
    assert all(f"{value:.4f}" in words for value in (x, y, z))


@pytest.mark.parametrize("wrong", [Wrong(size=0.995), Wrong(focal=1.005)], ids=["print", "lens"])
def test_a_target_or_a_lens_that_is_not_as_described_is_verified_as_it_was_found(wrong: Wrong) -> None:
    """Eight views calibrate, three more verify: by the description the points scatter by 1 to 3 mm."""
    problem = wrong_session(np.random.default_rng(4), 11, wrong, LOW, "eye-in-hand", "planned").problem
    taken, later = replace(problem, views=problem.views[:8]), replace(problem, views=problem.views[8:])
    solution = solve_hand_eye(taken)
    made = {"calibration_id": "c", "created_at": "now", "software": "test", "target": problem.target}
    document = calibration_document(solution, judge(taken, solution), **made)
    found = verify(replace(later, camera=document.camera.camera()), document)
    assert 2 * found.sigma_per_point_mm.max() < 0.6
    as_described = document.model_copy(update={"target_scale": 1.0})
    assert 2 * verify(later, as_described).sigma_per_point_mm.max() > 1.0


def test_another_target_is_verified_as_it_is_described() -> None:
    document = a_calibration("c").model_copy(update={"target": None, "target_scale": 0.9})
    described = document_of_target(BOARD)
    assert document.scale_of(BOARD) == 1.0, "which target it was made with is not known"
    assert document.model_copy(update={"target": described}).scale_of(BOARD) == 0.9
    assert document.model_copy(update={"target": described}).scale_of(replace(BOARD, pitch_mm=21.0)) == 1.0

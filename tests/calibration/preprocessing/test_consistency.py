"""What is wrong with the input is found, named, and never silently repaired."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calibration.observations.observations import observe, repetitions
from calibration.problem import Detection, Problem, View
from calibration.solution import Solution
from calibration.solve import estimate_session, solve_hand_eye
from calibration.solver.solution_builder import build_solution
from calibration.targets import Chessboard
from calibration.transforms import Array, inverse, transform
from calibration.verdict import judge
from tests.simulated.sessions import BOARD, Cell, CellNoise, observed
from tests.simulated.spoiled_sessions import (
    ORDINARY,
    board_turned,
    cell,
    error_of,
    shifted,
    turned,
    with_corners,
    with_view,
)


def codes(problem: Problem, solution: Solution) -> set[str]:
    return {finding.code for finding in judge(problem, solution).findings}


@pytest.mark.parametrize("views", [4, 8, 20])
def test_a_board_read_the_wrong_way_round_is_renumbered_and_said(views: int) -> None:
    truth = cell(1, views)
    problem = with_view(truth.problem, 2, board_turned)
    solution = solve_hand_eye(problem)
    assert [view.status for view in solution.views].count("corrected") == 1
    assert solution.views[2].reason == "board-turned"
    assert "board-turned" in codes(problem, solution)
    assert np.allclose(solution.mount_T_camera, solve_hand_eye(truth.problem).mount_T_camera, atol=1e-6)


@pytest.mark.parametrize("offset_mm", [[3.0, 0, 0], [0, 20.0, 0], [0, 0, 500.0]])
@pytest.mark.parametrize("setup", ["eye-in-hand", "eye-to-hand"])
def test_one_mistyped_pose_is_rejected_and_named(offset_mm: list[float], setup: str) -> None:
    truth = cell(2, 9, setup=setup)
    problem = with_view(truth.problem, 4, shifted(offset_mm))
    solution = solve_hand_eye(problem)
    assert [(view.index, view.reason) for view in solution.views if view.status == "rejected"] == [
        (4, "pose-disagrees")
    ]
    assert error_of(solution.mount_T_camera, truth)[0] < 0.5
    finding = next(f for f in solution.findings if f.code == "pose-disagrees")
    assert finding.message.startswith("picture 5 not used")


@pytest.mark.parametrize("views", [4, 5, 6])
@pytest.mark.parametrize("setup", ["eye-in-hand", "eye-to-hand"])
def test_inverted_poses_of_few_views_are_not_accepted(views: int, setup: str) -> None:
    """Any three of them agree."""
    truth = cell(4, views, setup=setup)
    rows = tuple(view.standing(base_T_flange=inverse(view.base_T_flange)) for view in truth.problem.views)
    problem = replace(truth.problem, views=rows)
    assert not judge(problem, solve_hand_eye(problem)).accepted


def test_several_wildly_wrong_poses_do_not_hide_each_other() -> None:
    truth = cell(3, 15)
    problem = truth.problem
    for index, offset in ((1, 40.0), (5, -300.0), (9, 8.0), (13, 1000.0)):
        problem = with_view(problem, index, shifted([offset, offset, 0.0]))
    solution = solve_hand_eye(problem)
    assert [view.index for view in solution.views if view.status == "rejected"] == [1, 5, 9, 13]
    assert error_of(solution.mount_T_camera, truth)[0] < 0.5


@pytest.mark.parametrize("size_px", [1.0, 30.0, 2000.0])
def test_single_wrong_corners_are_left_out(size_px: float) -> None:
    truth = cell(4, 8)

    def spoil(corners: Array) -> Array:
        corners[[5, 40]] += size_px
        return corners

    problem = with_view(truth.problem, 3, with_corners(spoil))
    solution = solve_hand_eye(problem)
    assert error_of(solution.mount_T_camera, truth)[0] < 0.5
    assert solution.views[3].status == "used"
    assert "corners-left-out" in codes(problem, solution)


def test_a_picture_of_something_else_is_refused() -> None:
    truth = cell(5, 8)
    rng = np.random.default_rng(0)
    problem = with_view(truth.problem, 6, with_corners(lambda corners: rng.uniform(0, 2000, corners.shape)))
    solution = solve_hand_eye(problem)
    assert solution.views[6].status == "rejected"
    assert error_of(solution.mount_T_camera, truth)[0] < 0.5


@pytest.mark.parametrize(("scatter_px", "status"), [(0.01, "used"), (0.1, "rejected")])
def test_a_picture_that_is_only_less_exact_than_drawn_ones_is_used(scatter_px: float, status: str) -> None:
    truth = cell(5, 8, CellNoise(0.001, 0.0, 0.05))
    rng = np.random.default_rng(0)
    off = with_corners(lambda corners: corners + scatter_px * rng.standard_normal(corners.shape))
    assert solve_hand_eye(with_view(truth.problem, 6, off)).views[6].status == status


def test_a_repeated_pose_is_said() -> None:
    truth = cell(6, 6)
    last = replace(truth.problem.views[2], index=6)
    problem = replace(truth.problem, views=(*truth.problem.views, last))
    problem = with_view(problem, 6, with_corners(lambda corners: corners + 1e-3))
    assert "duplicate-poses" in codes(problem, solve_hand_eye(problem))


@pytest.mark.parametrize("times", [2, 6])
def test_pictures_of_one_station_are_no_further_views(times: int) -> None:
    """The arm errs by the same amount in all of them."""
    truth, rng = cell(6, 6), np.random.default_rng(0)
    noisy = with_corners(lambda corners: corners + 0.05 * rng.standard_normal(corners.shape))
    stations = truth.problem.views
    again = tuple(replace(noisy(view), index=6 * n + view.index) for n in range(1, times) for view in stations)
    once, often = (solve_hand_eye(replace(truth.problem, views=views)) for views in (stations, (*stations, *again)))
    assert [view.status for view in often.views] == 6 * ["used"] + len(again) * ["rejected"]
    assert once.uncertainty is not None and often.uncertainty is not None
    assert often.uncertainty.point_mm == pytest.approx(once.uncertainty.point_mm, rel=1e-6)


def _few_corners(view: View) -> View:
    """A picture in which all but a few corners are covered."""
    assert view.detection is not None
    few = [0, 1, 11, 12]
    return replace(view, detection=Detection(view.detection.ids[few], view.detection.corners_px[few]))


def _blurred(corners: Array) -> Array:
    """Nearly half of the corners in wrong places, for which the picture is refused."""
    corners[: int(0.45 * len(corners))] += np.random.default_rng(1).uniform(-40, 40, (int(0.45 * len(corners)), 2))
    return corners


@pytest.mark.parametrize("poor", [_few_corners, with_corners(_blurred)], ids=["few corners", "refused"])
@pytest.mark.parametrize("order", [1, -1], ids=["poor first", "poor last"])
def test_the_best_picture_of_a_station_counts(poor: Callable[[View], View], order: int) -> None:
    """The retake of a poor picture is used, and U is that of the good pictures alone."""
    good, rng = cell(6, 6).problem, np.random.default_rng(0)
    noisy = with_corners(lambda corners: corners + 0.05 * rng.standard_normal(corners.shape))
    bad = tuple(replace(poor(noisy(view)), index=6 + view.index) for view in good.views)
    both = solve_hand_eye(replace(good, views=(*bad, *good.views)[::order]))
    alone = solve_hand_eye(replace(good, views=good.views[::order]))
    assert {view.index for view in both.views if view.status == "used"} == set(range(6))
    assert alone.uncertainty is not None and both.uncertainty is not None
    assert both.uncertainty.point_mm == pytest.approx(alone.uncertainty.point_mm, rel=1e-6)


def _other_posture(view: View) -> View:
    return view.standing(joints_rad=np.radians([0.0, 0.0, 0.0, 180.0, -30.0, 180.0]))


@pytest.mark.parametrize(
    ("again", "used"),
    [
        ((with_corners(lambda corners: corners + 0.1),), 1),
        ((with_corners(lambda corners: corners + 100.0),), 2),
        ((with_corners(lambda corners: corners + 100.0), with_corners(lambda corners: corners + 100.1)), 2),
        ((lambda view: _other_posture(with_corners(lambda corners: corners + 0.1)(view)),), 2),
    ],
    ids=["as before", "target moved", "target moved, and twice", "another posture"],
)
def test_what_another_picture_of_a_station_is(again: tuple[Callable[[View], View], ...], used: int) -> None:
    problem = cell(6, 6).problem
    problem = with_view(problem, 0, lambda view: view.standing(joints_rad=np.radians([0.0, 0, 0, 0, 30, 0])))
    more = tuple(replace(change(problem.views[0]), index=6 + n) for n, change in enumerate(again))
    seen, _ = observe(replace(problem, views=(*problem.views, *more)))
    left_out = repetitions(replace(problem, views=(*problem.views, *more)), seen)
    assert len(seen) - len(left_out) == 5 + used


def test_an_image_given_twice_counts_once() -> None:
    truth = cell(6, 6)
    problem = with_view(truth.problem, 4, lambda view: replace(view, detection=truth.problem.views[1].detection))
    solution = solve_hand_eye(problem)
    assert solution.views[4].reason == "image-repeated"
    (said,) = (finding for finding in solution.findings if finding.code == "image-repeated")
    assert said.severity == "warning" and "picture 5 not used: the image is that of picture 2 again" in said.message


def test_one_image_for_all_views_is_refused_by_name() -> None:
    problem = cell(6, 6).problem
    frozen = replace(
        problem, views=tuple(replace(view, detection=problem.views[0].detection) for view in problem.views)
    )
    assert "images-repeated" in codes(frozen, solve_hand_eye(frozen))


def test_a_target_printed_too_large_is_measured_by_the_robot() -> None:
    truth = cell(7, 15)
    problem = replace(truth.problem, target=Chessboard(BOARD.columns, BOARD.rows, BOARD.pitch_mm / 1.004))
    solution = solve_hand_eye(problem)
    finding = next(f for f in judge(problem, solution).findings if f.code == "target-scale")
    assert "% larger" in finding.message
    assert finding.severity == "warning"
    assert error_of(solution.mount_T_camera, truth)[0] < 0.3


def test_a_wrong_pitch_is_not_accepted() -> None:
    truth = cell(7, 15)
    problem = replace(truth.problem, target=Chessboard(BOARD.columns, BOARD.rows, BOARD.pitch_mm * 0.9))
    verdict = judge(problem, solve_hand_eye(problem))
    assert not verdict.accepted
    finding = next(f for f in verdict.findings if f.code == "target-scale")
    assert finding.severity == "error"
    assert "larger" in finding.message


def test_a_bowed_target_is_estimated_with_the_rest() -> None:
    truth = cell(8, 15, CellNoise(0.03, ORDINARY.robot_rotation_rad, ORDINARY.robot_translation_mm))
    bowed = _seen_bowed(truth, height_mm=0.8)
    solution = solve_hand_eye(bowed)
    assert "target-not-as-drawn" in codes(bowed, solution)
    assert solution.noise.image_px == pytest.approx(0.03, rel=0.2)


def _seen_bowed(truth: Cell, height_mm: float) -> Problem:
    """The same views of a board whose middle stands out of its plane."""
    from calibration.transforms import map_points

    points = BOARD.points_mm.copy()
    off_centre = (points[:, :2] - points[:, :2].mean(axis=0)) / points[:, :2].max()
    points[:, 2] = height_mm * (1 - 4 * np.sum(off_centre**2, axis=1))
    rng = np.random.default_rng(0)
    views = []
    for view, pose in zip(truth.problem.views, truth.base_T_flange, strict=True):
        seen = inverse(pose @ truth.mount_T_camera) @ truth.anchor_T_target
        pixels = truth.camera.project(map_points(seen, points))
        views.append(
            replace(
                view, detection=Detection(np.arange(len(points)), pixels + 0.03 * rng.standard_normal(pixels.shape))
            )
        )
    return replace(truth.problem, views=tuple(views))


@pytest.mark.slow
def test_clean_sessions_raise_no_alarm() -> None:
    for seed in range(15, 33):
        truth = cell(300 + seed, (5, 8, 15)[seed % 3], camera_given=seed % 2 == 0)
        solution = solve_hand_eye(truth.problem)
        assert all(view.status == "used" for view in solution.views), seed
        assert not {f.code for f in solution.findings} - {"noise-assumed"}, (seed, solution.findings)


@pytest.mark.parametrize(("as_likely", "severity"), [(False, "warning"), (True, "error")])
def test_starts_that_end_elsewhere_are_part_of_the_verdict(as_likely: bool, severity: str) -> None:
    truth = cell(31, 6)
    estimated = estimate_session(truth.problem)
    prepared, start, selection = estimated.prepared, estimated.start, estimated.selection
    assert not start.other_optima
    torn = replace(start, other_optima=("tsai",), ambiguous=as_likely)
    solution = build_solution(truth.problem, "auto", prepared, torn, selection)
    verdict = judge(truth.problem, solution)
    finding = next(finding for finding in verdict.findings if finding.code == "starts-disagree")
    assert finding.severity == severity and "tsai" in finding.message
    assert verdict.accepted is not as_likely


IDENTITY_MOTIONS = {
    "pure-translation": [turned([0, 0, 0], [40.0 * i, 30.0 * (i % 3), 10.0 * i]) for i in range(6)],
    "too-little-rotation": [turned([0.8 * i, 1.2 * (i % 3), 0], [10.0 * i, 5.0 * (i % 2), 0]) for i in range(6)],
    "parallel-axes": [turned([0, 0, 12.0 * i], [20.0 * i, 10.0 * (i % 2), 3.0 * i]) for i in range(6)],
    "too-few-poses": [turned([0, 0, 0], [0, 0, 0])] * 6,
}


@pytest.mark.parametrize("code", IDENTITY_MOTIONS)
@pytest.mark.parametrize("noise", [CellNoise(0.0, 0.0, 0.0), CellNoise()])
def test_motions_that_cannot_determine_x_are_refused_with_the_reason(code: str, noise: CellNoise) -> None:
    problem = _looking_down(IDENTITY_MOTIONS[code], noise)
    solution = solve_hand_eye(problem)
    verdict = judge(problem, solution)
    assert solution.mount_T_camera is None and solution.uncertainty is None
    assert not verdict.accepted
    assert [finding.code for finding in verdict.findings] == [code]
    if code == "parallel-axes":
        assert (
            "translation along the base's z, (0.00, 0.00, 1.00) of the flange, and rotation about it are not determined"
            in verdict.findings[0].message
        )


def _looking_down(motions: list[Array], noise: CellNoise) -> Problem:
    start = turned([180, 0, 0], [500, 0, 600])
    X = turned([0, 0, 30], [50, 20, 60])
    centre = BOARD.points_mm.mean(axis=0)
    Y = turned([0, 0, 0], [540, 20, 0]) @ transform(np.eye(3), -centre)
    # The arm turns about the base's axes where it stands.
    poses = np.array([transform(m[:3, :3] @ start[:3, :3], start[:3, 3] + 0.5 * m[:3, 3]) for m in motions])
    return observed(np.random.default_rng(0), "eye-in-hand", BOARD, poses, X, Y, noise).problem

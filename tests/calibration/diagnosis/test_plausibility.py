"""What is no measurement, or not of a cell that can exist, is refused whoever asks; exact simulations are not."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calibration.observations.observations import observe
from calibration.observations.view_poses import candidate_poses
from calibration.problem import MeasuredPose, Problem, base_T_flange_of
from calibration.solve import solve_hand_eye
from calibration.transforms import Array, inverse, rotation_from_vector, transform
from calibration.verdict import Verdict, judge
from tests.simulated.measured_sessions import measured_cell, tracker, with_camera_poses, with_robot_poses
from tests.simulated.sessions import BOARD, Cell, CellNoise, looking, observed, random_cell
from tests.simulated.varied_sessions import varied
from tests.support.cases import seeds

CODES = {
    "circular-poses", "exact-poses", "robot-poses-repeated", "camera-poses-repeated", "mount-too-far", "stand-too-far",
    "flange-in-sight", "setup-fits-either-way", "target-behind-camera",
}  # fmt: skip

NO_NOISE = CellNoise(0.0, 0.0, 0.0)
BEHIND_THE_FLANGE = transform(rotation_from_vector([0.0, 0.0, 0.3]), [0.0, 0.0, -120.0])


def verdict_and_codes(problem: Problem) -> tuple[Verdict, set[str]]:
    """The verdict, and which of the findings are of plausibility."""
    verdict = judge(problem, solve_hand_eye(problem))
    return verdict, {finding.code for finding in verdict.findings} & CODES


def camera_poses_of(problem: Problem) -> Array:
    """camera_T_target (n, 4, 4) by the pictures alone."""
    assert problem.camera is not None
    return candidate_poses(observe(problem)[0], problem.camera)[0][:, 0]


def cell(seed: int, views: int = 8, **where: Array) -> Cell:
    """Eye in hand, with X or the target's pose at will."""
    rng = np.random.default_rng(seed)
    X = where.get("X", transform(rotation_from_vector([0.2, -0.3, 1.0]), [60.0, -40.0, 90.0]))
    Y = where.get("Y", transform(rotation_from_vector([3.0, 0.2, 0.1]), [700.0, 100.0, 50.0]))
    seen = np.array([looking(rng) for _ in range(views)])
    return observed(rng, "eye-in-hand", BOARD, Y @ inverse(X @ seen), X, Y, CellNoise())


def from_pictures(problem: Problem, X: Array, Y: Array) -> Problem:
    """The poses that the pictures themselves say, with this X and this pose of the target."""
    return with_robot_poses(
        problem, lambda _: base_T_flange_of(problem.setup, Y @ inverse(X @ camera_poses_of(problem)))
    )


IDENTITY = np.eye(4)
HALF_TURN = transform(rotation_from_vector([np.pi, 0.0, 0.0]), [0.0, 0.0, 0.0])
ANYWHERE = transform(rotation_from_vector([0.4, 1.0, -0.2]), [300.0, 20.0, 500.0])
FAR = transform(rotation_from_vector([0.1, 3.0, 0.2]), [900.0, 200.0, 50.0])
X_OF_CELL = transform(rotation_from_vector([0.2, -0.3, 1.0]), [60.0, -40.0, 90.0])


def round_poses(problem: Problem) -> Problem:
    """The camera's own poses as a recorder writes them, to 0.01 mm and 0.0001."""
    return with_robot_poses(from_pictures(problem, IDENTITY, IDENTITY), lambda poses: np.round(poses, 4))


def pairs(seed: int, X: Array, Y: Array, setup: str = "eye-in-hand", exact: bool = True) -> Problem:
    """A session of pose pairs; the robot's are computed from the camera's."""
    drawn = measured_cell(np.random.default_rng(seed), 8, tracker(0.0, 0.0), setup=setup, robot_deg=0.0, robot_mm=0.0)
    measured = [view.measured for view in drawn.problem.views]
    seen = np.array([one.camera_T_target for one in measured if isinstance(one, MeasuredPose)])
    poses = base_T_flange_of(drawn.problem.setup, Y @ inverse(X @ seen))
    scatter = transform(np.eye(3), 0.0 if exact else 0.1 * np.random.default_rng(1).standard_normal((len(seen), 3)))
    return with_robot_poses(drawn.problem, lambda _: poses @ scatter)


CIRCLES: dict[str, Callable[[], Problem]] = {
    "the camera's own poses of the target": lambda: from_pictures(cell(1).problem, IDENTITY, IDENTITY),
    "the same, rounded": lambda: round_poses(cell(2).problem),
    "its own poses times a fixed one": lambda: from_pictures(cell(3).problem, ANYWHERE, ANYWHERE),
    "poses computed with a guess of X": lambda: from_pictures(cell(4).problem, X_OF_CELL, ANYWHERE),
    "equal numbers on both sides, beside the robot": lambda: pairs(5, IDENTITY, IDENTITY, "eye-to-hand"),
    "inverse numbers on both sides": lambda: pairs(6, IDENTITY, IDENTITY),
    "equal numbers on both sides, on the flange": lambda: with_robot_poses(pairs(6, IDENTITY, IDENTITY), inverse),
    "a fixed product on one side": lambda: pairs(7, IDENTITY, ANYWHERE),
    "a fixed product on the other": lambda: pairs(8, ANYWHERE, IDENTITY),
}


@pytest.mark.parametrize("what", CIRCLES)
def test_a_circle_has_no_X_and_no_U(what: str) -> None:
    problem = CIRCLES[what]()
    solution = solve_hand_eye(problem)
    assert "circular-poses" in {finding.code for finding in solution.findings}
    assert solution.mount_T_camera is None and solution.uncertainty is None
    assert not judge(problem, solution).accepted


def measure_twice(problem: Problem) -> Problem:
    return with_camera_poses(problem, lambda seen: seen[[0, 1, 2, 0]])


def both_inverted(problem: Problem) -> Problem:
    return with_robot_poses(with_camera_poses(problem, inverse), inverse)


def few(problem: Problem, views: int) -> Problem:
    return replace(problem, views=problem.views[:views], poses_from_controller=True)


def of_other_setup(problem: Problem) -> Problem:
    other = {"eye-in-hand": "eye-to-hand", "eye-to-hand": "eye-in-hand"}[problem.setup]
    return replace(problem, setup=other)  # type: ignore[arg-type]


def at(distance_mm: float) -> Array:
    return transform(rotation_from_vector([0.2, -0.3, 1.0]), [0.0, distance_mm, 0.0])


def with_stand_at(distance_mm: float) -> Problem:
    rng = np.random.default_rng(9)
    X, Y = transform(rotation_from_vector([2.0, 0.4, 0.1]), [distance_mm, 0.0, 500.0]), at(90.0)
    seen = np.array([looking(rng) for _ in range(8)])
    return observed(rng, "eye-to-hand", BOARD, X @ seen @ inverse(Y), X, Y, CellNoise()).problem


ROWS: dict[str, tuple[Callable[[], Problem], str, bool]] = {
    "0.6 m from the flange, six views": (lambda: few(cell(10, 6, X=at(600.0)).problem, 6), "mount-too-far", True),
    "1.2 m from the flange, five views": (lambda: few(cell(11, 5, X=at(1200.0)).problem, 5), "mount-too-far", False),
    "1.2 m from the flange, six views": (lambda: few(cell(12, 6, X=at(1200.0)).problem, 6), "mount-too-far", True),
    "9 m from the base": (lambda: with_stand_at(9000.0), "stand-too-far", False),
    "behind the flange, looking through it": (lambda: cell(13, X=BEHIND_THE_FLANGE).problem, "flange-in-sight", False),
    "three views of the other setup": (
        lambda: of_other_setup(few(cell(14, 3).problem, 3)), "setup-fits-either-way", False,
    ),
    "a camera whose z axis points backwards": (
        lambda: with_camera_poses(pairs(16, X_OF_CELL, ANYWHERE, exact=False), lambda seen: HALF_TURN @ seen),
        "target-behind-camera", True,
    ),
    "poses inverted on both sides": (
        lambda: both_inverted(pairs(17, X_OF_CELL, FAR, exact=False)), "mount-too-far", False,
    ),
    "the same of a board whose z points at the camera": (
        lambda: both_inverted(with_camera_poses(pairs(17, X_OF_CELL, FAR, exact=False), lambda seen: seen @ HALF_TURN)),
        "mount-too-far", False,
    ),
    "a camera 0.6 m from the flange, the target beyond the arm's foot": (
        lambda: pairs(18, at(600.0), at(300.0), exact=False), "mount-too-far", True,
    ),
    "a tracker that says the same twice": (
        lambda: measure_twice(few(pairs(15, X_OF_CELL, ANYWHERE, exact=False), 4)), "camera-poses-repeated", False,
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", ROWS)
def test_what_no_cell_has_is_named(what: str) -> None:
    make, code, accepted = ROWS[what]
    verdict, codes = verdict_and_codes(make())
    assert code in codes
    assert verdict.accepted is accepted


def test_exact_pairs_of_an_ordinary_cell_are_solved_with_a_warning() -> None:
    problem = pairs(20, X_OF_CELL, ANYWHERE)
    solution = solve_hand_eye(problem)
    assert solution.mount_T_camera is not None
    assert np.allclose(solution.mount_T_camera, X_OF_CELL, atol=1e-3)
    assert {finding.code for finding in solution.findings} & CODES == {"exact-poses"}


@pytest.mark.parametrize("seed", range(4))
def test_an_exact_robot_with_exact_pixels_is_no_circle(seed: int) -> None:
    setup = ("eye-in-hand", "eye-to-hand")[seed % 2]
    exact = random_cell(np.random.default_rng(seed), 8, NO_NOISE, setup=setup)  # type: ignore[arg-type]
    exact_arm = random_cell(np.random.default_rng(seed), 8, CellNoise(0.05, 0.0, 0.0), setup=setup)  # type: ignore[arg-type]
    for truth in (exact, exact_arm):
        verdict, codes = verdict_and_codes(truth.problem)
        assert verdict.accepted and not codes


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_no_clean_session_has_a_finding() -> None:
    for seed in seeds(250, every=12):
        rng = np.random.default_rng(seed)
        setup, views = ("eye-in-hand", "eye-to-hand")[seed % 2], 4 + seed % 7
        ordinary = random_cell(rng, views, CellNoise(), setup=setup).problem  # type: ignore[arg-type]
        for problem in (replace(ordinary, poses_from_controller=True), varied(rng).problem):
            assert not verdict_and_codes(problem)[1], seed

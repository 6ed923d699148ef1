"""Bad input: a typed error or a finding each; no exception from numpy, no warning and no word on standard error."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.likelihood.predicted_uncertainty import ExpectedNoise
from calibration.planning.scene_belief import ScenePrior, infer_scene
from calibration.problem import Detection, Problem, View
from calibration.solve import METHODS, solve_hand_eye
from calibration.transforms import Array, transform
from calibration.verdict import judge
from tests.simulated.spoiled_sessions import cell, error_of, turned, with_corners, with_view
from tests.support.cases import crossed

ROOT = Path(__file__).resolve().parents[2]

Spoil = Callable[[View], View]
MIRROR = np.diag([1.0, 1.0, -1.0, 1.0])
FAR = transform(np.eye(3), [1e18, 0, 0])

BAD_CORNERS: dict[str, tuple[Spoil, str | None]] = {
    "every corner NaN": (with_corners(lambda c: np.full_like(c, np.nan)), "too-few-corners"),
    "every corner infinite": (with_corners(lambda c: np.full_like(c, np.inf)), "too-few-corners"),
    "a few NaN": (with_corners(lambda c: np.where(np.arange(len(c))[:, None] < 5, np.nan, c)), None),
    "one corner": (with_corners(lambda c: c[:1]), "too-few-corners"),
    "one row": (with_corners(lambda c: c[:11]), "corners-on-a-line"),
    "an id outside the target": (
        lambda v: replace(v, detection=Detection(np.array([0, 1, 2, 3, 400]), np.zeros((5, 2)))),
        "corner-id-unknown",
    ),
    "a repeated id": (
        lambda v: replace(v, detection=Detection(np.array([0, 1, 2, 3, 3]), np.zeros((5, 2)))),
        "corner-id-repeated",
    ),
    "ids and corners of different number": (
        lambda v: replace(v, detection=Detection(np.arange(5), np.zeros((4, 2)))),
        "corners-damaged",
    ),
    "a pose that is not finite": (
        lambda v: v.standing(base_T_flange=np.full((4, 4), np.nan)),
        "pose-not-finite",
    ),
    "a pose that is no rotation": (lambda v: v.standing(base_T_flange=1.1 * v.base_T_flange), "pose-not-rigid"),
    "a pose beyond any arm's reach": (lambda v: v.standing(base_T_flange=FAR @ v.base_T_flange), "pose-not-rigid"),
    "all corners at one pixel": (with_corners(lambda c: np.full_like(c, 700.0)), "edge-on"),
    "no target": (lambda v: replace(v, detection=None, missing=("too-dark", "nothing to see")), "too-dark"),
}


@pytest.fixture(autouse=True)
def silent(capfd: pytest.CaptureFixture[str]) -> Iterator[None]:
    """Warnings are errors in every test; OpenCV writes past Python."""
    yield
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(("what", "camera_given"), crossed(BAD_CORNERS, [True, False]))
def test_a_view_that_cannot_be_used_is_rejected_with_its_reason(what: str, camera_given: bool) -> None:
    spoil, reason = BAD_CORNERS[what]
    truth = cell(9, 8, camera_given=camera_given)
    solution = solve_hand_eye(with_view(truth.problem, 3, spoil))
    assert solution.views[3].reason == reason
    assert solution.views[3].status == ("used" if reason is None else "rejected")
    assert error_of(solution.mount_T_camera, truth)[0] < 1.0


def everywhere(spoil: Spoil) -> Callable[[Problem], Problem]:
    return lambda problem: replace(problem, views=tuple(spoil(view) for view in problem.views))


def squashed(view: View) -> View:
    return with_corners(lambda corners: np.column_stack([corners[:, 0], np.full(len(corners), 900.0)]))(view)


def standing_at(base_T_flange: Array) -> Spoil:
    return lambda view: view.standing(base_T_flange=base_T_flange)


BAD_SESSIONS: dict[str, tuple[Callable[[Problem], Problem], str]] = {
    "no views": (lambda p: replace(p, views=()), "too-few-poses"),
    "one view": (lambda p: replace(p, views=p.views[:1]), "too-few-poses"),
    "two views": (lambda p: replace(p, views=p.views[:2]), "too-few-poses"),
    "three identical views": (lambda p: replace(p, views=(p.views[0],) * 3), "too-few-poses"),
    "identical poses": (everywhere(standing_at(turned([10, 20, 30], [500, 0, 400]))), "too-few-poses"),
    "NaN corners": (everywhere(BAD_CORNERS["every corner NaN"][0]), "too-few-poses"),
    "infinite corners": (everywhere(BAD_CORNERS["every corner infinite"][0]), "too-few-poses"),
    "one corner a view": (everywhere(BAD_CORNERS["one corner"][0]), "too-few-poses"),
    "ids outside the target": (everywhere(BAD_CORNERS["an id outside the target"][0]), "too-few-poses"),
    "repeated ids": (everywhere(BAD_CORNERS["a repeated id"][0]), "too-few-poses"),
    "a target seen edge-on": (everywhere(squashed), "too-few-poses"),
    "NaN poses": (everywhere(standing_at(np.full((4, 4), np.nan))), "too-few-poses"),
    "corners outside the image": (lambda p: replace(p, image_size=(40, 30)), "too-few-poses"),
    "poses of zeros": (everywhere(standing_at(np.zeros((4, 4)))), "too-few-poses"),
    "mirrored poses": (everywhere(lambda v: v.standing(base_T_flange=MIRROR @ v.base_T_flange)), "too-few-poses"),
    "poses light years away": (everywhere(lambda v: v.standing(base_T_flange=FAR @ v.base_T_flange)), "too-few-poses"),
}


@pytest.mark.parametrize("what", BAD_SESSIONS)
@pytest.mark.parametrize(("method", "camera_given"), [("auto", True), ("auto", False), ("park", True)])
def test_a_session_that_determines_nothing_is_refused_with_the_reason(
    what: str, method: str, camera_given: bool
) -> None:
    spoil, code = BAD_SESSIONS[what]
    problem = spoil(cell(10, 6, camera_given=camera_given).problem)
    solution = solve_hand_eye(problem, method)
    assert solution.mount_T_camera is None and solution.uncertainty is None
    assert solution.findings[0].code == code
    assert not judge(problem, solution).accepted
    assert len(solution.views) == len(problem.views)


def test_corners_of_fewer_than_four_in_every_view_say_so_view_by_view() -> None:
    problem = everywhere(with_corners(lambda corners: corners[:1]))(cell(11, 6).problem)
    assert {view.reason for view in solve_hand_eye(problem).views} == {"too-few-corners"}


@pytest.mark.parametrize("method", METHODS)
def test_four_corners_a_view_are_enough(method: str) -> None:
    truth = cell(14, 8)
    few = everywhere(lambda view: replace(view, detection=_only(view, [0, 10, 77, 87])))(truth.problem)
    assert error_of(solve_hand_eye(few, method).mount_T_camera, truth)[0] < 30.0


def _only(view: View, ids: list[int]) -> Detection:
    assert view.detection is not None
    return Detection(np.array(ids), view.detection.corners_px[ids])


def test_views_that_see_different_parts_of_the_target_are_put_together() -> None:
    truth = cell(15, 8)
    parts = [np.arange(0, 30), np.arange(20, 88), np.arange(88), np.arange(0, 88, 3)]
    views = tuple(replace(view, detection=_only(view, list(parts[view.index % 4]))) for view in truth.problem.views)
    assert error_of(solve_hand_eye(replace(truth.problem, views=views)).mount_T_camera, truth)[0] < 0.5


@pytest.mark.parametrize("guess", [turned([0, 0, 0], [0, 0, 0]), turned([170, 40, -90], [5000, -9000, 70])])
def test_a_wildly_wrong_guess_is_forgotten_once_three_views_are_there(guess: Array) -> None:
    truth = cell(16, 6)
    problem = truth.problem
    noise = ExpectedNoise(0.05, 1e-4, 0.05)
    belief = infer_scene(ScenePrior(problem.setup, problem.target, problem.camera, guess, guess, noise), problem)
    assert error_of(belief.scene.mount_T_camera, truth)[0] < 1.0


@pytest.mark.slow
def test_wildly_wrong_poses_everywhere_are_not_accepted() -> None:
    truth = cell(12, 10)
    rng = np.random.default_rng(0)
    views = tuple(
        view.standing(base_T_flange=turned(list(rng.uniform(-180, 180, 3)), list(rng.uniform(-1000, 1000, 3))))
        for view in truth.problem.views
    )
    problem = replace(truth.problem, views=views)
    assert not judge(problem, solve_hand_eye(problem)).accepted


SOLVE_2000_VIEWS = """
import json
from pathlib import Path
from calibration.solve import solve_hand_eye
from calibration.targets import Chessboard
from tests.simulated.spoiled_sessions import cell, error_of

def megabytes(name):
    return int(Path("/proc/self/status").read_text().split(name)[1].split()[0]) / 1e3

truth = cell(13, 2000, target=Chessboard(4, 3, 40.0))
before = megabytes("VmRSS:")
X = solve_hand_eye(truth.problem).mount_T_camera
print(json.dumps([megabytes("VmHWM:") - before, error_of(X, truth)[0]]))
"""
"""In a process of its own: tracemalloc, which counts within one, makes the solve six times as slow."""


@pytest.mark.slow
def test_thousands_of_views_cost_no_more_than_their_number() -> None:
    ran = subprocess.run([sys.executable, "-c", SOLVE_2000_VIEWS], capture_output=True, text=True, cwd=ROOT, check=True)
    growth_mb, error_mm = json.loads(ran.stdout)
    assert error_mm < 0.05
    assert growth_mb < 160

"""One thing is wrong with a session: the solver says which, where, and what to do."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calibration.problem import Detection, Problem, Setup, View
from calibration.solution import Finding
from calibration.solve import solve_hand_eye
from calibration.targets import Charuco
from calibration.transforms import quaternion_from_rotation, rotation_from_quaternion
from calibration.verdict import judge
from tests.simulated.fault_kinds import GROSS, KINDS, Session
from tests.simulated.faults import (
    CONVENTIONS,
    SETUPS,
    TRACK_ORDERS,
    Fault,
    Noise,
    distortion_wrong,
    focal_wrong,
    in_convention,
    mistyped,
    moved,
    other_tool,
    poses_of,
    scaled_target,
    simulated_session,
    track_left_out,
    with_poses,
)
from tests.simulated.faulty_sessions import simulated
from tests.support.cases import crossed


def session(seed: int = 0, n: int = 12, setup: Setup = "eye-in-hand", noise: Noise | None = None) -> Problem:
    return simulated_session(np.random.default_rng(seed), n, noise or Noise(), setup)


def finding(problem: Problem, codes: frozenset[str]) -> Finding:
    findings = solve_hand_eye(problem).findings
    found = [finding for finding in findings if finding.code in codes]
    assert len(found) == 1, findings
    return found[0]


def assert_disagreement_is_mended(message: str) -> None:
    before, after = message.split("Robot and images disagree by ")[1].split(" as they came, by ")
    assert float(before.split(" mm")[0]) > 1.0
    assert float(after.split(" mm")[0]) < 0.5


READ_AGAIN = "board turned in one view"
"""A board read the wrong way round is read again before anything is estimated: no disagreement is reported."""


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "setup"), crossed(GROSS, SETUPS))
def test_a_gross_fault_is_named_with_its_views(kind: str, setup: Setup) -> None:
    """A session in another convention is never accepted."""
    fault = GROSS[kind](session(1, setup=setup), np.random.default_rng(2))
    solution = solve_hand_eye(fault.problem)
    (found,) = (finding for finding in solution.findings if finding.code in fault.codes)
    assert all(word in found.message for word in fault.says), found.message
    assert found.fix
    if kind in CONVENTIONS:
        assert found.severity == "error"
        assert not judge(fault.problem, solution).accepted
    if kind != READ_AGAIN:
        assert_disagreement_is_mended(found.message)


@pytest.mark.parametrize("kind", ["degrees-read-as-radians", "two poses swapped"])
@pytest.mark.parametrize("number", [24, 29])
def test_a_gross_fault_is_named_in_few_views_and_between_poor_robots(kind: str, number: int) -> None:
    """Of 6 and of 28 views: several unwrapped angles agree with one view, and no half of six is without two."""
    clean = simulated(np.random.default_rng([5, 0, number])).problem
    fault = GROSS[kind](clean, np.random.default_rng(2))
    assert all(word in finding(fault.problem, fault.codes).message for word in fault.says)


@pytest.mark.parametrize("slip_of, size", [(focal_wrong, 0.003), (focal_wrong, 0.03), (distortion_wrong, 0.1)])
def test_intrinsics_that_do_not_fit_are_distinguished_from_the_robot(slip_of, size: float) -> None:  # type: ignore[no-untyped-def]
    fault = slip_of(session(4, n=15), np.random.default_rng(0)).at(size)
    assert " px where others leave " in finding(fault.problem, fault.codes).message


def test_a_lens_that_is_slightly_off_is_named_after_the_cause() -> None:
    slightly_off = focal_wrong(session(4, n=15), np.random.default_rng(0)).at(0.003).problem
    poses = poses_of(slightly_off)
    poses[7, 1, 3] += 60.0
    codes = [found.code for found in solve_hand_eye(with_poses(slightly_off, poses)).findings]
    assert "intrinsics-do-not-fit" in codes
    assert codes.index("pose-mistyped") < codes.index("intrinsics-do-not-fit")


@pytest.mark.parametrize("code", ["poses-in-micrometres", "radians-read-as-degrees"])
def test_what_leaves_x_undetermined_is_named_before_intrinsics_that_do_not_fit(code: str) -> None:
    other_lens = focal_wrong(session(4, n=15), np.random.default_rng(0)).at(0.03).problem
    fault = in_convention(code)(other_lens, np.random.default_rng(0))
    both = (code, "intrinsics-do-not-fit")
    assert tuple(found.code for found in solve_hand_eye(fault.problem).findings if found.code in both) == both


def test_the_number_that_was_mistyped_is_reported_with_what_it_should_be() -> None:
    clean = session(5)
    poses = poses_of(clean)
    right = poses[7, 1, 3]
    poses[7, 1, 3] += 20.0
    message = finding(with_poses(clean, poses), frozenset({"pose-mistyped"})).message
    assert f"the pose of picture 8 has a wrong number: y is {right + 20:.2f} and should be about" in message
    told = float(message.split("should be about ")[1].split(" ")[0].rstrip("."))
    assert told == pytest.approx(right, abs=1.0)


def test_a_lost_sign_is_reported_in_a_pose_that_is_off_besides() -> None:
    clean = session(5, n=15, noise=Noise(0.05, 0.5, 0.05))
    poses = poses_of(clean)
    quaternion = quaternion_from_rotation(poses[7, :3, :3])
    right, quaternion[3] = quaternion[3], -quaternion[3]
    poses[7, :3, :3] = rotation_from_quaternion(quaternion)
    poses[7, :3, 3] += [3.0, -3.0, 2.5]
    message = finding(with_poses(clean, poses), frozenset({"pose-mistyped"})).message
    assert f"most of that is one sign: q4 (z) is {-right:.5f} and should be about {right:.5f}" in message


def test_one_mistyped_pose_does_not_condemn_the_rest() -> None:
    clean = session(5, n=15)
    poses = poses_of(clean)
    poses[4, 0, 3] -= 35.0
    spoilt = with_poses(clean, poses)
    solution = solve_hand_eye(spoilt)
    assert solution.views[4].status == "rejected"
    assert judge(spoilt, solution).accepted
    assert [f.severity for f in solution.findings if f.code == "pose-mistyped"] == ["warning"]


@pytest.mark.slow
def test_a_pose_wrong_in_several_numbers_is_named_without_guessing_one() -> None:
    clean = session(6)
    poses = poses_of(clean)
    poses[3] = poses[3] @ poses[8]
    message = finding(with_poses(clean, poses), frozenset({"pose-mistyped"})).message
    assert "the pose of picture 4 disagrees with all others by" in message


@pytest.mark.slow
def test_another_tool_from_some_view_on_refuses_a_solution_that_mixes_both() -> None:
    fault = other_tool(session(7, n=16), np.random.default_rng(4))
    solution = solve_hand_eye(fault.problem)
    after = fault.after
    assert after is not None
    used = {view.index for view in solution.views if view.status != "rejected"}
    mixed = any(index < after for index in used) and any(index >= after for index in used)
    severity = finding(fault.problem, fault.codes).severity
    assert severity == ("error" if mixed else "warning")


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_half_again_as_large_as_an_oracle_needs_is_named(kind: str) -> None:
    noise = Noise(0.05, 0.1, 0.01)
    clean = Session(session(8, n=14, noise=noise), noise)
    slip = KINDS[kind].slip_of(clean.problem, np.random.default_rng(1))
    reach = KINDS[kind].reach(clean, slip)
    fault = slip.at(1.5 * reach.size * reach.deviation)
    found = finding(fault.problem, fault.codes)
    assert all(word in found.message for word in fault.says), found.message


SMALL: dict[str, Callable[[Problem, np.random.Generator], Fault]] = {
    "one number": lambda p, r: mistyped(p, r).at(15.0),
    "board or camera moved": lambda p, r: moved(p, r, "base").at(15.0),
    "pitch": lambda p, r: scaled_target(p, r).at(0.05),
}


@pytest.mark.parametrize("kind", SMALL)
def test_a_small_fault_reports_the_disagreement_before_and_after(kind: str) -> None:
    fault = SMALL[kind](session(9), np.random.default_rng(0))
    assert_disagreement_is_mended(finding(fault.problem, fault.codes).message)


def _retaken(view: View, times: int) -> View:
    assert view.detection is not None
    again = Detection(view.detection.ids, view.detection.corners_px + 0.02 * times)
    return replace(view, index=view.index + 100 * times, detection=again)


@pytest.mark.parametrize("pictures", [1, 2, 3], ids="{} at each station".format)
@pytest.mark.parametrize(("columns", "rows", "says"), [(11, 9, "points that it does not have"), (13, 9, "do not lie")])
def test_a_board_of_another_size_is_reported(columns: int, rows: int, says: str, pictures: int) -> None:
    clean = session(12)
    clean = replace(clean, views=tuple(_retaken(view, n) for n in range(pictures) for view in clean.views))
    other = replace(clean, target=Charuco(columns, rows, 20.0, 15.0, "DICT_5X5_100"))
    verdict = judge(other, solve_hand_eye(other))
    assert not verdict.accepted
    (found,) = (found for found in verdict.findings if found.code == "target-not-as-described")
    assert says in found.message
    assert "compare the target's description with the target" in found.fix


@pytest.mark.parametrize(("noise", "setup"), crossed([Noise(0.02, 0, 0), Noise(), Noise(0.5, 0.5, 0.05)], SETUPS))
def test_clean_sessions_are_left_in_peace(noise: Noise, setup: Setup) -> None:
    for seed, n in enumerate((5, 6, 9, 14)):
        severe = [f for f in solve_hand_eye(session(seed, n, setup, noise)).findings if f.severity != "info"]
        assert not severe, (seed, n, severe)


def test_a_pose_at_the_end_of_the_world_is_named_and_raises_nothing() -> None:
    clean = session(10)
    for far in (1e7, 1e12, 1e150):
        poses = poses_of(clean)
        poses[2, 0, 3] = far
        assert solve_hand_eye(with_poses(clean, poses)).findings


def test_views_are_called_by_their_own_numbers() -> None:
    clean = session(11)
    views = [replace(view, index=index) for index, view in enumerate(clean.views)]
    views[0] = replace(views[0], detection=None, missing=("not-found", "no board"))
    poses = poses_of(clean)
    poses[6, 2, 3] += 12.0
    spoilt = with_poses(replace(clean, views=tuple(views)), poses)
    assert "the pose of picture 7 " in finding(spoilt, frozenset({"pose-mistyped"})).message


@pytest.mark.parametrize(("order", "setup"), crossed(TRACK_ORDERS, SETUPS))
def test_the_groups_of_views_beside_an_undeclared_track_are_named(order: str, setup: Setup) -> None:
    fault = track_left_out(session(7, n=15, setup=setup), np.random.default_rng(7), order)
    found = finding(fault.problem, fault.codes)
    assert found.severity == "error"
    assert all(group in found.message for group in fault.says), found.message
    assert "external_axis" in found.fix
    assert_disagreement_is_mended(found.message)


def test_an_arm_in_two_postures_is_not_taken_for_one_on_a_track() -> None:
    clean = session(7, n=15)
    poses = poses_of(clean)
    poses[::2, 0, 3] += 3.0
    codes = {found.code for found in solve_hand_eye(with_poses(clean, poses)).findings}
    assert "track-not-declared" not in codes

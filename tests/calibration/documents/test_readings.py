"""The convention that is not given is found by the evidence of the images, or asked for."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.diagnosis.evidence import Evidence
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.readings import compare, decide, readings_of
from calibration.documents.view_evidence import evidence_of_views
from calibration.kinematics.conventions import CONVENTIONS, Kind
from calibration.kinematics.external_axis import ExternalAxis
from calibration.problem import Setup, anchor_T_mount_of
from calibration.transforms import (
    Array,
    inverse,
    quaternion_from_rotation,
    rotation_from_vector,
    transform,
    transform_from_vector,
    vector_from_rotation,
)
from tests.simulated.spoiled_sessions import board_turned, cell, with_view

SETUPS: tuple[Setup, Setup] = ("eye-in-hand", "eye-to-hand")
X = transform(rotation_from_vector([0.1, -0.2, 1.4]), [35.0, -20.0, 90.0])
Y = transform(rotation_from_vector([3.1, 0.1, 0.0]), [900.0, 50.0, 100.0])


def _session(views: int, setup: Setup = "eye-in-hand") -> tuple[Array, Evidence]:
    """Robot poses (n, 4, 4) and what the camera sees of the target, both with a little noise."""
    rng = np.random.default_rng(3)
    turns = rotation_from_vector(rng.uniform(-0.7, 0.7, (views, 3)))
    poses = transform(
        rotation_from_vector([2.8, 0.3, 0.2]) @ turns, rng.uniform([550, -150, 450], [850, 150, 750], (views, 3))
    )
    seen = inverse(anchor_T_mount_of(setup, poses) @ X) @ Y
    seen = transform_from_vector(rng.normal(0, 1, (views, 6)) * np.repeat([2e-4, 0.2], 3)) @ seen
    covariance = np.tile(np.diag(np.repeat([2e-4, 0.2], 3) ** 2), (views, 1, 1))
    unknown = np.tile(np.eye(4), (views, 1, 1))
    return poses, Evidence("eye-in-hand", np.arange(views), unknown, seen, covariance, np.full(views, 40.0))


def _table(poses: Array, numbers: Array, kind: Kind) -> PoseTable:
    labels = tuple(str(at) for at in range(len(poses)))
    return PoseTable("poses.csv", labels, poses[:, :3, 3], numbers, kind, "numbers")


def _numbers(name: str, poses: Array) -> tuple[Array, Kind]:
    rotations = poses[:, :3, :3]
    match CONVENTIONS[name].kind:
        case "quaternion":
            wxyz = quaternion_from_rotation(rotations)
            return (wxyz if name.endswith("wxyz") else np.roll(wxyz, -1, axis=1)), "quaternion"
        case "matrix":
            return rotations.reshape(-1, 9), "matrix"
    if name == "rotation-vector":
        return vector_from_rotation(rotations), "angles"
    order = name.removeprefix("euler-").removesuffix("-rad")
    return Rotation.from_matrix(rotations).as_euler(order, degrees=not name.endswith("-rad")), "angles"


@pytest.mark.parametrize(
    "name",
    ["euler-ZYX", "euler-xyz", "euler-XYZ", "euler-ZYZ", "euler-zxz", "euler-xyz-rad", "rotation-vector",
     "quaternion-xyzw", "quaternion-wxyz", "matrix"],
)  # fmt: skip
def test_the_convention_is_found(name: str) -> None:
    poses, evidence = _session(10)
    table = _table(poses, *_numbers(name, poses))
    readings = readings_of(table, ("eye-in-hand",))
    compared = compare(table, readings, evidence)
    decision = decide(table, compared, evidence)
    assert decision.reading is not None, decision.words
    assert (decision.reading.convention.name, decision.reading.frame) == (name, "base_T_flange")
    assert "next best" in decision.words
    assert "times worse" in decision.words


@pytest.mark.parametrize("setup", SETUPS)
def test_the_place_of_the_camera_is_found_when_the_frame_is_stated(setup: Setup) -> None:
    poses, evidence = _session(8, setup)
    table = _table(poses, *_numbers("matrix", poses))
    readings = readings_of(table, SETUPS, (CONVENTIONS["matrix"],), frame="base_T_flange")
    decision = decide(table, compare(table, readings, evidence), evidence)
    assert decision.reading is not None
    assert decision.reading.setup == setup


def test_what_no_data_can_decide_is_asked() -> None:
    poses, evidence = _session(8)
    table = _table(poses, *_numbers("matrix", poses))
    readings = readings_of(table, SETUPS, (CONVENTIONS["matrix"],))
    decision = decide(table, compare(table, readings, evidence), evidence)
    assert decision.reading is None
    assert {(one.setup, one.frame) for one in decision.choices} == {
        ("eye-in-hand", "base_T_flange"),
        ("eye-to-hand", "flange_T_base"),
    }


def test_too_few_views_decide_nothing() -> None:
    poses, evidence = _session(4)
    table = _table(poses, *_numbers("euler-ZYX", poses))
    decision = decide(table, compare(table, readings_of(table, ("eye-in-hand",)), evidence), evidence)
    assert decision.reading is None
    assert "4 of 5 pictures needed to compare" in decision.words


def test_poses_of_other_pictures_fit_in_no_convention() -> None:
    poses, evidence = _session(12)
    table = _table(poses, *_numbers("euler-ZYX", poses)).take([5, 3, 8, 0, 11, 2, 9, 1, 7, 10, 4, 6])
    decision = decide(table, compare(table, readings_of(table, ("eye-in-hand",)), evidence), evidence)
    assert decision.reading is None
    assert "none fits" in decision.words or "fit alike" in decision.words
    assert "times as large" not in decision.words


@pytest.mark.parametrize(("given", "named"), [(0.8, "1.25"), (25.4 / 30, "1.18"), (3.0, "0.333")])
def test_a_target_of_another_size_is_named(given: float, named: str) -> None:
    poses, evidence = _session(10)
    table, evidence = _table(poses, *_numbers("euler-ZYX", poses)), evidence.scale_target(given)
    decision = decide(table, compare(table, readings_of(table, ("eye-in-hand",)), evidence), evidence)
    assert f"with a target {named} times as large" in decision.words
    assert "euler-ZYX, mm, base_T_flange" in decision.words


COUNTED = {
    "in squares": (25.0, "multiply the camera's places by 25: are they counted in squares of 25 mm?"),
    "in large squares": (80.0, "multiply the camera's places by 80: are they counted in squares of 80 mm?"),
    "in inches": (25.4, "multiply the camera's places by 25.4, for they are in inches"),
    "in metres": (1000.0, "give --camera-unit m"),
}


@pytest.mark.parametrize("counted", COUNTED)
def test_what_the_camera_s_places_are_counted_in_is_named(counted: str) -> None:
    poses, evidence = _session(20)
    size_mm, fix = COUNTED[counted]
    table, evidence = _table(poses, *_numbers("matrix", poses)), evidence.scale_target(1 / size_mm)
    decision = decide(table, compare(table, readings_of(table, ("eye-in-hand",)), evidence), evidence)
    assert decision.reading is None
    assert decision.fix == fix


CAUSES = {
    "reversed": (lambda poses: poses[::-1], "none fits; the poses are in reversed order"),
    "another tool": (
        lambda poses: np.where(np.arange(14)[:, None, None] < 8, poses, poses @ inverse(X)),
        "from picture 9 on the camera sits elsewhere on the flange",
    ),
    "names as text": (
        lambda poses: poses[[int(one) for one in sorted(map(str, range(14)))]],
        "the poses are in the order of their names as text",
    ),
}


@pytest.mark.parametrize("what", CAUSES)
def test_the_cause_that_solve_would_name_is_named(what: str) -> None:
    poses, evidence = _session(14)
    change, said = CAUSES[what]
    changed = change(poses)
    table = _table(changed, *_numbers("quaternion-wxyz", changed))
    decision = decide(table, compare(table, readings_of(table, ("eye-in-hand",)), evidence), evidence)
    assert decision.reading is None and decision.fix
    assert said in decision.words


STILL = {
    "no turn": (np.zeros(10), "moves without turning"),
    "one axis": (np.linspace(-1.0, 1.0, 10), "all turns are about one axis"),
}


@pytest.mark.parametrize("motion", STILL)
def test_what_the_motions_lack_is_said(motion: str) -> None:
    poses, evidence = _session(10)
    turns, said = STILL[motion]
    poses = transform(rotation_from_vector(turns[:, None] * [0.0, 0.0, 1.0]), poses[:, :3, 3])
    evidence = evidence.with_camera_poses(inverse(poses @ X) @ Y)
    table = _table(poses, *_numbers("matrix", poses))
    decision = decide(table, compare(table, readings_of(table, ("eye-in-hand",)), evidence), evidence)
    assert decision.reading is None
    assert said in decision.words and "--frame" in decision.fix


@pytest.mark.parametrize("turned", [(3,), (3, 7)])
def test_a_board_that_looks_the_same_turned_fits_as_solve_numbers_it(turned: tuple[int, ...]) -> None:
    truth = cell(1, 10)
    problem = truth.problem
    for index in turned:
        problem = with_view(problem, index, board_turned)
    poses, evidence = np.array([view.base_T_flange for view in problem.views]), evidence_of_views(problem)
    table = _table(poses, *_numbers("matrix", poses))
    readings = readings_of(table, ("eye-in-hand",))
    assert not compare(table, readings, evidence)[0].possible
    best = compare(table, readings, evidence, problem.target.points_mm)[0]
    assert best.possible and best.turned and best.readings[0].frame == "base_T_flange"
    straight = compare(table, readings, evidence_of_views(truth.problem), problem.target.points_mm)[0]
    assert straight.possible and not straight.turned


def test_one_stated_reading_needs_no_images() -> None:
    poses, _ = _session(5)
    table = _table(poses, *_numbers("matrix", poses))
    readings = readings_of(table, ("eye-in-hand",), (CONVENTIONS["matrix"],), "mm", "base_T_flange")
    assert decide(table, compare(table, readings, None), None).reading == readings[0]


BESIDE = [
    ExternalAxis("track", 1, np.array([0.0, -1.0, 0.0]), np.zeros(3)),
    ExternalAxis("turntable", 2, np.array([0.0, 0.0, 1.0]), np.array([700.0, -40.0, 0.0])),
    ExternalAxis("turntable", 1, np.array([-1.0, 0.0, 0.0]), np.array([0.0, 120.0, 260.0])),
]


@pytest.mark.parametrize("axis", BESIDE, ids=lambda axis: f"{axis.kind} {axis.number}")
@pytest.mark.parametrize("views", [8, 14])
def test_a_track_or_turntable_that_the_poses_leave_out_is_found(axis: ExternalAxis, views: int) -> None:
    """The table says what each external axis reads, not what it moves; the other one of the two stands."""
    poses, evidence = _session(views)
    values = np.random.default_rng(1).uniform(0.0, 80.0, views)
    reported = inverse(axis.motion(values if axis.kind == "track" else np.radians(values))) @ poses
    readings = np.full((views, 6), np.nan)
    readings[:, :2] = 5.0
    readings[:, axis.number - 1] = values
    table = replace(_table(reported, *_numbers("quaternion-wxyz", reported)), external_axes=readings, unit="mm")
    stated = readings_of(table, ("eye-in-hand",), (CONVENTIONS["quaternion-wxyz"],), frame="base_T_flange")
    decision = decide(table, compare(table, stated, evidence), evidence)
    assert decision.axis is not None, decision.words
    assert (decision.axis.kind, decision.axis.number) == (axis.kind, axis.number)
    assert decision.axis.direction == pytest.approx(axis.direction)
    if axis.kind == "turntable":
        assert decision.axis.point_mm == pytest.approx(axis.point_mm, abs=2.0)
    assert f"a {axis.kind}" in decision.words


def test_an_external_axis_that_explains_nothing_is_not_taken_for_one_beside_the_arm() -> None:
    """It moves, and the poses have its motion in them already, but two of them belong to other pictures."""
    poses, evidence = _session(12)
    table = _table(poses, *_numbers("quaternion-wxyz", poses)).take([1, 0, *range(2, 12)])
    readings = np.random.default_rng(2).uniform(0.0, 80.0, (12, 1))
    table = replace(table, external_axes=readings, unit="mm")
    stated = readings_of(table, ("eye-in-hand",), (CONVENTIONS["quaternion-wxyz"],), frame="base_T_flange")
    assert decide(table, compare(table, stated, evidence), evidence).axis is None

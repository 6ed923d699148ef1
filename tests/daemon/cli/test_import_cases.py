"""Layouts and mistakes of public bug reports: each is read right, or refused with the sentence that helps."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument
from calibration.transforms import difference, inverse, rotation_from_vector, transform, transform_from_quaternion
from tests.daemon.cli.running import handeyed

pytestmark = [pytest.mark.data, pytest.mark.timeout(300)]

X = transform_from_quaternion([45.0, -20.0, 95.0], [0.7193, -0.0069, 0.0431, 0.6933])
TOOL = transform(rotation_from_vector([1.2092, -1.2092, 1.2092]), [0.0, 0.0, 215.0])
IN_HAND = ("--setup", "eye-in-hand")
PICTURES = ("--target", "chessboard:9x6:25", "--camera", "camera.yaml", *IN_HAND)
ARM = ("--arm", "IRB 1600-6/1.45")

SOLVED: dict[str, Sequence[str]] = {
    "camera_poses_in_metres": (*IN_HAND, "--poses", "robot.csv", "--camera-poses", "camera.csv"),
    "joints_with_names": (*PICTURES, "--poses", "joints.csv", *ARM),
    "joints_without_names": (*PICTURES, *ARM),
    "pairs_nested_rotation_translation": IN_HAND,
    "pairs_opencv_json": IN_HAND,
    "pairs_opencv_npz": IN_HAND,
    "pairs_same_file": (*IN_HAND, "--poses", "poses.yml", "--camera-poses", "poses.yml"),
    "pairs_twelve_numbers": IN_HAND,
    "poses_xml_filestorage": (*PICTURES, "--poses", "robot_pose.xml"),
    "rapid_track_not_in_poses": PICTURES,
    "record_with_camera_pose": PICTURES,
    "timestamps_with_underscore": PICTURES,
    "translation_axis_reversed": (*PICTURES, "--axes", "x,-y,z"),
    "urscript_tool_variable": PICTURES,
    "yaml_named_lists": (*PICTURES, "--poses", "robot_poses.yaml"),
}
REFUSED: dict[str, tuple[Sequence[str], str]] = {
    "board_described_too_large": (
        ("--target", "chessboard:11x8:25", *IN_HAND), "set columns = 9, rows = 6 in the target's description",
    ),
    "joints_without_names": (PICTURES, "these look like joint angles: give the arm of joints by --arm"),
    "point_pairs": (("--setup", "eye-to-hand"), "solve them by handeyed.Session.of_points"),
    "translation_axis_reversed": (PICTURES, "the rotations agree to 0.0057 deg, so that target and pairs are right"),
}  # fmt: skip


@pytest.fixture
def cases(real_data: Path) -> Path:
    folder = real_data / "cases"
    if not folder.is_dir():
        pytest.skip("HANDEYED_DATA has no folder cases")
    return folder


@pytest.mark.parametrize("name", SOLVED)
def test_it_is_imported_and_solved_right(
    name: str, cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(cases / name)
    ran = handeyed("import", ".", *SOLVED[name], "--out", tmp_path / "s")
    assert ran.status == 0, ran.err
    solved = handeyed("solve", tmp_path / "s", "--json")
    assert solved.status == 0, solved.err
    found = CalibrationDocument.model_validate_json(solved.out).flange_T_camera
    assert found is not None
    expected = X
    if name == "urscript_tool_variable":
        assert "the program sets the tool camera_tcp p[0, 0, 0.215" in ran.out
        expected = inverse(TOOL) @ X
    off_mm, off_rad = difference(expected, found.transform())
    assert off_mm < 0.5 and np.degrees(off_rad) < 0.05


@pytest.mark.parametrize("name", REFUSED)
def test_it_is_refused_with_what_helps(name: str, cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    options, said = REFUSED[name]
    monkeypatch.chdir(cases / name)
    ran = handeyed("import", ".", *options, "--out", tmp_path / "s")
    assert ran.status == 2
    assert said in ran.err


def test_without_poses_the_error_is_not_about_the_intrinsics(
    cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(cases / "poses_xml_filestorage")
    ran = handeyed("import", ".", *PICTURES, "--out", tmp_path / "s")
    assert ran.status == 0, ran.err


def test_a_trajectory_of_clouds_is_a_scan(cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(cases / "clouds_trajectory_log")
    ran = handeyed("import", ".", "--cloud-unit", "mm", "--frame", "base_T_flange", "--out", tmp_path / "s")
    assert ran.status == 0, ran.err
    assert (tmp_path / "s" / "scan.json").exists()

"""Layouts and mistakes of public bug reports: each is read right, or refused with the sentence that helps."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from calibration.documents.imports.programs import read_rapid
from calibration.kinematics.conventions import CONVENTIONS
from calibration.kinematics.external_axis import ExternalAxis
from calibration.transforms import inverse, quaternion_from_rotation
from tests.daemon.cli.public_cases import CASES, IN_HAND, PICTURES, Case
from tests.daemon.cli.running import handeyed

pytestmark = [pytest.mark.data, pytest.mark.timeout(300)]

REFUSED: dict[str, tuple[Sequence[str], str]] = {
    "board_described_too_large": (
        ("--target", "chessboard:11x8:25", *IN_HAND), "set columns = 9, rows = 6 in the target's description",
    ),
    "joints_without_names": (PICTURES, "these look like joint angles: give the arm of joints by --arm"),
    "point_pairs": (IN_HAND, "pairs of points of a camera on the flange"),
    "translation_axis_reversed": (PICTURES, "the rotations agree to 0.0057 deg, so that target and pairs are right"),
}  # fmt: skip


@pytest.fixture
def cases(real_data: Path) -> Path:
    folder = real_data / "cases"
    if not folder.is_dir():
        pytest.skip("HANDEYED_DATA has no folder cases")
    return folder


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_it_is_imported_and_solved_right(
    case: Case, cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(cases / case.name)
    ran = handeyed("import", ".", *case.stated, "--out", tmp_path / "s")
    assert ran.status == 0, ran.err
    solved = handeyed("solve", tmp_path / "s", "--json")
    assert solved.status == 0, solved.err
    off_mm, off_deg = case.error_of(solved.out)
    assert off_mm < 1.0 and off_deg < 0.06
    assert ("of its tool camera_tcp p[0, 0, 0.215" in ran.out) == (case.name == "urscript_tool_variable")


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


def test_a_turntable_before_the_arm_is_found_from_the_axes_of_robtargets(cases: Path, tmp_path: Path) -> None:
    """The pictures of the track's case, whose poses are told as an arm tells them that stands before a turntable."""
    case = next(one for one in CASES if one.name == "rapid_track_not_in_poses")
    shutil.copytree(cases / case.name, own := tmp_path / "own")
    taught = read_rapid((own / "Teach.mod").read_bytes(), "Teach.mod")
    reported = taught.poses(CONVENTIONS["quaternion-wxyz"], "mm", "base_T_flange")
    assert taught.external_axes is not None
    track = ExternalAxis("track", 1, np.array([0.0, 1.0, 0.0]), np.zeros(3))
    poses = track.at_zero(reported, taught.external_axes[:, 0])
    table = ExternalAxis("turntable", 1, np.array([0.012, -0.009, 0.99989]), np.array([900.0, 60.0, 0.0]))
    angles = np.random.default_rng(4).uniform(-60.0, 60.0, len(poses)).round(3)
    lines = []
    for pose, angle in zip(inverse(table.motion(np.radians(angles))) @ poses, angles, strict=True):
        place, turn = pose[:3, 3].round(4).tolist(), quaternion_from_rotation(pose[:3, :3]).round(7).tolist()
        axes = f"[{angle}{',9E9' * 5}]"
        lines.append(f"CONST robtarget p{len(lines) + 1}:=[{place},{turn},[0,0,0,0],{axes}];")
    (own / "Teach.mod").write_text("\n".join(lines))
    ran = handeyed("import", own, *case.options(own), "--out", tmp_path / "s")
    assert ran.status == 0, ran.err
    assert "a turntable about z of the base (external axis 1" in ran.out
    solved = handeyed("solve", tmp_path / "s", "--json")
    assert solved.status == 0, solved.err
    off_mm, off_deg = case.error_of(solved.out)
    assert off_mm < 1.0 and off_deg < 0.06

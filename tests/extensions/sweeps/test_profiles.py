"""`handeyed profiles`: from a folder of sweeps to the profiler on the flange, and to a cloud in base."""

import json
from pathlib import Path

import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument
from calibration.kinematics.robot_accuracy import RobotNoise
from calibration.transforms import difference, rotation_from_vector, transform
from tests.daemon.calibrations import a_calibration
from tests.daemon.cli.running import handeyed
from tests.extensions.sweeps.profile_sweeps import (
    FLANGE_T_PROFILER,
    OFFSET_S,
    PLANES,
    RADIUS_MM,
    standing_profiles,
    sweeps,
    write_folder,
)

ROBOT = RobotNoise(0.1, float(np.radians(0.01)))
SURFACES = [None] * 7


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("profiles")
    write_folder(folder, SURFACES, sweeps(SURFACES, 3, ROBOT))
    return folder


@pytest.fixture(scope="module")
def calibration(folder: Path) -> Path:
    out = folder / "calibration.json"
    ran = handeyed("profiles", "calibrate", folder, "--out", out)
    assert ran.status == 0, ran.err
    assert "clock: robot minus sensor +4" in ran.out
    return out


def test_x_and_the_clock_offset_are_in_calibration_json(calibration: Path) -> None:
    document = CalibrationDocument.model_validate_json(calibration.read_text())
    assert document.flange_T_camera is not None and document.clock_offset is not None
    translation_mm, rotation_rad = difference(document.flange_T_camera.transform(), FLANGE_T_PROFILER)
    assert translation_mm < 0.5 and rotation_rad < 2e-3
    assert abs(document.clock_offset.offset_s - OFFSET_S) < 5 * document.clock_offset.sigma_s
    assert document.verdict.accepted


def test_sweeps_over_a_plane_come_out_as_the_plane(calibration: Path, tmp_path: Path) -> None:
    write_folder(tmp_path, [1, 1], sweeps([1, 1], 9, ROBOT), artefacts=False)
    ran = handeyed(
        "profiles", "register", tmp_path, "--calibration", calibration, "--out", tmp_path / "part.npy", "--json"
    )
    assert ran.status == 0, ran.err
    points = np.load(tmp_path / "part.npy")
    assert json.loads(ran.out)["points"] == len(points) > 10_000
    place, normal = PLANES[1]
    off = (points - place) @ normal
    assert np.sqrt(np.mean(off**2)) < 0.4


def test_sweeps_that_determine_nothing_are_not_accepted(folder: Path, tmp_path: Path) -> None:
    write_folder(tmp_path, SURFACES[:2], sweeps(SURFACES[:2], 3, ROBOT))
    ran = handeyed("profiles", "calibrate", tmp_path, "--json")
    assert ran.status == 3
    document = json.loads(ran.out)
    assert document["flange_T_camera"] is None and document["clock_offset"] is None
    assert document["verdict"]["findings"][0]["code"] == "too-few-sweeps"


def test_a_calibration_of_a_camera_has_no_clock(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "camera.json").write_text(a_calibration("c1").model_dump_json())
    ran = handeyed(
        "profiles", "register", folder, "--calibration", tmp_path / "camera.json", "--out", tmp_path / "a.ply"
    )
    assert ran.status == 2
    assert "clock_offset" in ran.err
    assert not (tmp_path / "a.ply").exists()


def test_a_folder_without_profiles_is_refused(tmp_path: Path) -> None:
    ran = handeyed("profiles", "calibrate", tmp_path)
    assert ran.status == 2
    assert "profiles.json" in ran.err and "Traceback" not in ran.err


@pytest.mark.parametrize(("artefact", "sphere"), [(f"sphere:{RADIUS_MM}", True), ("edge", False)])
@pytest.mark.parametrize("seed", [1, 2])
def test_bare_profiles_beside_poses_are_a_calibration(artefact: str, sphere: bool, seed: int, tmp_path: Path) -> None:
    standing_profiles(tmp_path, seed, sphere=sphere)
    ran = handeyed("profiles", "calibrate", tmp_path, "--artefact", artefact, "--json")
    assert ran.status == 0, ran.err
    found = CalibrationDocument.model_validate_json(ran.out).flange_T_camera
    assert found is not None
    off_mm, off_rad = difference(FLANGE_T_PROFILER, found.transform())
    assert off_mm < 0.3 and off_rad < 0.002


def test_bare_profiles_may_be_files_of_opencv(tmp_path: Path) -> None:
    """As GilbertPan97/HandEyeSync keeps them: x, y and z of one point after the other below `profile`."""
    standing_profiles(tmp_path, 1, sphere=True)
    for file in [one for one in tmp_path.iterdir() if one.name != "poses.csv"]:
        rows = [line.split(",") for line in file.read_text().splitlines()[1:]]
        listed = ", ".join(f"{x}, 0., {z if z != 'nan' else '-10000.'}" for x, z in rows)
        file.with_suffix(".yml").write_text(f"%YAML:1.0\n---\nprofile: [ {listed} ]\n")
        file.unlink()
    ran = handeyed("profiles", "calibrate", tmp_path, "--artefact", f"sphere:{RADIUS_MM}", "--json")
    assert ran.status == 0, ran.err
    found = CalibrationDocument.model_validate_json(ran.out).flange_T_camera
    assert found is not None
    off_mm, off_rad = difference(FLANGE_T_PROFILER, found.transform())
    assert off_mm < 0.3 and off_rad < 0.002


def test_what_is_missing_beside_bare_profiles_is_named(tmp_path: Path) -> None:
    standing_profiles(tmp_path, 1, sphere=True)
    for artefact, words in (("cube", "'cube' is no artefact"), ("sphere", "'sphere' is no artefact")):
        assert words in handeyed("profiles", "calibrate", tmp_path, "--artefact", artefact).err
    ran = handeyed("profiles", "calibrate", tmp_path, "--artefact", "edge")
    assert ran.status == 3 and "show two lines" in ran.out
    lines = (tmp_path / "poses.csv").read_text().splitlines()
    (tmp_path / "poses.csv").write_text("\n".join([lines[0].replace("qw,qx,qy,qz", "a1,a2,a3,a4"), *lines[1:]]))
    ran = handeyed("profiles", "calibrate", tmp_path, "--artefact", "plane")
    assert ran.status == 2 and "no pose among the names" in ran.err
    (tmp_path / "poses.csv").unlink()
    ran = handeyed("profiles", "calibrate", tmp_path, "--artefact", "plane")
    assert ran.status == 2 and "14 files of profiles (x, z) and 0 of poses" in ran.err


@pytest.mark.data
@pytest.mark.parametrize("stated", [("as_sweeps",), (".", "--artefact", "sphere:25")], ids=["sweeps", "bare"])
def test_profiles_taken_standing_are_a_calibration(stated: tuple[str, ...], real_data: Path) -> None:
    folder = real_data / "cases" / "profiles_taken_standing"
    if not folder.is_dir():
        pytest.skip("HANDEYED_DATA has no folder cases/profiles_taken_standing")
    ran = handeyed("profiles", "calibrate", folder / stated[0], *stated[1:], "--json")
    assert ran.status == 0, ran.err
    found = CalibrationDocument.model_validate_json(ran.out).flange_T_camera
    assert found is not None
    off_mm, off_rad = difference(transform(rotation_from_vector([0, 0, np.pi / 2]), [30, 0, 120]), found.transform())
    assert off_mm < 0.3 and off_rad < 0.002

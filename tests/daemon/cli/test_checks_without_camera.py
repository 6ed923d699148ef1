"""`handeyed verify-scanner` and `stitch`: checks that do not trust the camera."""

import json
from pathlib import Path

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.transforms import Array, inverse, map_points, rotation_from_vector
from tests.daemon.cli.running import Ran, handeyed
from tests.daemon.cli.sessions import TILTS_RAD, base_T_flange
from tests.daemon.fakes import ply_of
from tests.registration.ball_bars import RADIUS_MM, SPACING_MM, bar


@pytest.fixture
def calibration(tmp_path: Path, solved: Ran) -> Path:
    (tmp_path / "calibration.json").write_text(solved.out)
    return tmp_path / "calibration.json"


def a_scan(folder: Path, *clouds: Array) -> Path:
    folder.mkdir()
    pose = PoseDocument.of(np.eye(4)).model_dump(mode="json")
    for index, points in enumerate(clouds):
        (folder / f"{index}.ply").write_bytes(ply_of(points))
    views = [{"cloud": f"{index}.ply", "unit": "mm", "base_T_flange": pose} for index in range(len(clouds))]
    (folder / "scan.json").write_text(json.dumps({"schema_version": 1, "setup": "eye-in-hand", "views": views}))
    return folder


def test_a_scanner_is_verified_with_a_ball_bar_from_files(tmp_path: Path) -> None:
    folder = a_scan(tmp_path / "bar", bar(1), bar(2, longer_mm=0.15))
    asked = ("verify-scanner", folder, "--radius-mm", str(RADIUS_MM), "--spacing-mm", str(SPACING_MM))
    ran = handeyed(*asked, "--json")
    assert (ran.status, ran.err) == (0, "")
    found = json.loads(ran.out)
    assert found["sphere_spacing_mm"] == pytest.approx(0.15, abs=0.005)
    assert len(found["positions"]) == 2
    beyond = handeyed(*asked, "--limit-mm", "0.1")
    assert beyond.status == 3
    assert "sphere spacing +0.15" in beyond.out


def test_a_scan_without_the_sphere_is_refused(tmp_path: Path) -> None:
    flat = np.random.default_rng(0).uniform(-50, 50, (2000, 3)) * [1, 1, 0] + [0, 0, 500]
    ran = handeyed("verify-scanner", a_scan(tmp_path / "flat", flat), "--radius-mm", "20")
    assert ran.status == 2
    assert "position 0" in ran.err


def two_views_of_a_corner(folder: Path, calibrated: Array) -> Path:
    """The three faces of a corner that points upwards, from two poses."""
    folder.mkdir()
    sides = np.random.default_rng(6).uniform(0, 120, (3, 5000, 2))
    faces = [np.insert(side, axis, 0.0, axis=1) for axis, side in enumerate(sides)]
    points = np.concatenate(faces) @ _turned_upwards().T + [900.0, 50.0, 100.0]
    views = []
    for index, tilt in enumerate(TILTS_RAD[:2]):
        pose = base_T_flange(tilt)
        seen = map_points(inverse(pose @ calibrated), points)
        (folder / f"{index}.ply").write_bytes(ply_of(seen))
        flange = PoseDocument.of(pose).model_dump(mode="json")
        views.append({"cloud": f"{index}.ply", "unit": "mm", "base_T_flange": flange})
    (folder / "scan.json").write_text(json.dumps({"schema_version": 1, "setup": "eye-in-hand", "views": views}))
    return folder


def _turned_upwards() -> Array:
    """The rotation that turns (-1, -1, -1) upwards."""
    axis = np.cross([-1.0, -1.0, -1.0], [0.0, 0.0, 1.0])
    angle = np.arccos(-1 / np.sqrt(3))
    return rotation_from_vector(axis / np.linalg.norm(axis) * angle)


def test_the_gap_between_views_is_that_of_a_wrong_calibration(tmp_path: Path, calibration: Path) -> None:
    document = json.loads(calibration.read_bytes())
    x = PoseDocument.model_validate(document["flange_T_camera"]).transform()
    folder = two_views_of_a_corner(tmp_path / "corner", x)
    right = handeyed("stitch", folder, "--calibration", calibration, "--tolerance-mm", "0.1", "--json")
    assert (right.status, right.err) == (0, "")
    found = json.loads(right.out)
    assert found["largest_mm"] < 0.02
    assert [pair["views"] for pair in found["pairs"]] == [[0, 1]]

    # Less than the points' distance, so that neighbours stay neighbours.
    document["flange_T_camera"]["translation_mm"][0] += 0.5
    calibration.write_text(json.dumps(document))
    wrong = handeyed("stitch", folder, "--calibration", calibration, "--tolerance-mm", "0.1", "--json")
    assert wrong.status == 3
    a, b = (base_T_flange(tilt)[:3, 0] * 0.5 for tilt in TILTS_RAD[:2])
    assert json.loads(wrong.out)["pairs"][0]["base_offset_mm"] == pytest.approx((b - a).tolist(), abs=0.05)
    assert "shown by all directions" in handeyed("stitch", folder, "--calibration", calibration).out


def test_views_without_a_common_surface_are_refused(tmp_path: Path, calibration: Path) -> None:
    ran = handeyed("stitch", a_scan(tmp_path / "bar", bar(1), bar(7)), "--calibration", calibration)
    assert ran.status == 2
    assert "no two views show the same surface" in ran.err

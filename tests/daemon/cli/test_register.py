"""`handeyed register`: clouds and poses in, one cloud in the base frame out."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.pose import PoseDocument
from calibration.documents.validation import parse_document
from calibration.kinematics.abb_arms import find_arm
from calibration.transforms import Array, inverse, map_points
from handeyed import register
from tests.daemon.calibrations import an_arm
from tests.daemon.cli.running import Ran, handeyed
from tests.daemon.cli.sessions import FLANGE_T_CAMERA, TILTS_RAD, base_T_flange

POINTS_BASE = np.random.default_rng(3).uniform(-300, 300, (500, 3)) + np.array([900, 0, 100])


def ply(points: Array) -> bytes:
    names = "".join(f"property float {name}\n" for name in "xyz")
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{names}end_header\n"
    return head.encode() + points.astype("<f4").tobytes()


def scan(folder: Path, unit: str = "mm", points: Array = POINTS_BASE) -> Path:
    """The same points seen from six poses."""
    folder.mkdir()
    views = []
    for index, tilt in enumerate(TILTS_RAD):
        seen = map_points(inverse(base_T_flange(tilt) @ FLANGE_T_CAMERA), points)
        (folder / f"view_{index}.ply").write_bytes(ply(seen / (1000.0 if unit == "m" else 1.0)))
        pose = PoseDocument.of(base_T_flange(tilt)).model_dump(mode="json")
        views.append({"cloud": f"view_{index}.ply", "unit": unit, "base_T_flange": pose})
    (folder / "scan.json").write_text(json.dumps({"schema_version": 1, "setup": "eye-in-hand", "views": views}))
    return folder


def points_of(file: Path) -> Array:
    return np.frombuffer(file.read_bytes().partition(b"end_header\n")[2], "<f4").reshape(-1, 3)


@pytest.fixture
def calibration(tmp_path: Path, solved: Ran) -> Path:
    """The sessions' calibration with the true X in it."""
    document = json.loads(solved.out)
    document["flange_T_camera"] = PoseDocument.of(FLANGE_T_CAMERA).model_dump(mode="json")
    (tmp_path / "calibration.json").write_text(json.dumps(document))
    return tmp_path / "calibration.json"


def change(file: Path, **values: Any) -> None:
    file.write_text(json.dumps(json.loads(file.read_text()) | values))


@pytest.mark.parametrize("unit", ["mm", "m"])
def test_views_fall_onto_each_other_in_the_base_frame(tmp_path: Path, calibration: Path, unit: str) -> None:
    ran = handeyed(
        "register", scan(tmp_path / "scan", unit), "--calibration", calibration, "--out", tmp_path / "a.npy", "--json"
    )

    report = json.loads(ran.out)
    assert ran.status == 0
    assert report["points"] == 3000
    assert [view["points"] for view in report["views"]] == [500] * 6
    merged = np.load(tmp_path / "a.npy")
    points = np.column_stack([merged[name] for name in "xyz"]) if merged.dtype.names else merged
    assert np.abs(points.reshape(6, 500, -1)[..., :3] - POINTS_BASE).max() < 2e-3


TRACK = {
    "kind": "track", "number": 1, "direction": [0.0, 0.8, 0.6], "zero": 100.0, "readings": [0.0, 2000.0],
    "off_deg": 0.3, "sigma_mm": 0.1, "expanded_mm": 0.2, "covariance": np.zeros((12, 12)).tolist(),
}  # fmt: skip


def test_views_from_along_a_track_fall_onto_each_other(tmp_path: Path, calibration: Path) -> None:
    change(calibration, external_axis=TRACK)
    folder = scan(tmp_path / "scan")
    views = json.loads((folder / "scan.json").read_text())["views"]
    for number, view in enumerate(views):
        pose = PoseDocument.model_validate(view["base_T_flange"]).transform()
        pose[:3, 3] -= (300.0 * number - 100.0) * np.array([0.0, 0.8, 0.6])
        view["base_T_flange"] = PoseDocument.of(pose).model_dump(mode="json")
    options = "--calibration", calibration, "--out", tmp_path / "a.npy", "--json"
    change(folder / "scan.json", views=views)
    refused = handeyed("register", folder, *options)
    assert (refused.status, "external_axes" in refused.err) == (2, True)
    for number, view in enumerate(views):
        view["external_axes"] = [300.0 * number]
    change(folder / "scan.json", views=views)
    assert handeyed("register", folder, *options).status == 0
    merged = np.load(tmp_path / "a.npy")
    points = np.column_stack([merged[name] for name in "xyz"]) if merged.dtype.names else merged
    assert np.abs(points.reshape(6, 500, -1)[..., :3] - POINTS_BASE).max() < 2e-3


def test_the_flange_is_placed_where_the_arm_as_built_has_it(tmp_path: Path, calibration: Path) -> None:
    """An arm whose axis 2 is 5 mm further out: axis 1 at zero, every point is 5 mm further along x."""
    arm, joints = find_arm("IRB 1600-6/1.45"), np.radians([[0.0, 20, 10, 0, 40, 0], [0.0, 25, 5, 5, 45, 10]])
    errors = an_arm(link_1_tx=5.0).model_copy(update={"mount_T_camera": PoseDocument.of(FLANGE_T_CAMERA)})
    (tmp_path / "arm.json").write_text(errors.model_dump_json())
    folder = scan(tmp_path / "scan")
    views = json.loads((folder / "scan.json").read_text())["views"][:2]
    for row, view in enumerate(views):
        view["base_T_flange"] = PoseDocument.of(arm.forward(joints[row])).model_dump(mode="json")
    views[0]["joints_deg"] = np.degrees(joints[0]).tolist()
    change(folder / "scan.json", views=views)
    files: list[str | Path] = ["register", folder, "--calibration", calibration, "--out"]
    drawn = handeyed(*files, tmp_path / "drawn.npy", "--json")
    built = handeyed(*files, tmp_path / "built.npy", "--arm", tmp_path / "arm.json", "--json")
    assert (drawn.status, built.status) == (0, 0), built.err
    off = np.load(tmp_path / "built.npy") - np.load(tmp_path / "drawn.npy")
    assert np.abs(off[:, :3] - [5.0, 0.0, 0.0]).max() < 1e-3
    codes = [{finding["code"] for finding in json.loads(ran.out)["verdict"]["findings"]} for ran in (drawn, built)]
    assert ["pose-without-joints" in one for one in codes] == [False, True]

    (tmp_path / "warm.json").write_text(errors.model_copy(update={"temperature_c": 24.0}).model_dump_json())
    for stated, warned in (((), True), (("--arm-temperature", "30"), False)):
        warm = handeyed(*files, tmp_path / "warm.npy", "--arm", tmp_path / "warm.json", *stated, "--json")
        codes_of_warm = {finding["code"] for finding in json.loads(warm.out)["verdict"]["findings"]}
        assert ("arm-temperature-unknown" in codes_of_warm) is warned

    (tmp_path / "archive").mkdir()
    folder.rename(tmp_path / "archive" / "scan")
    archived = handeyed("register-archive", tmp_path / "archive", "--calibration", calibration, "--scheduler", "here",
                        "--out", tmp_path / "out", "--arm", tmp_path / "arm.json")  # fmt: skip
    assert archived.status == 0, archived.err
    assert np.allclose(np.load(tmp_path / "built.npy"), points_of(tmp_path / "out" / "scan" / "merged.ply"), atol=1e-3)
    (tmp_path / "archive" / "scan").rename(folder)
    document = parse_document(CalibrationDocument, calibration.read_bytes(), "calibration.json")
    seen = map_points(inverse(base_T_flange(TILTS_RAD[0]) @ FLANGE_T_CAMERA), POINTS_BASE)
    by_library = register(seen, document, arm.forward(joints[0]), joints_deg=np.degrees(joints[0]), arm=errors)
    assert np.allclose(by_library, np.load(tmp_path / "built.npy")[:500], atol=1e-3)

    views[0]["joints_deg"][1] += 30
    change(folder / "scan.json", views=views)
    refused = handeyed(*files, tmp_path / "again.npy", "--arm", tmp_path / "arm.json")
    assert refused.status == 2
    assert "joints" in refused.err


def test_a_person_reads_how_many_points_and_what_was_not_measured(tmp_path: Path, calibration: Path) -> None:
    ran = handeyed("register", scan(tmp_path / "scan"), "--calibration", calibration, "--out", tmp_path / "a.ply")

    assert ran.out.splitlines()[0] == f"{tmp_path / 'a.ply'}: 3,000 points of 6 views, base frame, mm"


def test_a_calibration_that_was_not_accepted_is_reported(tmp_path: Path, calibration: Path) -> None:
    change(calibration, verdict={"accepted": False, "findings": []})

    ran = handeyed("register", scan(tmp_path / "scan"), "--calibration", calibration, "--out", tmp_path / "a.ply")

    assert ran.status == 3
    assert ran.errors == [
        f"{calibration}: verdict: this calibration was not accepted: calibrate again, and register anew"
    ]


class TestRefused:
    """Status 2, a line that says where and what to do, and no file under the asked name."""

    def run(self, tmp_path: Path, calibration: Path, folder: Path, out: str = "a.ply") -> Ran:
        ran = handeyed("register", folder, "--calibration", calibration, "--out", tmp_path / out)
        assert ran.status == 2
        assert ran.out == ""
        assert not (tmp_path / out).exists()
        return ran

    def test_no_folder(self, tmp_path: Path, calibration: Path) -> None:
        ran = self.run(tmp_path, calibration, tmp_path / "no")
        assert str(tmp_path / "no") in ran.err

    def test_a_calibration_without_a_transform(self, tmp_path: Path, calibration: Path) -> None:
        change(calibration, flange_T_camera=None)
        assert "flange_T_camera" in self.run(tmp_path, calibration, scan(tmp_path / "scan")).err

    def test_a_cloud_that_is_cut_off(self, tmp_path: Path, calibration: Path) -> None:
        folder = scan(tmp_path / "scan")
        (folder / "view_4.ply").write_bytes((folder / "view_4.ply").read_bytes()[:-7])
        assert "view_4.ply" in self.run(tmp_path, calibration, folder).err

    def test_a_cloud_that_is_missing(self, tmp_path: Path, calibration: Path) -> None:
        folder = scan(tmp_path / "scan")
        (folder / "view_2.ply").unlink()
        assert "view_2.ply" in self.run(tmp_path, calibration, folder).err

    @pytest.mark.parametrize("unit", [None, "inch"])
    def test_a_unit_nobody_knows(self, tmp_path: Path, calibration: Path, unit: str | None) -> None:
        folder = scan(tmp_path / "scan")
        views = json.loads((folder / "scan.json").read_text())["views"]
        views[1]["unit"] = unit
        change(folder / "scan.json", views=views)
        assert "views[1].unit" in self.run(tmp_path, calibration, folder).err

    def test_a_cloud_outside_the_folder(self, tmp_path: Path, calibration: Path) -> None:
        folder = scan(tmp_path / "scan")
        views = json.loads((folder / "scan.json").read_text())["views"]
        views[0]["cloud"] = "../a.ply"
        change(folder / "scan.json", views=views)
        assert "leaves the folder" in self.run(tmp_path, calibration, folder).err

    def test_a_format_that_is_not_written(self, tmp_path: Path, calibration: Path) -> None:
        assert "'.doc'" in self.run(tmp_path, calibration, scan(tmp_path / "scan"), "a.doc").err


def test_refined_views_lie_closer_to_each_other(tmp_path: Path, calibration: Path) -> None:
    x, y = np.meshgrid(np.linspace(-150, 150, 60), np.linspace(-150, 150, 60))
    z = 15 * np.sin(x / 35) * np.cos(y / 45) + 0.001 * x * y
    surface = np.column_stack([x.ravel() + 900, y.ravel(), z.ravel() + 100])
    folder = scan(tmp_path / "scan", points=surface)
    document = json.loads((folder / "scan.json").read_text())
    for view in document["views"][1:]:
        view["base_T_flange"]["translation_mm"][2] += 0.4  # the robot's error
    (folder / "scan.json").write_text(json.dumps(document))
    change(calibration, noise={"image_px": 0.05, "robot_translation_mm": 0.4, "robot_rotation_deg": 0.01})

    arguments: list[str | Path] = [
        "register",
        folder,
        "--calibration",
        calibration,
        "--out",
        tmp_path / "a.ply",
        "--refine",
    ]
    report = json.loads(handeyed(*arguments, "--json").out)

    assert report["rms_mm"]["after"] < 0.5 * report["rms_mm"]["before"]
    assert all(view["correction"] is not None for view in report["views"])
    assert "mm after refinement" in handeyed(*arguments).out


@pytest.mark.parametrize("shape", [(500,), (20, 25)], ids=["in a row", "organised"])
def test_clouds_of_an_npz_are_registered(tmp_path: Path, calibration: Path, shape: tuple[int, ...]) -> None:
    folder = scan(tmp_path / "scan")
    views = json.loads((folder / "scan.json").read_text())["views"]
    for view in views:
        points = points_of(folder / view["cloud"]).reshape(*shape, 3)
        view["cloud"] = view["cloud"].replace(".ply", ".npz")
        np.savez(folder / view["cloud"], points=points, intensity=points[..., 2])
    change(folder / "scan.json", views=views)
    ran = handeyed("register", folder, "--calibration", calibration, "--out", tmp_path / "a.npy", "--json")
    assert (ran.status, json.loads(ran.out)["points"]) == (0, 3000), ran.err
    merged = np.load(tmp_path / "a.npy")
    assert merged.dtype.names == ("x", "y", "z", "intensity")
    moved = np.column_stack([merged[name] for name in "xyz"]).reshape(6, 500, 3)
    assert np.abs(moved - POINTS_BASE).max() < 2e-3


@pytest.mark.parametrize("points", [np.empty((0, 3)), np.full((5, 3), np.nan)], ids=["none", "not finite"])
def test_a_scan_without_points_is_not_accepted(tmp_path: Path, calibration: Path, points: Array) -> None:
    ran = handeyed(
        "register", scan(tmp_path / "scan", points=points), "--calibration", calibration, "--out", tmp_path / "a.ply"
    )
    assert ran.status == 3
    assert "0 points of 6 views" in ran.out
    assert "the merged cloud of 6 views has no points\n    -> scan where the part is within" in ran.out


def test_a_unit_that_cannot_be_is_refused_without_force(tmp_path: Path, calibration: Path) -> None:
    folder = scan(tmp_path / "scan", "m")
    views = json.loads((folder / "scan.json").read_text())["views"]
    change(folder / "scan.json", views=[{**view, "unit": "mm"} for view in views])
    options = ["register", folder, "--calibration", calibration, "--out", tmp_path / "a.ply"]
    refused = handeyed(*options)
    assert (refused.status, (tmp_path / "a.ply").exists()) == (2, False)
    assert "every point is nearer than 1 mm" in refused.err
    forced = handeyed(*options, "--force")
    assert (forced.status, "every point is nearer than 1 mm" in forced.out) == (3, True)

"""`handeyed import`: from pictures and poses that somebody has written to a session that `handeyed solve` accepts."""

import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.readings import compare, decide, readings_of
from calibration.documents.view_evidence import evidence_of_views
from calibration.kinematics.conventions import CONVENTIONS
from calibration.transforms import Array
from daemon.sessions.session_reader import load_problem, open_session
from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import CAMERA, FLANGE_T_CAMERA, TILTS_RAD, base_T_flange, picture, with_images

TARGET = "charuco:7x5:30:22:DICT_5X5_100"
POSES: Array = np.array([base_T_flange(tilt) for tilt in TILTS_RAD])


def _folder(folder: Path, rows: list[str], name: str = "poses.csv") -> Path:
    folder.mkdir()
    for number, tilt in enumerate(TILTS_RAD, 7):  # view_7 ... view_12: natural order is not that of the alphabet
        (folder / f"view_{number}.png").write_bytes(picture(tilt))
    (folder / name).write_text("\n".join(rows) + "\n")
    return folder


def _rows(order: str, metres: bool = False) -> list[str]:
    angles = Rotation.from_matrix(POSES[:, :3, :3]).as_euler(order, degrees=True)
    places = POSES[:, :3, 3] / (1000 if metres else 1)
    return [",".join(map(repr, row)) for row in np.concatenate([places, angles], axis=1).tolist()]


@pytest.fixture(scope="module")
def euler(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pictures and poses in metres with Euler angles ZYX, without a header."""
    return _folder(tmp_path_factory.mktemp("own") / "cell", _rows("ZYX", metres=True))


def test_a_csv_without_a_header_becomes_a_session(euler: Path, tmp_path: Path) -> None:
    ran = handeyed("import", euler, "--out", tmp_path / "s", "--target", TARGET, "--setup", "eye-in-hand")
    assert ran.status == 0, ran.err
    assert "fits: euler-ZYX, m, base_T_flange, eye-in-hand" in ran.out
    assert "times worse" in ran.out
    assert "view_7.png - 1, view_8.png - 2" in ran.out
    assert "first pose   the flange is at x " in ran.out
    document = json.loads((tmp_path / "s" / "session.json").read_text())
    assert [view["image"] for view in document["views"]] == [f"view_{at}.png" for at in range(7, 13)]
    seen = np.array([view["base_T_flange"]["translation_mm"] for view in document["views"]])
    np.testing.assert_allclose(seen, POSES[:, :3, 3], atol=1e-6)


@pytest.mark.slow
def test_what_was_imported_is_solved(euler: Path, tmp_path: Path) -> None:
    camera = _camera(tmp_path)
    given = ("--target", TARGET, "--setup", "eye-in-hand", "--camera", camera)
    assert handeyed("import", euler, "--out", tmp_path / "s", *given).status == 0
    solved = handeyed("solve", tmp_path / "s", "--json")
    found = json.loads(solved.out)["flange_T_camera"]["translation_mm"]
    np.testing.assert_allclose(found, FLANGE_T_CAMERA[:3, 3], atol=0.5)
    again = handeyed("solve", tmp_path / "s", "--json", "--camera", camera)
    assert json.loads(again.out)["flange_T_camera"]["translation_mm"] == pytest.approx(found, abs=1e-6)


def _camera(folder: Path) -> Path:
    file = folder / "camera.yaml"
    (fx, _, cx), (_, fy, cy), _ = CAMERA.matrix.tolist()
    file.write_text(
        f"image_width: 640\nimage_height: 480\ncamera_matrix:\n  data: [{fx}, 0, {cx}, 0, {fy}, {cy}, 0, 0, 1]\n"
        "distortion_model: plumb_bob\ndistortion_coefficients:\n  data: [0, 0, 0, 0, 0]\n"
    )
    return file


def test_where_the_camera_is_is_asked_when_nothing_says_it(euler: Path, tmp_path: Path) -> None:
    ran = handeyed("import", euler, "--out", tmp_path / "s", "--target", TARGET)
    assert ran.status == 2
    assert "are the same equations: give --setup eye-in-hand" in ran.err
    assert not (tmp_path / "s").exists()


def test_a_frame_that_is_stated_decides_where_the_camera_is(euler: Path, tmp_path: Path) -> None:
    ran = handeyed(
        "import", euler, "--out", tmp_path / "s", "--target", TARGET, "--frame", "base_T_flange",
        "--convention", "kuka", "--unit", "m", "--json",
    )  # fmt: skip
    assert ran.status == 0, ran.err
    assert json.loads(ran.out)["setup"] == "eye-in-hand"


def test_a_wrong_convention_is_not_hidden(euler: Path, tmp_path: Path) -> None:
    ran = handeyed(
        "import",
        euler,
        "--out",
        tmp_path / "s",
        "--target",
        TARGET,
        "--convention",
        "staubli",
        "--setup",
        "eye-in-hand",
    )
    assert ran.status == 2
    assert "none fits as stated; without --convention they agree to" in ran.err
    assert "(euler-ZYX, m, base_T_flange, eye-in-hand)" in ran.err and "leave --convention out" in ran.err


def test_intrinsics_of_another_camera_are_named(euler: Path, tmp_path: Path) -> None:
    """Of half the pictures' size, without a size: no reading fits with them, one does with estimated ones."""
    other = json.dumps({"K": [[450.0, 0, 160], [0, 450.0, 120], [0, 0, 1]], "D": [0.0] * 5})
    (tmp_path / "K.json").write_text(other)
    asked = ("--target", TARGET, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    ran = handeyed("import", euler, *asked, "--camera", tmp_path / "K.json")
    assert ran.status == 2
    assert "none fits as stated; with intrinsics estimated from the pictures they agree to" in ran.err
    assert f"{tmp_path / 'K.json'} is of another camera, focus or picture size: leave --camera out" in ran.err

    folder = _folder(tmp_path / "cell", _rows("ZYX"))
    (folder / "K.json").write_text(other)
    ran = handeyed("import", folder, *asked)
    assert "K.json is of another camera, focus or picture size: take it out of the folder" in ran.err


WRONG_TARGETS = {
    "in metres": ("charuco:7x5:0.03:0.022:DICT_5X5_100", "give the sizes of --target in mm, such as 25 for 0.025"),
    "another": (
        "charuco:5x7:30:22:DICT_5X5_100",
        "poses: the target is not found in 6 of 6 pictures: no ChArUco board",
    ),
}


@pytest.mark.parametrize("target", WRONG_TARGETS)
def test_a_target_that_does_not_fit_is_what_is_corrected(target: str, euler: Path, tmp_path: Path) -> None:
    given, said = WRONG_TARGETS[target]
    ran = handeyed("import", euler, "--target", given, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2
    assert said in ran.err and "--camera-unit" not in ran.err


def test_the_target_is_asked(euler: Path, tmp_path: Path) -> None:
    ran = handeyed("import", euler, "--out", tmp_path / "s")
    assert ran.status == 2
    assert "target: not stated by the folder: give --target: chessboard:COLUMNSxROWS:pitch_mm" in ran.err


def test_one_wrong_format_is_one_line(tmp_path: Path) -> None:
    folder = _folder(tmp_path / "cell", ["x,y,z,aa,bb,cc", *_rows("ZYX")])
    ran = handeyed("import", folder, "--out", tmp_path / "s", "--target", TARGET)
    assert ran.status == 2
    assert len(ran.errors) == 1
    assert "poses.csv: header: no pose among the names x, y, z, aa, bb, cc: name the numbers" in ran.err


def test_poses_that_are_all_the_same_are_refused(tmp_path: Path) -> None:
    folder = _folder(tmp_path / "cell", _rows("ZYX")[:1] * 6)
    ran = handeyed("import", folder, "--out", tmp_path / "s", "--target", TARGET)
    assert ran.status == 2
    assert "poses: all 6 poses are the same" in ran.err


def test_a_camera_of_another_picture_size_is_what_is_corrected(euler: Path, tmp_path: Path) -> None:
    camera = _camera(tmp_path)
    camera.write_text(camera.read_text().replace("image_width: 640", "image_width: 1280"))
    ran = handeyed("import", euler, "--out", tmp_path / "s", "--target", TARGET, "--camera", camera)
    assert (ran.status, len(ran.errors)) == (2, 1)
    assert (
        "--camera: 1280 x 480, but the pictures are 640 x 480: give intrinsics found at the pictures' size" in ran.err
    )


def test_one_picture_of_another_size_is_named_with_what_to_do(tmp_path: Path) -> None:
    folder = _folder(tmp_path / "cell", _rows("ZYX"))
    cv2.imwrite(str(folder / "view_7.png"), np.zeros((640, 480), np.uint8))  # held upright
    ran = handeyed("import", folder, "--out", tmp_path / "s", "--target", TARGET)
    assert (ran.status, len(ran.errors)) == (2, 1)
    assert "view_7.png' is 480 x 640 pixels where the session has 640 x 480: take it again, or leave it out" in ran.err


def test_one_pose_is_not_taken_for_none(tmp_path: Path) -> None:
    folder = _folder(tmp_path / "cell", _rows("ZYX")[:1])
    ran = handeyed("import", folder, "--out", tmp_path / "s", "--target", TARGET)
    assert ran.status == 2
    assert "poses.csv: poses: one pose only: give one of each picture, three or more" in ran.err


def test_a_missing_pose_is_refused_with_both_lists(tmp_path: Path) -> None:
    folder = _folder(tmp_path / "cell", _rows("ZYX")[:-1])
    ran = handeyed("import", folder, "--out", tmp_path / "s", "--target", TARGET)
    assert ran.status == 2
    assert "6 pictures (view_7.png, view_8.png, view_9.png, ..., view_12.png) and 5 poses (1, 2, 3, ..., 5)" in ran.err


def test_links_and_devices_are_not_followed(tmp_path: Path) -> None:
    folder = _folder(tmp_path / "cell", _rows("ZYX"))
    secret = tmp_path / "secret.csv"
    secret.write_text("x,y,z,qw,qx,qy,qz\n1,2,3,1,0,0,0\n")
    (folder / "link.csv").symlink_to(secret)
    os.mkfifo(folder / "pipe.csv")
    ran = handeyed("import", folder, "--out", tmp_path / "s", "--target", TARGET, "--setup", "eye-in-hand")
    assert ran.status == 0, ran.err
    assert "1 links are not followed" in ran.out
    ran = handeyed("import", folder, "--out", tmp_path / "t", "--target", TARGET, "--poses", "link.csv")
    assert ran.status == 2


def test_an_own_session_is_imported_unchanged(tmp_path: Path) -> None:
    own = with_images(tmp_path / "own")
    ran = handeyed("import", own, "--out", tmp_path / "s", "--target", TARGET, "--setup", "eye-in-hand")
    assert ran.status == 0, ran.err
    before, after = (json.loads((folder / "session.json").read_text())["views"] for folder in (own, tmp_path / "s"))
    assert [view["image"] for view in before] == [view["image"] for view in after]
    for one, other in zip(before, after, strict=True):
        for key in ("translation_mm", "quaternion_wxyz"):
            np.testing.assert_allclose(one["base_T_flange"][key], other["base_T_flange"][key], atol=1e-9)


@pytest.mark.slow
def test_whose_poses_they_are_stays_with_the_session_and_what_is_made_of_it(tmp_path: Path) -> None:
    """From the names of a table to the import, the session, another import of it, the verdict and the exports."""
    rows = [f"view_{at}.png,{row}" for at, row in enumerate(_rows("ZYX"), 7)]
    cell = _folder(tmp_path / "cell", ["image,tcp_x,tcp_y,tcp_z,tcp_a,tcp_b,tcp_c", *rows])
    said = ("--target", TARGET, "--setup", "eye-in-hand")
    ran = handeyed("import", cell, "--out", tmp_path / "s", *said)
    assert "note         the robot's poses are of tcp: flange_T_camera is the camera's pose in tcp" in ran.out
    assert handeyed("import", tmp_path / "s", "--out", tmp_path / "again", *said).status == 0
    for session in ("s", "again"):
        document = json.loads((tmp_path / session / "session.json").read_text())
        assert document["poses_of"] == {"tool": "tcp", "base": ""}

    assert "! the robot's poses are of tcp:" in handeyed("solve", tmp_path / "s", "--out", tmp_path / "x.json").out
    assert "camera_optical_frame in tcp" in handeyed("export", tmp_path / "x.json", "--as", "rapid").out
    refused = handeyed("export", tmp_path / "s" / "session.json", "--as", "rapid-robtarget")
    assert (refused.status, "poses of a tool or work object, not of tool0 in wobj0" in refused.err) == (2, True)


def test_pictures_within_the_file_of_the_poses_are_written_beside_the_session(tmp_path: Path) -> None:
    seen = [cv2.imdecode(np.frombuffer(picture(tilt), np.uint8), cv2.IMREAD_COLOR) for tilt in TILTS_RAD]
    (tmp_path / "cell").mkdir()
    np.savez_compressed(tmp_path / "cell" / "views.npz", poses=POSES, color=np.array(seen))
    ran = handeyed("import", tmp_path / "cell", "--out", tmp_path / "s", "--target", TARGET, "--setup", "eye-in-hand")
    assert ran.status == 0, ran.err
    views = json.loads((tmp_path / "s" / "session.json").read_text())["views"]
    for at, view in enumerate(views):
        np.testing.assert_array_equal(cv2.imread(str(tmp_path / "s" / view["image"])), seen[at])
    assert handeyed("solve", tmp_path / "s", "--tolerance", "20").status == 0


def test_the_folder_to_write_must_be_new(euler: Path, tmp_path: Path) -> None:
    (tmp_path / "s").mkdir()
    (tmp_path / "s" / "mine.txt").write_text("keep")
    ran = handeyed("import", euler, "--out", tmp_path / "s", "--target", TARGET, "--setup", "eye-in-hand")
    assert ran.status == 2
    assert "--out: not an empty folder: name a new one" in ran.err


def test_samples_of_easy_handeye_need_no_option(tmp_path: Path) -> None:
    folder = tmp_path / "samples"
    folder.mkdir()
    rng = np.random.default_rng(1)
    samples = []
    for pose in POSES:
        turn = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
        robot = {"translation": dict(zip("xyz", (pose[:3, 3] / 1000).tolist(), strict=True)),
                 "rotation": dict(zip("xyzw", turn, strict=True))}  # fmt: skip
        seen = {
            "translation": dict(zip("xyz", rng.uniform(0.1, 0.5, 3).tolist(), strict=True)),
            "rotation": robot["rotation"],
        }
        samples.append({"robot": robot, "tracking": seen})
    (folder / "cell.samples").write_text(
        json.dumps({"parameters": {"calibration_type": "eye_in_hand"}, "samples": samples})
    )
    ran = handeyed("import", folder, "--out", tmp_path / "s")
    assert ran.status == 0, ran.err
    document = json.loads((tmp_path / "s" / "session.json").read_text())
    assert document["setup"] == "eye-in-hand"
    assert set(document["views"][0]) == {"base_T_flange", "camera_T_target"}


def test_one_file_for_both_sides_is_no_measurement(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    np.save(tmp_path / "in" / "poses.npy", POSES)
    both = ("--poses", "poses.npy", "--camera-poses", "poses.npy")
    for setup in ("eye-in-hand", "eye-to-hand"):
        ran = handeyed("import", tmp_path / "in", *both, "--setup", setup, "--out", tmp_path / "s")
        assert ran.status == 2
        assert "are the same numbers: give the poses that the robot reported" in ran.err


def test_clouds_with_stanford_s_transforms_become_a_scan(tmp_path: Path) -> None:
    beside = tmp_path / "beside"
    together = tmp_path / "together"
    turns = Rotation.from_matrix(POSES[:3, :3, :3]).as_quat()
    for folder in (beside, together):
        folder.mkdir()
        for at in range(3):
            (folder / f"scan_{at}.ply").write_bytes(b"ply\n")
    for at, pose in enumerate(POSES[:3]):  # one matrix beside each cloud
        np.savetxt(beside / f"scan_{at}.xf", pose)
    numbers = np.concatenate([POSES[:3, :3, 3], turns], axis=1).tolist()
    meshes = [f"bmesh scan_{at}.ply {' '.join(map(repr, numbers[at]))}" for at in (2, 1, 0)]
    (together / "scans.conf").write_text("\n".join(["camera 0 0 0 0 0 0 1", *meshes]))
    for folder, order in ((beside, [0, 1, 2]), (together, [2, 1, 0])):
        ran = handeyed("import", folder, "--out", tmp_path / f"{folder.name}_s", "--cloud-unit", "mm")
        assert ran.status == 0, ran.err
        views = json.loads((tmp_path / f"{folder.name}_s" / "scan.json").read_text())["views"]
        assert [view["cloud"] for view in views] == [f"scan_{at}.ply" for at in order]
        np.testing.assert_allclose(
            [view["base_T_flange"]["translation_mm"] for view in views], POSES[order, :3, 3], atol=1e-6
        )


def test_clouds_without_a_target_become_a_scan(tmp_path: Path) -> None:
    folder = tmp_path / "scan"
    folder.mkdir()
    for at in range(3):
        (folder / f"cloud_{at}.pcd").write_bytes(b"# .PCD v0.7\n")
    turns = Rotation.from_matrix(POSES[:3, :3, :3]).as_quat()
    rows = np.concatenate([POSES[:3, :3, 3], np.roll(turns, 1, axis=1)], axis=1).tolist()
    (folder / "poses.csv").write_text("x,y,z,qw,qx,qy,qz\n" + "\n".join(",".join(map(repr, row)) for row in rows))
    ran = handeyed("import", folder, "--out", tmp_path / "s")
    assert ran.status == 2
    assert "clouds: their unit is not stated: give --cloud-unit m or mm" in ran.err
    ran = handeyed("import", folder, "--out", tmp_path / "s", "--cloud-unit", "m")
    assert ran.status == 0, ran.err
    assert [view["unit"] for view in json.loads((tmp_path / "s" / "scan.json").read_text())["views"]] == ["m"] * 3


CONVENTION_NAMES = ("euler-ZYX", "euler-xyz-rad", "euler-ZYZ", "rotation-vector-deg", "quaternion-xyzw")


@pytest.mark.slow
@pytest.mark.data
def test_the_convention_of_a_real_session_is_found(real_data: Path, tmp_path: Path) -> None:
    session = open_session(real_data / "ic_circles")
    problem = load_problem(session)
    evidence = evidence_of_views(problem)
    poses = np.array([view.base_T_flange for view in problem.views])
    for name in CONVENTION_NAMES:
        convention = CONVENTIONS[name]
        rotations = Rotation.from_matrix(poses[:, :3, :3])
        if convention.kind == "quaternion":
            numbers = rotations.as_quat()
        elif convention.order == "vector":
            numbers = np.degrees(rotations.as_rotvec())
        else:
            numbers = rotations.as_euler(convention.order, degrees=convention.degrees)
        labels = tuple(str(at) for at in range(len(poses)))
        table = PoseTable("real", labels, poses[:, :3, 3] / 1000, numbers, convention.kind, "numbers")
        found = decide(table, compare(table, readings_of(table, ("eye-in-hand",)), evidence), evidence)
        assert found.reading is not None, (name, found.words)
        read = table.poses(found.reading.convention, found.reading.unit, found.reading.frame)
        np.testing.assert_allclose(read, poses, atol=1e-6, err_msg=name)

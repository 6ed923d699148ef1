"""Poses of robot and camera in the shapes in which people have them: every layout gives the same pairs."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import handeyed as library
from calibration.documents.calibration import CalibrationDocument
from calibration.errors import DocumentError
from calibration.transforms import (
    Array,
    difference,
    inverse,
    map_points,
    rotation_from_vector,
    transform,
)
from daemon.sessions.session_import.request import ImportRequest
from daemon.sessions.session_import.understand import understand
from tests.calibration.documents.imports.file_damage import DAMAGES
from tests.calibration.documents.imports.written import lines, npy, npz
from tests.daemon.cli.pose_pair_layouts import (
    CAMERA,
    EULER,
    LAYOUTS,
    ROBOT,
    Q,
    R,
    V,
    X,
    Y,
    json_of,
    r,
    rows_of,
    s,
    t,
    v,
)
from tests.daemon.cli.running import handeyed


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_pairs_are_read(layout: str, tmp_path: Path) -> None:
    for name, content in LAYOUTS[layout].items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    understood = understand(ImportRequest(tmp_path, setup="eye-in-hand"))
    assert understood.camera_T_target is not None
    n, in_order = len(understood.base_T_flange), np.argsort(understood.base_T_flange[:, 0, 3])
    assert n == 8 or "three rows" in layout
    of_robot = np.argsort(ROBOT[:n, 0, 3])
    np.testing.assert_allclose(understood.base_T_flange[in_order], ROBOT[of_robot], atol=1e-4)
    np.testing.assert_allclose(understood.camera_T_target[in_order], CAMERA[of_robot], atol=1e-4)


EXCHANGED = {
    "the names of the sides": {"robot": CAMERA, "camera": ROBOT},
    "the direction of the camera's": {"robot": ROBOT, "camera": inverse(CAMERA)},
    "the direction of both": {"robot": inverse(ROBOT), "camera": inverse(CAMERA)},
}


@pytest.mark.parametrize("what", EXCHANGED)
def test_a_flange_that_would_carry_what_is_in_the_base_is_asked_about(what: str, tmp_path: Path) -> None:
    """These poses fit exactly, with X and the target's pose in each other's place."""
    (tmp_path / "a.json").write_bytes(json_of(EXCHANGED[what]))
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2
    assert "with sides or directions other than their names say, what it carries would be near to it" in ran.err


CHANGES: dict[str, tuple[Callable[[Array], Array], str]] = {
    "y reversed": (lambda places: places * [1, -1, 1], "with y reversed the translations agree as well"),
    "x and y exchanged": (lambda places: places[:, [1, 0, 2]], "give --axes=y,x,z"),
    "inches": (lambda places: places / 25.4, "with places in inches"),
    "the camera's in centimetres": (lambda places: 10.0 * places, "multiply the camera's places by 10"),
    "the camera's in inches": (lambda places: 25.4 * places, "for they are in inches"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_translations_that_do_not_fit_beside_rotations_that_do_are_explained(change: str, tmp_path: Path) -> None:
    places, said = CHANGES[change]
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.npz").write_bytes(
        npz(R_gripper2base=R, t_gripper2base=places(t), R_target2cam=r, t_target2cam=s)
    )
    ran = handeyed("import", tmp_path / "in", "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2
    assert "the rotations agree to" in ran.err and said in ran.err
    if "--axes" in ran.err:
        axes = ran.err.split("--axes=")[1].split(",")[:3]
        given = f"--axes={','.join(axes)}"
        ran = handeyed("import", tmp_path / "in", "--setup", "eye-in-hand", given, "--out", tmp_path / "s")
        assert ran.status == 0, ran.err


@pytest.mark.parametrize(("factor", "shown"), [(0.1, "as mm"), (1 / 25.4, "as mm"), (0.01, "as m,")])
def test_lengths_of_both_sides_that_no_arm_has_are_asked_for(factor: float, shown: str, tmp_path: Path) -> None:
    """In centimetres, inches or decimetres both sides agree, and X would be as wrong as they are."""
    arrays = {"R_gripper2base": R, "t_gripper2base": factor * t, "R_target2cam": r, "t_target2cam": factor * s}
    (tmp_path / "a.npz").write_bytes(npz(**arrays))
    asked = ("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    ran = handeyed(*asked)
    assert ran.status == 2
    assert f"lengths without a unit are taken {shown}" in ran.err and "name the unit of both sides" in ran.err
    if shown == "as mm":
        assert handeyed(*asked, "--unit", "mm").status == 0


def _transposed(at: int, off_deg: float = 0.0) -> tuple[Array, Array]:
    """The camera's poses, of which one has its rotation transposed, and which are off by so much about any axis."""
    axes = np.random.default_rng(38).normal(size=(len(CAMERA), 3))
    axes *= np.radians(off_deg) / np.linalg.norm(axes, axis=1, keepdims=True)
    changed = CAMERA.copy()
    changed[:, :3, :3] = rotation_from_vector(axes) @ CAMERA[:, :3, :3]
    changed[at, :3, :3] = changed[at, :3, :3].T
    return ROBOT, changed


WRONG_PAIRS = {
    "one more of the camera's at the begin": (
        (ROBOT[1:], CAMERA[:-1]), "the poses are off by one: image k was taken at pose k - 1",
    ),
    "one more of the robot's": ((ROBOT[:-1], CAMERA[1:]), "image k was taken at pose k + 1"),
    "one transposed": (_transposed(4), "without pose 5 the rotations agree"),
    "one transposed among worse ones": (_transposed(4, off_deg=0.9), "the pose of picture 5 disagrees with all others"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG_PAIRS)
def test_wrong_pairs_are_named(what: str, tmp_path: Path) -> None:
    (robot, camera), said = WRONG_PAIRS[what]
    (tmp_path / "a.npz").write_bytes(npz(robot=robot, camera=camera))
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2 and "none fits" in ran.err
    assert said in ran.err


def test_the_camera_s_unit_and_convention_may_be_stated(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "robot.csv").write_bytes(lines("x,y,z,qw,qx,qy,qz", *rows_of(t, Q)))
    (tmp_path / "in" / "camera.csv").write_bytes(lines(*rows_of(s / 1000, v)))
    given = (
        "import",
        tmp_path / "in",
        "--poses",
        "robot.csv",
        "--camera-poses",
        "camera.csv",
        "--setup",
        "eye-in-hand",
    )
    stated = ("--camera-unit", "m", "--camera-convention", "rotation-vector", "--arm", "IRB 1600-6/1.45")
    ran = handeyed(*given, *stated, "--out", tmp_path / "s")
    assert ran.status == 0, ran.err
    assert "the camera's poses: rotation-vector, m" in ran.out
    assert "--arm is not used: the file holds poses" in ran.out
    assert handeyed(*given, "--camera-unit", "mm", "--out", tmp_path / "t").status == 2


def test_two_poses_whose_names_do_not_decide_are_asked_for(tmp_path: Path) -> None:
    records = json_of([{"first": a, "second": b} for a, b in zip(ROBOT, CAMERA, strict=True)])
    (tmp_path / "a.json").write_bytes(records)
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2
    assert "2 poses in a record (first, second), and their names do not say whose" in ran.err


def test_a_damaged_pose_of_the_robot_is_named_and_the_camera_s_not_taken_alone(tmp_path: Path) -> None:
    damaged = ROBOT.copy()
    damaged[3, 3] = [0, 0, 0, 5]
    (tmp_path / "a.json").write_bytes(json_of([{"robot": a, "board": b} for a, b in zip(damaged, CAMERA, strict=True)]))
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2
    assert "pose 4: the last row of the 4 x 4 matrix is not 0, 0, 0, 1" in ran.err


def test_rows_of_a_path_are_no_pairs(tmp_path: Path) -> None:
    """Neighbours on a path are alike: taken as two sides, they would be one pose seen twice."""
    along = np.linspace(0.0, 1.0, 12)[:, None]
    path = np.concatenate([[900.0, 0.0, 400.0] + along * [200.0, 50.0, 80.0], along * [0.4, -0.3, 0.5]], axis=1)
    (tmp_path / "path.csv").write_bytes(lines(*rows_of(path)))
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2
    assert "no pictures and no clouds" in ran.err


POINTS = np.random.default_rng(4).uniform(-200.0, 200.0, (10, 3))
STANDING = transform(rotation_from_vector([3.0, 0.2, -0.1]), [820.0, 40.0, 1150.0])
TOUCHED = map_points(STANDING, POINTS)

POINT_PAIRS = {
    "names of both sides": ("p.csv", lines("robot_x,robot_y,robot_z,cam_x,cam_y,cam_z", *rows_of(TOUCHED, POINTS))),
    "arrays, the camera's in metres": (
        "p.json", json.dumps({"p_cam": (POINTS / 1000).tolist(), "p_robot": TOUCHED.tolist()}).encode(),
    ),
    "records": (
        "p.json",
        json_of([{"robot": one, "camera": other} for one, other in zip(TOUCHED, POINTS, strict=True)]),
    ),
    "records with the flange's poses, beside clouds": (
        "calib_data.json",
        json_of({str(at): {"p_cam": seen, "p_robot": place / 1000, "robot_pose": [*place / 1000, 0, 0, 0, 1]}
               for at, (seen, place) in enumerate(zip(POINTS, TOUCHED, strict=True))}),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", POINT_PAIRS)
def test_points_that_a_tip_touched_are_a_calibration(name: str, tmp_path: Path) -> None:
    file, content = POINT_PAIRS[name]
    (tmp_path / "p").mkdir()
    (tmp_path / "p" / file).write_bytes(content)
    for at in range(3):
        (tmp_path / "p" / str(at)).mkdir()
        (tmp_path / "p" / str(at) / f"tool_{at}{at}.ply").write_bytes(b"ply")  # clouds in several folders do not matter
    ran = handeyed("import", tmp_path / "p", "--out", tmp_path / "s")
    assert ran.status == 0, ran.err
    solved = handeyed("solve", tmp_path / "s", "--json")
    found = CalibrationDocument.model_validate_json(solved.out).base_T_camera
    assert found is not None
    assert np.allclose(found.transform(), STANDING, atol=1e-3)
    assert handeyed("report", tmp_path / "s", "--out", tmp_path / "r.html").status == 0
    again = library.solve(tmp_path / "s").base_T_camera
    assert again is not None
    assert np.allclose(again.transform(), found.transform())


def test_points_with_a_wrong_pair_are_not_accepted(tmp_path: Path) -> None:
    (tmp_path / "p").mkdir()
    wrong = lines("robot_x,robot_y,robot_z,cam_x,cam_y,cam_z", *rows_of(np.roll(TOUCHED, 1, axis=0), POINTS))
    (tmp_path / "p" / "p.csv").write_bytes(wrong)
    assert handeyed("import", tmp_path / "p", "--out", tmp_path / "s").status == 0
    assert handeyed("solve", tmp_path / "s").status == 3


DAMAGED = ("four arrays in JSON, metres", "twelve numbers", "named columns", "numbered keys of FileStorage")


@pytest.mark.parametrize("kind", DAMAGES)
def test_a_damaged_file_is_refused_or_gives_the_right_x(kind: str, tmp_path: Path) -> None:
    """A few of `python -m benchmarks.daemon.damaged_files`; an exception is raised by `handeyed`."""
    for seed, layout in enumerate(DAMAGED):
        ((name, content),) = LAYOUTS[layout].items()
        folder = tmp_path / str(seed)
        folder.mkdir()
        (folder / name).write_bytes(DAMAGES[kind](content, np.random.default_rng(seed)))
        if handeyed("import", folder, "--setup", "eye-in-hand", "--out", folder / "s").status == 0:
            solved = handeyed("solve", folder / "s", "--json")
            found = CalibrationDocument.model_validate_json(solved.out)
            if solved.status == 0 and found.flange_T_camera is not None:
                off_mm, off_rad = difference(X, found.flange_T_camera.transform())
                assert off_mm < 1.0 and off_rad < 0.003, layout


@pytest.mark.parametrize(
    "row", ["P3=(1.0,2.0,a,0.4,0.5,0.6)(7,0)", "P3=(1.0,2.0,0.4,0.5,0.6)(7,0)", "Q3=(1,2,3,4,5,6)"]
)
def test_a_point_of_a_program_that_is_unlike_the_others_is_refused(row: str, tmp_path: Path) -> None:
    points = [f"P{at}=({row})(7,0)" for at, row in enumerate(rows_of(t, EULER), 1)]
    (tmp_path / "robot.prg").write_bytes(lines(*points[:2], row, *points[3:]))
    (tmp_path / "camera_poses.npy").write_bytes(npy(CAMERA))
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2 and "not read: robot.prg: " in ran.err


def test_a_number_that_is_none_among_twelve_is_named(tmp_path: Path) -> None:
    rows = rows_of(V, t / 1000, v, s / 1000)
    (tmp_path / "a.csv").write_bytes(lines(*rows[:3], rows[3].replace(rows[3].split(",")[4], "nan"), *rows[4:]))
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2 and "pose 4: a number is missing or not finite" in ran.err


def test_names_of_both_sides_that_contradict_the_fit_are_asked_for(tmp_path: Path) -> None:
    """Both sides inverted fit as well as neither: with one name wrong, X would be that of the inverted poses."""
    wrong = {"R_gripper2base": R, "t_gripper2base": t, "R_cam2target": r, "t_cam2target": s}
    (tmp_path / "a.json").write_bytes(json_of(wrong))
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2
    assert (
        "the names say base_T_flange of the robot's poses, which does not fit; likeliest first, the camera" in ran.err
    )


NEAR_ROBOT = transform(Y[:3, :3], [150.0, 50.0, 100.0]) @ inverse(X @ CAMERA)
"""Poses over a target that is as near to the base as the camera is to the flange."""

SENSES = {"as tf means it": lambda poses: poses, "as OpenCV means it": inverse}


def _in_two_senses(robot: Array, meant: Callable[[Array], Array]) -> dict[str, Array]:
    robot, seen = meant(robot), meant(CAMERA)
    return {
        "R_base2end": robot[:, :3, :3], "t_base2end": robot[:, :3, 3],
        "R_cam2marker": seen[:, :3, :3], "t_cam2marker": seen[:, :3, 3],
    }  # fmt: skip


@pytest.mark.parametrize("sense", SENSES)
def test_what_the_flange_carries_decides_how_names_of_two_senses_are_meant(sense: str, tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_bytes(npz(**_in_two_senses(ROBOT, SENSES[sense])))
    understood = understand(ImportRequest(tmp_path, setup="eye-in-hand"))
    np.testing.assert_allclose(understood.base_T_flange, ROBOT, atol=1e-4)
    assert understood.camera_T_target is not None
    np.testing.assert_allclose(understood.camera_T_target, CAMERA, atol=1e-4)


@pytest.mark.parametrize("sense", SENSES)
def test_names_of_two_senses_that_nothing_decides_are_asked_for(sense: str, tmp_path: Path) -> None:
    stacks = _in_two_senses(NEAR_ROBOT, SENSES[sense])
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.npz").write_bytes(npz(**stacks))
    ran = handeyed("import", tmp_path / "in", "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2 and "give --frame base_T_flange" in ran.err
    assert "base_T_flange with camera_T_target: flange_T_camera = (" in ran.err
    assert "flange_T_base with target_T_camera: flange_T_camera = (" in ran.err
    with pytest.raises(DocumentError, match="the names may be meant in two directions"):
        library.solve(stacks)
    frame = "base_T_flange" if sense == "as tf means it" else "flange_T_base"
    ran = handeyed("import", tmp_path / "in", "--setup", "eye-in-hand", "--frame", frame, "--out", tmp_path / "s")
    assert ran.status == 0, ran.err
    result = library.solve(stacks, frame=frame).flange_T_camera  # type: ignore[arg-type]
    assert result is not None and difference(result.transform(), X)[0] < 1.0


def test_a_frame_without_a_set_up_leaves_names_of_two_senses_open(tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_bytes(npz(**_in_two_senses(ROBOT, inverse)))
    ran = handeyed("import", tmp_path, "--frame", "flange_T_base", "--out", tmp_path / "s")
    assert ran.status == 2 and "give --setup" in ran.err


def test_files_whose_names_say_a_direction_are_read_in_it(tmp_path: Path) -> None:
    (tmp_path / "robot_poses.npy").write_bytes(npy(ROBOT))
    (tmp_path / "target_T_cam.npy").write_bytes(npy(inverse(CAMERA)))
    understood = understand(ImportRequest(tmp_path, setup="eye-in-hand"))
    assert understood.camera_T_target is not None
    np.testing.assert_allclose(understood.camera_T_target, CAMERA, atol=1e-4)


def test_sides_without_names_that_nothing_tells_apart_are_asked_for(tmp_path: Path) -> None:
    """The camera's poses first fit as well: with X and the target's pose inverted and exchanged."""
    (tmp_path / "a.json").write_bytes(json_of(np.stack([NEAR_ROBOT, CAMERA], axis=1)))
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2 and "no name says whose the poses are" in ran.err
    assert ran.err.count("flange_T_camera = (") == 2


@pytest.mark.parametrize("header", [(), ("x,y,z",)])
def test_points_of_two_files_are_read(header: tuple[str, ...], tmp_path: Path) -> None:
    """Of a camera beside the arm."""
    seen = np.random.default_rng(6).uniform([-200, -200, 400], [200, 200, 800], (8, 3))
    (tmp_path / "robot_points.csv").write_bytes(lines(*header, *rows_of(map_points(X, seen))))
    (tmp_path / "camera_points.csv").write_bytes(lines(*header, *rows_of(seen)))
    ran = handeyed("import", tmp_path, "--setup", "eye-to-hand", "--out", tmp_path / "s")
    assert ran.status == 0, ran.err


def test_points_of_one_side_that_are_named_as_poses_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(lines("x,y,z", *rows_of(t)))
    for at in range(8):
        (tmp_path / f"view_{at}.png").touch()
    ran = handeyed(
        "import",
        tmp_path,
        "--target",
        "chessboard:9x6:25",
        "--poses",
        "a.csv",
        "--setup",
        "eye-to-hand",
        "--out",
        tmp_path / "s",
    )
    assert ran.status == 2 and "points of one side" in ran.err


def test_a_unit_of_the_camera_that_is_stated_wrong_is_named(tmp_path: Path) -> None:
    stacks = npz(R_gripper2base=R, t_gripper2base=t, R_target2cam=r, t_target2cam=s / 1000)
    (tmp_path / "a.npz").write_bytes(stacks)
    ran = handeyed("import", tmp_path, *("--setup", "eye-in-hand", "--camera-unit", "mm"), "--out", tmp_path / "s")
    assert ran.status == 2 and "give --camera-unit m" in ran.err


def test_options_that_were_not_used_are_named(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.npz").write_bytes(npz(R_gripper2base=R, t_gripper2base=t, R_target2cam=r, t_target2cam=s))
    unused = {"--arm": "IRB 1600-6/1.45", "--target": "chessboard:9x6:25", "--cloud-unit": "mm", "--part": "a"}
    given = [word for pair in unused.items() for word in pair]
    ran = handeyed("import", tmp_path / "in", "--setup", "eye-in-hand", *given, "--out", tmp_path / "s")
    assert ran.status == 0, ran.err
    assert [option for option in unused if f"{option} is not used" not in ran.out] == []

"""Poses of robot and camera in the shapes in which people have them: every layout gives the same pairs."""

import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from scipy.spatial.transform import Rotation

import handeyed as library
from calibration.documents.calibration import CalibrationDocument
from calibration.errors import DocumentError
from calibration.problem import MeasuredPose
from calibration.transforms import (
    Array,
    difference,
    inverse,
    map_points,
    quaternion_from_rotation,
    rotation_from_vector,
    transform,
    vector_from_rotation,
)
from daemon.sessions.session_import.request import ImportRequest
from daemon.sessions.session_import.understand import understand
from tests.calibration.documents.imports.file_damage import DAMAGES
from tests.calibration.documents.imports.written import lines, npy, npz
from tests.daemon.cli.running import handeyed
from tests.simulated.measured_sessions import measured_cell, tracker

X = transform(rotation_from_vector([0.1, -0.2, 1.4]), [35.0, -20.0, 90.0])
Y = transform(rotation_from_vector([3.1, 0.1, 0.0]), [900.0, 50.0, 100.0])


def _pairs() -> tuple[Array, Array]:
    """base_T_flange and camera_T_target (8, 4, 4) in mm, with a tracker's noise."""
    drawn = measured_cell(np.random.default_rng(4), 8, tracker())
    measured = [view.measured for view in drawn.problem.views]
    seen = np.array([one.camera_T_target for one in measured if isinstance(one, MeasuredPose)])
    shaken = transform(np.eye(3), 0.05 * np.random.default_rng(5).standard_normal((8, 3)))
    return Y @ inverse(X @ seen) @ shaken, seen


ROBOT, CAMERA = _pairs()
R, t = ROBOT[:, :3, :3], ROBOT[:, :3, 3]
r, s = CAMERA[:, :3, :3], CAMERA[:, :3, 3]
V, v = vector_from_rotation(R), vector_from_rotation(r)
Q, q = quaternion_from_rotation(R), quaternion_from_rotation(r)
SIX = np.concatenate([t / 1000, V], axis=1), np.concatenate([s / 1000, v], axis=1)


def _json(data: object) -> bytes:
    return json.dumps(data, default=lambda array: array.tolist()).encode()


def _rows(*columns: Array, separator: str = ",") -> list[str]:
    return [separator.join(f"{number:.9f}" for number in row) for row in np.concatenate(columns, axis=1)]


def _storage_of(matrices: dict[str, Array]) -> bytes:
    """OpenCV's FileStorage with a key for each matrix."""
    written = [
        f"{key}: !!opencv-matrix\n  rows: {len(one)}\n  cols: {one.shape[1]}\n  dt: d\n  data: {one.ravel().tolist()}"
        for key, one in matrices.items()
    ]
    return lines("%YAML:1.0", "---", *written)


def _xml() -> bytes:
    sides = (("robot_poses", np.concatenate([t, Q], axis=1)), ("marker_poses", np.concatenate([s, q], axis=1)))
    head = '<{} type_id="opencv-matrix"><rows>8</rows><cols>7</cols><dt>d</dt><data>'
    parts = [f"{head.format(name)}{' '.join(map(str, rows.ravel()))}</data></{name}>" for name, rows in sides]
    return lines('<?xml version="1.0"?>', "<opencv_storage>", *parts, "</opencv_storage>")


def _mat(**arrays: Array) -> bytes:
    stream = io.BytesIO()
    scipy.io.savemat(stream, {"bTe": 0.0, **arrays})
    return stream.getvalue()


LAST = np.moveaxis(ROBOT, 0, 2), np.moveaxis(CAMERA, 0, 2)
ALTERNATING = np.stack([np.concatenate([t / 1000, V], axis=1), np.concatenate([s / 1000, v], axis=1)], axis=1)

LAYOUTS: dict[str, dict[str, bytes]] = {
    "four arrays in JSON, metres": {"samples.json": _json(
        {"R_gripper2base": R, "t_gripper2base": t / 1000, "R_target2cam": r, "t_target2cam": s / 1000})},
    "four arrays in npz": {"samples.npz": npz(R_gripper2base=R, t_gripper2base=t[..., None], R_target2cam=r,
                                              t_target2cam=s[..., None])},
    "stacks in npz": {"poses.npz": npz(base_T_gripper=ROBOT, camera_T_board=CAMERA)},
    "arrays of the inverse": {"poses.npz": npz(R_base2gripper=inverse(ROBOT)[:, :3, :3],
        t_base2gripper=inverse(ROBOT)[:, :3, 3], R_target2cam=r, t_target2cam=s)},
    "rotation vectors and places": {"a.json": _json(
        {"robot_rvecs": V, "robot_tvecs": t, "rvecs": v[..., None], "tvecs": s[..., None]})},
    "records of two matrices": {"a.json": _json(
        [{"robot": a, "board": b} for a, b in zip(ROBOT, CAMERA, strict=True)])},
    "records of rotation and place": {"a.json": _json({str(at): {
        "eef_to_base": {"rotation": a[:3, :3], "translation": a[:3, 3] / 1000},
        "marker_to_camera": {"rotation": b[:3, :3], "translation": b[:3, 3] / 1000}}
        for at, (a, b) in enumerate(zip(ROBOT, CAMERA, strict=True))})},
    "records of seven numbers and a detection": {"a.yaml": _json([
        {"tcp": [*(place / 1000), *turn], "rvec": b, "tvec": c / 1000}
        for place, turn, b, c in zip(t, Q, v, s, strict=True)])},
    "pairs of matrices": {"a.json": _json(np.stack([ROBOT, CAMERA], axis=1))},
    "numbered keys of FileStorage": {"poses.yml": _storage_of({
        f"{side}{at:02}": pose for at, both in enumerate(zip(ROBOT, CAMERA, strict=True), 1)
        for side, pose in zip(("gripper2base", "target2cam"), both, strict=True)})},
    "FileStorage in XML": {"poses.xml": _xml()},
    "twelve numbers": {"a.csv": lines(*_rows(V, t / 1000, v, s / 1000))},
    "twelve numbers, the camera first": {"a.csv": lines(*_rows(s / 1000, v, t / 1000, V))},
    "rows in turn": {"a.txt": lines(*_rows(ALTERNATING.reshape(16, 6), separator=" "))},
    "one side after the other": {"a.txt": lines(*_rows(np.concatenate(SIX), separator=" "))},
    "named columns": {"a.csv": lines(
        ",".join(f"{side}_{one}" for side in ("robot", "camera") for one in ("x", "y", "z", "qw", "qx", "qy", "qz")),
        *_rows(t, Q, s, q))},
    "two tables, metres": {"robot.csv": lines("x,y,z,rx,ry,rz", *_rows(*np.split(SIX[0], [3], axis=1))),
                           "camera.csv": lines("x,y,z,rvec_x,rvec_y,rvec_z", *_rows(*np.split(SIX[1], [3], axis=1)))},
    "two stacks": {"gripper2base.npy": npy(ROBOT), "target2cam.npy": npy(CAMERA)},
    "four files": {"R_gripper2base.npy": npy(R), "t_gripper2base.npy": npy(t), "R_target2cam.npy": npy(r),
                   "t_target2cam.npy": npy(s)},
    "a file a view": {f"view_{at}.npz": npz(R_gripper2base=R[at], t_gripper2base=t[at], R_target2cam=r[at],
                                            t_target2cam=s[at]) for at in range(8)},
    "MATLAB's": {"poses.mat": _mat(robot_T=LAST[0], board_T=LAST[1])},
    "MATLAB's, with frames of one letter": {"poses.mat": _mat(bTg=LAST[0], cTo=LAST[1])},
    "inverse poses, with frames of one letter": {"a.json": _json({"gTb": inverse(ROBOT), "oMc": inverse(CAMERA)})},
    "columns of two matrices": {"a.csv": lines(
        ",".join(f"{side}_{row}{column}" for side in ("ee", "cam") for row in range(4) for column in range(4)),
        *_rows(ROBOT.reshape(-1, 16), CAMERA.reshape(-1, 16)))},
    "columns of six numbers with two digits": {"a.csv": lines(
        ",".join(f"{side}_{at:02}" for side in ("tcp", "board") for at in range(6)), *_rows(t, V, s, v))},
    "records by their numbers, with a detection": {"a.json": _json({str(at): {
        "pose": [*t[at], *V[at]], "rvec": v[at], "tvec": s[at] / 1000} for at in range(8)})},
    "records of a detection's columns": {"a.json": _json({"date": "2026-01-02", "poses": [
        {"robot_pose": dict(zip(("x", "y", "z", "qw", "qx", "qy", "qz"), [*t[at], *Q[at]], strict=True)),
         "aruco": {"rvec": v[at][:, None], "tvec": s[at][:, None]}} for at in range(8)]})},
    "lines of places and orientations, and a matrix as one list": {"a.jsonl": b"\n".join(_json(
        {"tcp": {"pos": t[at], "orient": Q[at]}, "board_in_camera": CAMERA[at].ravel()}) for at in range(8))},
    "numbers within the keys of FileStorage": {"a.yml": _storage_of(
        {f"frame{at}_{name}": matrix for at in range(8) for name, matrix in (
            ("robot_R", R[at]), ("robot_t", t[at, :, None]),
            ("cam_rvec", v[at, :, None]), ("cam_tvec", s[at, :, None]))})},
    "places and Euler angles beside rotation vectors, without a header": {"a.csv": lines(
        *_rows(t, np.degrees(Rotation.from_matrix(R).as_euler("xyz")), s, v))},
    "seven and seven numbers": {"a.csv": lines(*_rows(t, Q, s, q))},
    "two matrices a row": {"a.csv": lines(*_rows(ROBOT[:, :3].reshape(-1, 12), CAMERA[:, :3].reshape(-1, 12)))},
    "numbers in texts": {"a.json": _json([
        {"robot": _rows(t[at : at + 1], Q[at : at + 1])[0], "eye": _rows(s[at : at + 1], q[at : at + 1])[0]}
        for at in range(8)])},
    "a German table": {"a.csv": lines(
        "Nr;" + ";".join(f"{side} {axis} [{unit}]" for side in ("Roboter", "Kamera") for axis, unit in zip(
            ("X", "Y", "Z", "RX", "RY", "RZ"), ("mm", "mm", "mm", "rad", "rad", "rad"), strict=True)),
        *(f"{at};{row.replace('.', ',')}" for at, row in enumerate(_rows(t, V, s, v, separator=";"), 1)))},
    "matrices of FileStorage, a file a view and side": {
        f"{side}_{at}.yaml": _storage_of({"PoseState": poses[at]})
        for side, poses in (("robot_pose", ROBOT), ("checkerboard_pose", CAMERA)) for at in range(8)},
    "handeye_calib_camodocal": {"a.yml": _storage_of(
        {f"T{side}_{at}": poses[at] for at in range(8) for side, poses in ((1, ROBOT), (2, CAMERA))}
    ) + b"frameCount: 8\n"},
    "a log of the robot, an array of the camera": {
        "robot.log": lines(*(f"Pose {at}: X={t[at, 0]:.6f} Y={t[at, 1]:.6f} Z={t[at, 2]:.6f} Q={Q[at].tolist()}"
                             for at in range(8))), "camera_poses.npy": npy(CAMERA)},
    "a folder a view, with intrinsics": {f"pose_{at:02}/data.json": _json({
        "joint_pose": [0.1 * at] * 7, "O_T_EE": ROBOT[at].ravel(), "camera_intrinsics": [[900, 0, 320], [0, 900, 240],
        [0, 0, 1]], "T_cam_target_rvec": v[at][:, None], "T_cam_target_tvec": s[at][:, None]}) for at in range(8)},
    "rows called by their side, and a result below": {"a.csv": lines(
        *(f"{side},{row}" for both in zip(*(_rows(p, np.degrees(Rotation.from_matrix(m).as_euler("xyz")))
          for p, m in ((t, R), (s, r))), strict=True) for side, row in zip(("hand", "eye"), both, strict=True)),
        "", "[[0 -1 0 20.5]", " [1 0 0 -10.25]", " [0 0 1 100.0]", " [0 0 0 1]]")},
    "numbered views of each side": {"log.yml": _json({
        side: {str(at): pose for at, pose in enumerate(poses, 1)}
        for side, poses in (("end2base", ROBOT), ("marker2cam", CAMERA))})},
    "lists below their names, in two files": {
        f"{side}_info.txt": lines(*(line for at in range(8) for line in (
            f"{at}:", "Rotation:", str(turns[at].tolist()), "Translation:", str((places[at] / 1000).tolist()), "")))
        for side, turns, places in (("wrist2_wrt_base", V, t), ("target_wrt_cam", v, s))},
    "arrays whose rows are counted": {"a.npz": npz(
        gripper_pose=np.concatenate([t, Q], axis=1), Target_rvecs=np.column_stack([np.arange(1, 9), v]),
        Target_tvecs=np.column_stack([np.arange(1, 9), np.full(8, 7), s]))},
    "a file a view and side": {f"{side}_{at}.txt": lines(*_rows(poses[at], separator=" "))
                               for side, poses in (("robot", ROBOT), ("cam", CAMERA)) for at in range(8)},
    "lists under numbered names, below their sides": {"p.yaml": _json({
        side: {f"pose{at}": row for at, row in enumerate(rows, 1)}
        for side, rows in zip(("robot", "camera"), SIX, strict=True)})},
    "columns pose1 to pose6, in two files": {
        f"{side}.csv": lines("pose1,pose2,pose3,pose4,pose5,pose6", *_rows(rows))
        for side, rows in zip(("robot", "target"), SIX, strict=True)},
    "a folder a side": {f"{side}/{at}.txt": lines(*_rows(poses[at], separator=" "))
                        for side, poses in (("arm", ROBOT), ("board", CAMERA)) for at in range(8)},
    "stacks in npz beside a date and a count": {"samples.npz": npz(
        T_base_ee=ROBOT, T_cam_board=CAMERA, count=np.array(8), saved_at=np.array("2026-01-02T10:15:00"))},
    "matrices whose last row was never written": {"a.yml": _storage_of({
        f"{side}{at:02}": pose * [[1], [1], [1], [0]] for at, both in enumerate(zip(ROBOT, CAMERA, strict=True))
        for side, pose in zip(("gripper2base", "target2cam"), both, strict=True)})},
    "pairs of matrices beside joints": {"log.json": _json({
        "Title": "a log", "Joint Values": np.full((8, 6), 0.5), "Both": np.stack([ROBOT, CAMERA], axis=1)})},
    "columns of two groups whose letters say no side": {"a.csv": lines(
        "id," + ",".join(f"{side}_{axis}" for side in "he" for axis in ("x", "y", "z", "rx", "ry", "rz")),
        *(f"{at},{row}" for at, row in enumerate(_rows(*SIX))))},
    "records beside other lists, in two files": {
        "arm.json": _json({"fields": ["x", "y"], "poses": [dict(zip(
            ("x", "y", "z", "qw", "qx", "qy", "qz"), [*t[at], *Q[at]], strict=True)) for at in range(8)]}),
        "camera.json": _json({"pattern": [9, 6], "camera_matrix": [[900, 0, 320], [0, 900, 240], [0, 0, 1]],
                              "poses": [{"idx": at, "rvec": v[at], "tvec": s[at]} for at in range(8)]})},
    "a file a view with a list a side": {f"view_{at}.json": _json(
        {"robot": SIX[0][at], "board": SIX[1][at]}) for at in range(8)},
}  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_pairs_are_read(layout: str, tmp_path: Path) -> None:
    for name, content in LAYOUTS[layout].items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    understood = understand(ImportRequest(tmp_path, setup="eye-in-hand"))
    assert understood.camera_T_target is not None
    np.testing.assert_allclose(understood.base_T_flange, ROBOT, atol=1e-4)
    np.testing.assert_allclose(understood.camera_T_target, CAMERA, atol=1e-4)


CHANGES: dict[str, tuple[Callable[[Array], Array], str]] = {
    "y reversed": (lambda places: places * [1, -1, 1], "with y reversed the translations agree as well"),
    "x and y exchanged": (lambda places: places[:, [1, 0, 2]], "give --axes=y,x,z"),
    "inches": (lambda places: places / 25.4, "with places in inches"),
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


def test_the_camera_s_unit_and_convention_may_be_stated(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "robot.csv").write_bytes(lines("x,y,z,qw,qx,qy,qz", *_rows(t, Q)))
    (tmp_path / "in" / "camera.csv").write_bytes(lines(*_rows(s / 1000, v)))
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
    records = _json([{"first": a, "second": b} for a, b in zip(ROBOT, CAMERA, strict=True)])
    (tmp_path / "a.json").write_bytes(records)
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2
    assert "2 poses in a record (first, second), and their names do not say whose" in ran.err


def test_a_damaged_pose_of_the_robot_is_named_and_the_camera_s_not_taken_alone(tmp_path: Path) -> None:
    damaged = ROBOT.copy()
    damaged[3, 3] = [0, 0, 0, 5]
    (tmp_path / "a.json").write_bytes(_json([{"robot": a, "board": b} for a, b in zip(damaged, CAMERA, strict=True)]))
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2
    assert "pose 4: the last row of the 4 x 4 matrix is not 0, 0, 0, 1" in ran.err


def test_rows_of_a_path_are_no_pairs(tmp_path: Path) -> None:
    """Neighbours on a path are alike: taken as two sides, they would be one pose seen twice."""
    along = np.linspace(0.0, 1.0, 12)[:, None]
    path = np.concatenate([[900.0, 0.0, 400.0] + along * [200.0, 50.0, 80.0], along * [0.4, -0.3, 0.5]], axis=1)
    (tmp_path / "path.csv").write_bytes(lines(*_rows(path)))
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2
    assert "no pictures and no clouds" in ran.err


POINTS = np.random.default_rng(4).uniform(-200.0, 200.0, (10, 3))
STANDING = transform(rotation_from_vector([3.0, 0.2, -0.1]), [820.0, 40.0, 1150.0])
TOUCHED = map_points(STANDING, POINTS)

POINT_PAIRS = {
    "names of both sides": ("p.csv", lines("robot_x,robot_y,robot_z,cam_x,cam_y,cam_z", *_rows(TOUCHED, POINTS))),
    "arrays, the camera's in metres": (
        "p.json", json.dumps({"p_cam": (POINTS / 1000).tolist(), "p_robot": TOUCHED.tolist()}).encode(),
    ),
    "records": (
        "p.json",
        _json([{"robot": one, "camera": other} for one, other in zip(TOUCHED, POINTS, strict=True)]),
    ),
    "records with the flange's poses, beside clouds": (
        "calib_data.json",
        _json({str(at): {"p_cam": seen, "p_robot": place / 1000, "robot_pose": [*place / 1000, 0, 0, 0, 1]}
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
    wrong = lines("robot_x,robot_y,robot_z,cam_x,cam_y,cam_z", *_rows(np.roll(TOUCHED, 1, axis=0), POINTS))
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


def test_a_number_that_is_none_among_twelve_is_named(tmp_path: Path) -> None:
    rows = _rows(V, t / 1000, v, s / 1000)
    (tmp_path / "a.csv").write_bytes(lines(*rows[:3], rows[3].replace(rows[3].split(",")[4], "nan"), *rows[4:]))
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2 and "pose 4: a number is missing or not finite" in ran.err


def test_names_of_both_sides_that_contradict_the_fit_are_asked_for(tmp_path: Path) -> None:
    """Both sides inverted fit as well as neither: with one name wrong, X would be that of the inverted poses."""
    wrong = {"R_gripper2base": R, "t_gripper2base": t, "R_cam2target": r, "t_cam2target": s}
    (tmp_path / "a.json").write_bytes(_json(wrong))
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2
    assert "the names say base_T_flange of the robot's poses" in ran.err


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
    (tmp_path / "a.json").write_bytes(_json(np.stack([NEAR_ROBOT, CAMERA], axis=1)))
    ran = handeyed("import", tmp_path, "--setup", "eye-in-hand", "--out", tmp_path / "s")
    assert ran.status == 2 and "no name says whose the poses are" in ran.err
    assert ran.err.count("flange_T_camera = (") == 2


@pytest.mark.parametrize("header", [(), ("x,y,z",)])
def test_points_of_two_files_are_read(header: tuple[str, ...], tmp_path: Path) -> None:
    """Of a camera beside the arm."""
    seen = np.random.default_rng(6).uniform([-200, -200, 400], [200, 200, 800], (8, 3))
    (tmp_path / "robot_points.csv").write_bytes(lines(*header, *_rows(map_points(X, seen))))
    (tmp_path / "camera_points.csv").write_bytes(lines(*header, *_rows(seen)))
    ran = handeyed("import", tmp_path, "--setup", "eye-to-hand", "--out", tmp_path / "s")
    assert ran.status == 0, ran.err


def test_points_of_one_side_that_are_named_as_poses_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(lines("x,y,z", *_rows(t)))
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

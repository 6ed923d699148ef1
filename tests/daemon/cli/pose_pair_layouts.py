"""Eight poses of robot and camera, and the files in which people have such pairs."""

import io
import json

import numpy as np
import scipy.io
from scipy.spatial.transform import Rotation

from calibration.problem import MeasuredPose
from calibration.transforms import (
    Array,
    inverse,
    quaternion_from_rotation,
    rotation_from_vector,
    transform,
    vector_from_rotation,
)
from tests.calibration.documents.imports.written import lines, npy, npz
from tests.simulated.measured_sessions import measured_cell, tracker

X = transform(rotation_from_vector([0.1, -0.2, 1.4]), [35.0, -20.0, 90.0])
Y = transform(rotation_from_vector([3.1, 0.1, 0.0]), [900.0, 50.0, 100.0])


def _drawn_pairs() -> tuple[Array, Array]:
    """base_T_flange and camera_T_target (8, 4, 4) in mm, with a tracker's noise."""
    drawn = measured_cell(np.random.default_rng(4), 8, tracker())
    measured = [view.measured for view in drawn.problem.views]
    seen = np.array([one.camera_T_target for one in measured if isinstance(one, MeasuredPose)])
    shaken = transform(np.eye(3), 0.05 * np.random.default_rng(5).standard_normal((8, 3)))
    return Y @ inverse(X @ seen) @ shaken, seen


ROBOT, CAMERA = _drawn_pairs()
R, t = ROBOT[:, :3, :3], ROBOT[:, :3, 3]
r, s = CAMERA[:, :3, :3], CAMERA[:, :3, 3]
V, v = vector_from_rotation(R), vector_from_rotation(r)
Q, q = quaternion_from_rotation(R), quaternion_from_rotation(r)
SIX = np.concatenate([t / 1000, V], axis=1), np.concatenate([s / 1000, v], axis=1)


def json_of(data: object) -> bytes:
    return json.dumps(data, default=lambda array: array.tolist()).encode()


def rows_of(*columns: Array, separator: str = ",") -> list[str]:
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


def _mat(**arrays: object) -> bytes:
    stream = io.BytesIO()
    scipy.io.savemat(stream, {"bTe": 0.0, **arrays})
    return stream.getvalue()


def _cells(poses: Array) -> object:
    """A cell of MATLAB for each pose."""
    cells = np.empty(len(poses), object)
    cells[:] = list(poses)
    return cells


def _echo(poses: Array) -> list[str]:
    """What tf2_echo prints of each pose, in metres."""
    turns = quaternion_from_rotation(poses[:, :3, :3])[:, [1, 2, 3, 0]]
    return [
        f"At time {at}.5\n- Translation: {(pose[:3, 3] / 1000).tolist()}\n- Rotation: in Quaternion (xyzw) "
        f"{turn.tolist()}\n- Rotation: in RPY (degree) [1.000, 2.000, {at}.000]\n- Matrix:\n  0.5 0.5 0.5 0.5"
        for at, (pose, turn) in enumerate(zip(poses, turns, strict=True))
    ]


EULER = np.degrees(Rotation.from_matrix(R).as_euler("xyz"))
TURNED = rows_of(t, EULER, s, v)
SIDES = ",".join(f"{side}_{one}" for side in ("robot", "board") for one in ("x", "y", "z", "qw", "qx", "qy", "qz"))
LAST = np.moveaxis(ROBOT, 0, 2), np.moveaxis(CAMERA, 0, 2)
ALTERNATING = np.stack([np.concatenate([t / 1000, V], axis=1), np.concatenate([s / 1000, v], axis=1)], axis=1)

LAYOUTS: dict[str, dict[str, bytes]] = {
    "four arrays in JSON, metres": {"samples.json": json_of(
        {"R_gripper2base": R, "t_gripper2base": t / 1000, "R_target2cam": r, "t_target2cam": s / 1000})},
    "four arrays in npz": {"samples.npz": npz(R_gripper2base=R, t_gripper2base=t[..., None], R_target2cam=r,
                                              t_target2cam=s[..., None])},
    "stacks in npz": {"poses.npz": npz(base_T_gripper=ROBOT, camera_T_board=CAMERA)},
    "arrays of the inverse": {"poses.npz": npz(R_base2gripper=inverse(ROBOT)[:, :3, :3],
        t_base2gripper=inverse(ROBOT)[:, :3, 3], R_target2cam=r, t_target2cam=s)},
    "rotation vectors and places": {"a.json": json_of(
        {"robot_rvecs": V, "robot_tvecs": t, "rvecs": v[..., None], "tvecs": s[..., None]})},
    "records of two matrices": {"a.json": json_of(
        [{"robot": a, "board": b} for a, b in zip(ROBOT, CAMERA, strict=True)])},
    "records of rotation and place": {"a.json": json_of({str(at): {
        "eef_to_base": {"rotation": a[:3, :3], "translation": a[:3, 3] / 1000},
        "marker_to_camera": {"rotation": b[:3, :3], "translation": b[:3, 3] / 1000}}
        for at, (a, b) in enumerate(zip(ROBOT, CAMERA, strict=True))})},
    "records of seven numbers and a detection": {"a.yaml": json_of([
        {"tcp": [*(place / 1000), *turn], "rvec": b, "tvec": c / 1000}
        for place, turn, b, c in zip(t, Q, v, s, strict=True)])},
    "pairs of matrices": {"a.json": json_of(np.stack([ROBOT, CAMERA], axis=1))},
    "numbered keys of FileStorage": {"poses.yml": _storage_of({
        f"{side}{at:02}": pose for at, both in enumerate(zip(ROBOT, CAMERA, strict=True), 1)
        for side, pose in zip(("gripper2base", "target2cam"), both, strict=True)})},
    "FileStorage in XML": {"poses.xml": _xml()},
    "twelve numbers": {"a.csv": lines(*rows_of(V, t / 1000, v, s / 1000))},
    "twelve numbers, the camera first": {"a.csv": lines(*rows_of(s / 1000, v, t / 1000, V))},
    "rows in turn": {"a.txt": lines(*rows_of(ALTERNATING.reshape(16, 6), separator=" "))},
    "one side after the other": {"a.txt": lines(*rows_of(np.concatenate(SIX), separator=" "))},
    "named columns": {"a.csv": lines(
        ",".join(f"{side}_{one}" for side in ("robot", "camera") for one in ("x", "y", "z", "qw", "qx", "qy", "qz")),
        *rows_of(t, Q, s, q))},
    "two tables, metres": {"robot.csv": lines("x,y,z,rx,ry,rz", *rows_of(*np.split(SIX[0], [3], axis=1))),
                           "camera.csv": lines("x,y,z,rvec_x,rvec_y,rvec_z", *rows_of(*np.split(SIX[1], [3], axis=1)))},
    "two stacks": {"gripper2base.npy": npy(ROBOT), "target2cam.npy": npy(CAMERA)},
    "four files": {"R_gripper2base.npy": npy(R), "t_gripper2base.npy": npy(t), "R_target2cam.npy": npy(r),
                   "t_target2cam.npy": npy(s)},
    "a file a view": {f"view_{at}.npz": npz(R_gripper2base=R[at], t_gripper2base=t[at], R_target2cam=r[at],
                                            t_target2cam=s[at]) for at in range(8)},
    "MATLAB's": {"poses.mat": _mat(robot_T=LAST[0], board_T=LAST[1])},
    "MATLAB's, with frames of one letter": {"poses.mat": _mat(bTg=LAST[0], cTo=LAST[1])},
    "inverse poses, with frames of one letter": {"a.json": json_of({"gTb": inverse(ROBOT), "oMc": inverse(CAMERA)})},
    "columns of two matrices": {"a.csv": lines(
        ",".join(f"{side}_{row}{column}" for side in ("ee", "cam") for row in range(4) for column in range(4)),
        *rows_of(ROBOT.reshape(-1, 16), CAMERA.reshape(-1, 16)))},
    "columns of six numbers with two digits": {"a.csv": lines(
        ",".join(f"{side}_{at:02}" for side in ("tcp", "board") for at in range(6)), *rows_of(t, V, s, v))},
    "records by their numbers, with a detection": {"a.json": json_of({str(at): {
        "pose": [*t[at], *V[at]], "rvec": v[at], "tvec": s[at] / 1000} for at in range(8)})},
    "records of a detection's columns": {"a.json": json_of({"date": "2026-01-02", "poses": [
        {"robot_pose": dict(zip(("x", "y", "z", "qw", "qx", "qy", "qz"), [*t[at], *Q[at]], strict=True)),
         "aruco": {"rvec": v[at][:, None], "tvec": s[at][:, None]}} for at in range(8)]})},
    "lines of places and orientations, and a matrix as one list": {"a.jsonl": b"\n".join(json_of(
        {"tcp": {"pos": t[at], "orient": Q[at]}, "board_in_camera": CAMERA[at].ravel()}) for at in range(8))},
    "numbers within the keys of FileStorage": {"a.yml": _storage_of(
        {f"frame{at}_{name}": matrix for at in range(8) for name, matrix in (
            ("robot_R", R[at]), ("robot_t", t[at, :, None]),
            ("cam_rvec", v[at, :, None]), ("cam_tvec", s[at, :, None]))})},
    "places and Euler angles beside rotation vectors, without a header": {"a.csv": lines(
        *rows_of(t, np.degrees(Rotation.from_matrix(R).as_euler("xyz")), s, v))},
    "seven and seven numbers": {"a.csv": lines(*rows_of(t, Q, s, q))},
    "two matrices a row": {"a.csv": lines(*rows_of(ROBOT[:, :3].reshape(-1, 12), CAMERA[:, :3].reshape(-1, 12)))},
    "numbers in texts": {"a.json": json_of([
        {"robot": rows_of(t[at : at + 1], Q[at : at + 1])[0], "eye": rows_of(s[at : at + 1], q[at : at + 1])[0]}
        for at in range(8)])},
    "a German table": {"a.csv": lines(
        "Nr;" + ";".join(f"{side} {axis} [{unit}]" for side in ("Roboter", "Kamera") for axis, unit in zip(
            ("X", "Y", "Z", "RX", "RY", "RZ"), ("mm", "mm", "mm", "rad", "rad", "rad"), strict=True)),
        *(f"{at};{row.replace('.', ',')}" for at, row in enumerate(rows_of(t, V, s, v, separator=";"), 1)))},
    "matrices of FileStorage, a file a view and side": {
        f"{side}_{at}.yaml": _storage_of({"PoseState": poses[at]})
        for side, poses in (("robot_pose", ROBOT), ("checkerboard_pose", CAMERA)) for at in range(8)},
    "handeye_calib_camodocal": {"a.yml": _storage_of(
        {f"T{side}_{at}": poses[at] for at in range(8) for side, poses in ((1, ROBOT), (2, CAMERA))}
    ) + b"frameCount: 8\n"},
    "a log of the robot, an array of the camera": {
        "robot.log": lines(*(f"Pose {at}: X={t[at, 0]:.6f} Y={t[at, 1]:.6f} Z={t[at, 2]:.6f} Q={Q[at].tolist()}"
                             for at in range(8))), "camera_poses.npy": npy(CAMERA)},
    "a folder a view, with intrinsics": {f"pose_{at:02}/data.json": json_of({
        "joint_pose": [0.1 * at] * 7, "O_T_EE": ROBOT[at].ravel(), "camera_intrinsics": [[900, 0, 320], [0, 900, 240],
        [0, 0, 1]], "T_cam_target_rvec": v[at][:, None], "T_cam_target_tvec": s[at][:, None]}) for at in range(8)},
    "rows called by their side, and a result below": {"a.csv": lines(
        *(f"{side},{row}" for both in zip(*(rows_of(p, np.degrees(Rotation.from_matrix(m).as_euler("xyz")))
          for p, m in ((t, R), (s, r))), strict=True) for side, row in zip(("hand", "eye"), both, strict=True)),
        "", "[[0 -1 0 20.5]", " [1 0 0 -10.25]", " [0 0 1 100.0]", " [0 0 0 1]]")},
    "numbered views of each side": {"log.yml": json_of({
        side: {str(at): pose for at, pose in enumerate(poses, 1)}
        for side, poses in (("end2base", ROBOT), ("marker2cam", CAMERA))})},
    "lists below their names, in two files": {
        f"{side}_info.txt": lines(*(line for at in range(8) for line in (
            f"{at}:", "Rotation:", str(turns[at].tolist()), "Translation:", str((places[at] / 1000).tolist()), "")))
        for side, turns, places in (("wrist2_wrt_base", V, t), ("target_wrt_cam", v, s))},
    "arrays whose rows are counted": {"a.npz": npz(
        gripper_pose=np.concatenate([t, Q], axis=1), Target_rvecs=np.column_stack([np.arange(1, 9), v]),
        Target_tvecs=np.column_stack([np.arange(1, 9), np.full(8, 7), s]))},
    "a file a view and side": {f"{side}_{at}.txt": lines(*rows_of(poses[at], separator=" "))
                               for side, poses in (("robot", ROBOT), ("cam", CAMERA)) for at in range(8)},
    "lists under numbered names, below their sides": {"p.yaml": json_of({
        side: {f"pose{at}": row for at, row in enumerate(rows, 1)}
        for side, rows in zip(("robot", "camera"), SIX, strict=True)})},
    "columns pose1 to pose6, in two files": {
        f"{side}.csv": lines("pose1,pose2,pose3,pose4,pose5,pose6", *rows_of(rows))
        for side, rows in zip(("robot", "target"), SIX, strict=True)},
    "a folder a side": {f"{side}/{at}.txt": lines(*rows_of(poses[at], separator=" "))
                        for side, poses in (("arm", ROBOT), ("board", CAMERA)) for at in range(8)},
    "stacks in npz beside a date and a count": {"samples.npz": npz(
        T_base_ee=ROBOT, T_cam_board=CAMERA, count=np.array(8), saved_at=np.array("2026-01-02T10:15:00"))},
    "matrices whose last row was never written": {"a.yml": _storage_of({
        f"{side}{at:02}": pose * [[1], [1], [1], [0]] for at, both in enumerate(zip(ROBOT, CAMERA, strict=True))
        for side, pose in zip(("gripper2base", "target2cam"), both, strict=True)})},
    "pairs of matrices beside joints": {"log.json": json_of({
        "Title": "a log", "Joint Values": np.full((8, 6), 0.5), "Both": np.stack([ROBOT, CAMERA], axis=1)})},
    "columns of two groups whose letters say no side": {"a.csv": lines(
        "id," + ",".join(f"{side}_{axis}" for side in "he" for axis in ("x", "y", "z", "rx", "ry", "rz")),
        *(f"{at},{row}" for at, row in enumerate(rows_of(*SIX))))},
    "records beside other lists, in two files": {
        "arm.json": json_of({"fields": ["x", "y"], "poses": [dict(zip(
            ("x", "y", "z", "qw", "qx", "qy", "qz"), [*t[at], *Q[at]], strict=True)) for at in range(8)]}),
        "camera.json": json_of({"pattern": [9, 6], "camera_matrix": [[900, 0, 320], [0, 900, 240], [0, 0, 1]],
                              "poses": [{"idx": at, "rvec": v[at], "tvec": s[at]} for at in range(8)]})},
    "frames behind a T, of which one is inverted": {"a.json": json_of(
        {"T_base_flange": ROBOT, "T_board_cam": inverse(CAMERA)})},
    "MATLAB's cells": {"a.mat": _mat(robot_poses=_cells(ROBOT), board_poses=_cells(CAMERA))},
    "a struct of MATLAB": {"a.mat": _mat(data={"bTg": LAST[0], "cTo": LAST[1]})},
    "an array of structs of MATLAB": {"a.mat": _mat(samples=np.array(
        [*zip(_cells(ROBOT), _cells(CAMERA), strict=True)], [("robot", object), ("camera", object)]))},  # type: ignore[call-overload]
    "rotations beside places with a column each": {"a.npz": npz(
        R_gripper2base=R, t_gripper2base=t.T, R_target2cam=r, t_target2cam=s.T)},
    "records of which one has no detection": {"a.json": json_of([
        {"robot": ROBOT[0] @ ROBOT[1], "camera": None},
        *({"robot": a, "camera": b} for a, b in zip(ROBOT, CAMERA, strict=True))])},
    "rows without a detection: NaN, zeros, blanks": {"a.csv": lines(
        SIDES, *rows_of(t, Q, s, q), *(f"{row},{end}" for row, end in zip(
            rows_of(t[:3] + 9, Q[:3]), ("nan" + 6 * ",nan", "0" + 6 * ",0", 6 * ","), strict=True)))},
    "a pose of no detection that is the identity": {"a.json": json_of(
        {"robot": [*ROBOT, ROBOT[2] @ ROBOT[1]], "camera": [*CAMERA, np.eye(4)]})},
    "tf2_echo": {"robot.txt": lines(*_echo(ROBOT)), "camera.txt": lines(*_echo(CAMERA))},
    "Chinese names in GBK": {"a.csv": "\n".join([
        ",".join(f"{side}{one}" for side in ("机械臂", "标定板")
                 for one in ("X(毫米)", "Y(毫米)", "Z(毫米)", "RX", "RY", "RZ")),
        *rows_of(t, V, s, v)]).encode("gbk")},
    "Chinese names of files": {"机械臂末端位姿.txt": lines(*rows_of(t, V)), "标定板位姿.txt": lines(*rows_of(s, v))},
    "JSON with remarks and a comma too many": {"a.json": b"// of 2026\n" + json_of(
        {"robot": ROBOT, "camera": CAMERA}).replace(b"]]]", b"]],\n]")},
    "rows in brackets behind a word, an array of the camera": {
        "robot.txt": lines(*(f"posx({row})" for row in rows_of(t, EULER))), "camera_poses.npy": npy(CAMERA)},
    "matrices in three rows": {name: lines(*(one for pose in poses for one in (*rows_of(pose[:3], separator=" "), "")))
                               for name, poses in (("robot.txt", ROBOT[:6]), ("camera.txt", CAMERA[:6]))},
    "attributes of XML, an array of the camera": {
        "robot.xml": lines("<poses>", *(f'<pose x="{x}" y="{y}" z="{z}" qw="{w}" qx="{a}" qy="{b}" qz="{c}"/>'
            for (x, y, z), (w, a, b, c) in zip(t, Q, strict=True)), "</poses>"), "camera_poses.npy": npy(CAMERA)},
    "a row of sides above the names": {"a.csv": lines(
        "Robot,,,,,,Camera,,,,,", "X,Y,Z,RX,RY,RZ,X,Y,Z,RX,RY,RZ", *TURNED)},
    "the same names twice": {"a.csv": lines("x,y,z,rx,ry,rz,x.1,y.1,z.1,rx.1,ry.1,rz.1", *TURNED)},
    "views that only the robot has, and another order": {
        "robot.csv": lines("id,x,y,z,qw,qx,qy,qz", "20,1,2,900,1,0,0,0", *(
            f"{at},{row}" for at, row in enumerate(rows_of(t, Q)))),
        "camera.csv": lines("id,x,y,z,qw,qx,qy,qz", *(
            f"{at},{row}" for at, row in reversed([*enumerate(rows_of(s, q))])))},
    "many times of the robot": {
        "robot.csv": lines("time,x,y,z,qw,qx,qy,qz", *(
            f"{5 * at + one / 10},{row}" for at, row in enumerate(rows_of(t, Q)) for one in (0, 1, 2))),
        "camera.csv": lines("time,x,y,z,qw,qx,qy,qz", *(
            f"{5 * at + 0.104},{row}" for at, row in enumerate(rows_of(s, q))))},
    "a file a view with a list a side": {f"view_{at}.json": json_of(
        {"robot": SIX[0][at], "board": SIX[1][at]}) for at in range(8)},
    "frames of two letters behind a T": {"stations.json": json_of({"stations": [
        {"id": at, "T_be": {"rvec": V[at], "translation": t[at] / 1000}, "T_cw": {"rvec": v[at], "translation": s[at]}}
        for at in range(8)]})},
    "frames of two letters apart": {"a.npz": npz(T_B_E=ROBOT, T_C_M=CAMERA)},
    "MATLAB's, with the camera in the world and X": {"a.mat": _mat(
        bHg=LAST[0], wHc=np.moveaxis(inverse(CAMERA), 0, 2), gHc=X)},
    "twists beside transforms": {"a.json": json_of([{
        "end_pose": {name: dict(zip("xyz", numbers[at], strict=True)) for name, numbers in (
            ("linear", t), ("angular", EULER))},
        "target_pose": {"rvec": v[at], "tvec": s[at]}} for at in range(8)])},
    "joints beside a place and a quaternion, and an exposure": {f"view_{at}.json": json_of({
        "robot": {"joints_deg": np.arange(6.0) + at, "tcp": {"pos": t[at], "ori": Q[at]}}, "camera": {"exposure": 8.0},
        "board": {"rvec": v[at], "tvec": s[at]}}) for at in range(8)},
    "lists of transforms below the side": {"a.yaml": json_of({
        name: {"transforms": [dict(zip(("x", "y", "z", "qw", "qx", "qy", "qz"), row, strict=True)) for row in rows]}
        for name, rows in (("camera_marker_samples", np.concatenate([s / 1000, q], axis=1)),
                           ("hand_world_samples", np.concatenate([t / 1000, Q], axis=1)))})},
    "sections below a word": {"a.txt": lines(
        "[robot]", *rows_of(t, Q, separator=" "), "", "[target]", *rows_of(s, q, separator=" "))},
    "lists in cells": {"a.csv": lines(",robot_pose,marker_pose", *(
        f'{at},"[{one}]","[{its}]"' for at, (one, its) in enumerate(zip(rows_of(t, Q), rows_of(s, q), strict=True))))},
    "matrices in cells, over several lines": {"a.csv": lines("view;T_base_ee;T_cam_board", *(
        f'{at};"{ROBOT[at]}";"{CAMERA[at]}"' for at in range(8)))},
    "Python's literals": {
        "calibrate.py": b"import numpy as np\n" + b"".join(
            f"{name} = [{', '.join(f'np.array({one.tolist()})' for one in arrays)}]\n".encode()
            for name, arrays in (("R_gripper2base", R), ("t_gripper2base", t), ("R_target2cam", r), ("t_target2cam", s))
        )},
    "Python's literals that are appended": {"poses.py": b"robot, camera = [], []\n" + b"".join(
        f"robot.append({ROBOT[at].tolist()})\ncamera.append({CAMERA[at].tolist()})\n".encode() for at in range(8))},
    "lines of a log, an array of the camera": {"robot.log": lines(*(
        f"2026-05-01 10:00:{at}1,123 INFO tcp pose: ({row})" for at, row in enumerate(rows_of(t, EULER)))),
        "camera_poses.npy": npy(CAMERA)},
    "points of a program, an array of the camera": {"robot.prg": lines(
        "Ovrd 10", *(f"P{at}=({row})(7,0)" for at, row in enumerate(rows_of(t, EULER), 1))),
        "camera_poses.npy": npy(CAMERA)},
    "Yaskawa's job, an array of the camera": {"ROBOT.JBI": lines(
        "/JOB", "//NAME CALIB", "///NPOS 0,0,0,8,0,0", *(f"P{at:03}={row}" for at, row in enumerate(rows_of(t, EULER))),
        "NOP", "MOVJ P000 VJ=10.00", "END"), "camera_poses.npy": npy(CAMERA)},
    "the result of a calibration beside each pose": {f"{at}.meta.json": json_of({
        "robot2endEff_tf": inverse(ROBOT[at]).ravel(), "marker2cam": CAMERA[at].ravel(),
        "hand_eye_calibration": X.ravel()}) for at in range(8)},
}  # fmt: skip

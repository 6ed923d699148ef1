"""Whole sets of other programs, from small files of our own making."""

import json
from dataclasses import replace

import numpy as np
import pytest

from calibration.documents.imports.intrinsics import read_intrinsics
from calibration.documents.imports.leaves import table_of_data
from calibration.documents.imports.pairing import pair
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.sets import LAYOUTS, Chosen, ImportedSet, read_set
from calibration.documents.target import described
from calibration.documents.target_text import target_of_data, target_of_text, text_of_target
from calibration.errors import DocumentError
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.conventions import CONVENTIONS
from calibration.transforms import inverse
from tests.calibration.documents.imports.written import (
    MM,
    POSES,
    VECTORS,
    WXYZ,
    Held,
    lines,
    matrices,
    npy,
    npz,
    ros_poses,
    rows,
)


def _pictures(pattern: str, first: int = 0) -> dict[str, bytes]:
    return {pattern.format(at + first): b"" for at in range(3)}


def _flat(poses: np.ndarray) -> list[list[float]]:  # type: ignore[type-arg]
    listed: list[list[float]] = poses.reshape(len(poses), 16).tolist()
    return listed


POSE_YAML = [f"x: {x}\ny: {y}\nz: {z}\nqw: {q[0]}\nqx: {q[1]}\nqy: {q[2]}\nqz: {q[3]}\n".encode()
             for (x, y, z), q in zip(MM / 1000, WXYZ, strict=True)]  # fmt: skip

TRANSFORMS = [{"translation": pose["position"], "rotation": pose["orientation"]} for pose in ros_poses()]

SETS: dict[str, tuple[dict[str, bytes], str | None]] = {
    "industrial_calibration": (
        {
            "cal_data.yaml": json.dumps({
                "data": [{"pose": f"poses/{at}.yaml", "image": f"images/{at}.png"} for at in range(3)],
                "target_finder": {"type": "CharucoGridTargetFinder", "rows": 7, "cols": 5, "chessboard_dim": 0.036195,
                                  "aruco_marker_dim": 0.018256, "dictionary": 10},
                "intrinsics": {"fx": 1352.0, "fy": 1356.1, "cx": 789.7, "cy": 627.3}, "static_camera": False,
            }).encode(),
            **_pictures("images/{}.png"), **{f"poses/{at}.yaml": text for at, text in enumerate(POSE_YAML)},
        },
        None,
    ),
    "METRIC": (
        {
            "CalibrationInfo.yaml": b"number_of_rows: 4\nnumber_of_columns: 3\nsize: 0.05\npattern_type: checkerboard\n"
                                    b"calibration_setup: 0\n",
            **{f"camera{c}/pose/000{at}.csv": lines(*(" ".join(map(str, row)) for row in pose))
               for c in (1, 2) for at, pose in enumerate(matrices(metres=True))},
            **_pictures("camera1/image/000{}.png"), **_pictures("camera2/image/000{}.png"),
            "camera2/intrinsic_pars_file.yaml": b"fx: 1371.0\nfy: 1371.0\ncx: 960.5\ncy: 540.5\nhas_dist_coeff: 1\n"
                                                b"dist_k0: 1e-08\nimg_width: 1920\nimg_height: 1080\n",
        },
        "camera2",
    ),
    "BOP": (
        {
            "000001/scene_camera.json": json.dumps({
                str(at): {"cam_K": [600, 0, 320, 0, 600, 240, 0, 0, 1], "cam_R_w2c": pose[:3, :3].ravel().tolist(),
                          "cam_t_w2c": pose[:3, 3].tolist(), "depth_scale": 1.0}
                for at, pose in enumerate(inverse(POSES))}).encode(),
            **_pictures("000001/rgb/00000{}.png"), **_pictures("000001/depth/00000{}.png"),
        },
        None,
    ),
    "RWHE": (
        {
            "robot_cali.txt": lines("3", *("\n".join(" ".join(map(str, row)) for row in pose) + "\n"
                                           for pose in inverse(POSES))),
            "calibration_object.txt": b"chess_mm_height 28.5\nchess_mm_width 28.5\nchess_height 6\nchess_width 8\n",
            **_pictures("images/camera0/image{}.png"), "internal_images/camera0/i.png": b"",
        },
        None,
    ),
    "ViSP": (
        {
            **{f"franka_pose_rPe_{at}.yaml": lines("rows: 6", "cols: 1", "data: ", *(f"  - [{number:.9f}]" for number in
               (*mm, *vector))) for at, (mm, vector) in enumerate(zip(MM / 1000, VECTORS, strict=True), 1)},
            **_pictures("franka_image-{}.png", 1),
            "franka_camera.xml": b"<?xml version='1.0'?><root><!--c--><camera><image_width>640</image_width>"
                b"<image_height>480</image_height><model><px>607.5</px><py>607.6</py><u0>323</u0><v0>243</v0>"
                b"<kud>0.1</kud></model></camera></root>",
        },
        None,
    ),
    "samples of pose pairs": (
        {"cell.samples": json.dumps({
            "parameters": {"calibration_type": "eye_in_hand"},
            "samples": [{"robot": one, "tracking": one} for one in TRANSFORMS]}).encode()},
        None,
    ),
}  # fmt: skip


def read(case: str) -> ImportedSet:
    files, part = SETS[case]
    return read_set(Held(files), part, Chosen())


def poses_of(imported: ImportedSet) -> np.ndarray:  # type: ignore[type-arg]
    (convention,), (unit,) = imported.poses.conventions(), imported.poses.units()
    frame, *_ = imported.poses.named_frames or imported.poses.frames()
    return imported.poses.poses(convention, unit, frame)


@pytest.mark.parametrize("case", SETS)
def test_a_set_is_recognised_and_its_poses_need_no_guess(case: str) -> None:
    imported = read(case)
    assert imported.kind == case
    np.testing.assert_allclose(poses_of(imported), POSES, atol=1e-5)
    if imported.camera_poses is None:
        assert len(imported.images) == 3
        assert len(set(imported.images)) == 3


def test_every_kind_has_a_sample() -> None:
    known = {layout.name for layout in LAYOUTS}
    assert known | {"industrial_calibration", "samples of pose pairs"} == set(SETS)


def test_targets_of_the_sets() -> None:
    described = {case: target_of_data(found, case) for case in SETS if (found := read(case).target) is not None}
    assert described == {
        "industrial_calibration": target_of_text("charuco:5x7:36.195:18.256:DICT_6X6_250"),
        "METRIC": target_of_text("chessboard:3x4:50"),
        "RWHE": target_of_text("chessboard:8x6:28.5"),
    }


def test_our_own_session_is_a_folder_whose_poses_and_pictures_one_file_names() -> None:
    own = [{"translation_mm": mm.tolist(), "quaternion_wxyz": q.tolist()} for mm, q in zip(MM, WXYZ, strict=True)]
    views = [{"image": f"view_{at}.png", "base_T_flange": one} for at, one in enumerate(own)]
    target = {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 23.6}
    session = {"schema_version": 1, "setup": "eye-in-hand", "camera": None, "target": target, "views": views}
    files = {"session.json": json.dumps(session).encode(), **_pictures("view_{}.png")}
    imported = read_set(Held(files), None, Chosen())
    np.testing.assert_allclose(poses_of(imported), POSES, atol=1e-5)
    assert (imported.images, imported.target, imported.setup) == (
        ("view_0.png", "view_1.png", "view_2.png"), target, "eye-in-hand"
    )  # fmt: skip


def test_our_own_scan_may_state_its_poses_as_matrices_and_the_unit_of_its_clouds() -> None:
    views = [{"cloud": f"{at}.ply", "unit": "m", "base_T_flange": {"matrix": pose.tolist()}}
             for at, pose in enumerate(matrices())]  # fmt: skip
    files = {"scan.json": json.dumps({"views": views}).encode(), **{view["cloud"]: b"" for view in views}}
    imported = read_set(Held(files), None, Chosen())
    np.testing.assert_allclose(poses_of(imported), POSES, atol=1e-5)
    assert (imported.cloud_unit, imported.images) == ("m", ("0.ply", "1.ply", "2.ply"))


def test_zivid_s_matrices_stand_in_a_folder_of_their_own_pictures() -> None:
    written = "__version__:\n  serializer: 1\n  data: 1\nFloatMatrix:\n  Data:\n    "
    files = {f"pos{at + 1:02}.yaml": (written + json.dumps(pose.tolist())).encode() for at, pose in enumerate(POSES)}
    imported = read_set(Held(files | _pictures("img0{}.png", 1) | _pictures("img0{}.ply", 1)), None, Chosen())
    np.testing.assert_allclose(poses_of(imported), POSES, atol=1e-5)
    assert imported.images == ("img01.png", "img02.png", "img03.png")
    with pytest.raises(DocumentError, match="save PNG or PLY beside them with Zivid's SDK"):
        read_set(Held(files | _pictures("img0{}.zdf", 1)), None, Chosen())


@pytest.mark.parametrize("key", ["corners_px", "points_mm"])
def test_a_session_of_corners_or_points_is_solved_as_it_is(key: str) -> None:
    views = [{key: [], "base_T_flange": {}}]
    with pytest.raises(DocumentError, match="run handeyed solve set"):
        read_set(Held({"session.json": json.dumps({"views": views}).encode()}), None, Chosen())


def test_two_files_with_the_same_poses_are_one() -> None:
    files = {"poses.txt": lines(*rows(MM, WXYZ)), "poses.npy": npy(np.concatenate([MM, WXYZ], axis=1))}
    assert len(read_set(Held(files | _pictures("{}.png")), None, Chosen()).poses) == 3
    files["other.txt"] = lines(*rows(MM + 1, WXYZ))
    with pytest.raises(DocumentError, match="poses in several files"):
        read_set(Held(files | _pictures("{}.png")), None, Chosen())


def test_files_of_one_pose_each_are_named_by_the_glob_that_takes_them() -> None:
    series = {
        f"run{at % 2}/{at // 2}{kind}.txt": matrices()[at % 3].ravel() for at in range(6) for kind in ("_a", "_b")
    }
    files = Held({name: lines(",".join(map(str, numbers))) for name, numbers in series.items()} | _pictures("{}.png"))
    with pytest.raises(DocumentError, match=r"\(run0/\*_a\.txt, run0/\*_b\.txt, run1/\*_a\.txt, run1/\*_b\.txt\)"):
        read_set(files, None, Chosen())
    assert read_set(files, None, Chosen(poses="run1/*_b.txt")).poses.labels == ("0_b", "1_b", "2_b")


def test_a_picture_that_several_rows_name_is_said() -> None:
    rows_named = [f"{name},{row}" for name, row in zip(("0.png", "1.png", "1.png"), rows(MM, WXYZ), strict=True)]
    files = {"poses.csv": lines("image,x,y,z,qw,qx,qy,qz", *rows_named)} | _pictures("{}.png")
    assert read_set(Held(files), None, Chosen()).pairing == "by the names in the table; of several poses each: 1.png"


def test_a_file_for_each_pose_is_known_by_the_number_anywhere_in_its_name() -> None:
    files = {f"{at}_frame.txt": f"np.array({pose.tolist()})".encode() for at, pose in enumerate(matrices())}
    imported = read_set(Held(files | _pictures("{}_frame.png")), None, Chosen())
    np.testing.assert_allclose(imported.poses.lengths, MM, atol=1e-5)
    assert imported.images == ("0_frame.png", "1_frame.png", "2_frame.png")


K_PX = [[600.0, 0, 320], [0, 601, 240], [0, 0, 1]]
CAMERA_TEXT = b"camera_matrix: [[700, 0, 320], [0, 701, 240], [0, 0, 1]]\ndist: [0.2, 0, 0, 0]\n"
IN_THE_FOLDER: dict[str, tuple[dict[str, bytes], float | None]] = {
    ".npz": ({"calib.npz": npz(mtx=K_PX, dist=[[0.1, -0.2, 0, 0, 0]])}, 600),
    ".npy": ({"K.npy": npy(np.array(K_PX))}, 600),
    "a text first": ({"K.npy": npy(np.array(K_PX)), "camera.yaml": CAMERA_TEXT}, 700),
    "two": ({"K.npy": npy(np.array(K_PX)), "left.npz": npz(K=K_PX)}, None),
    "no camera": ({"R.npy": npy(np.eye(3))}, None),
}


@pytest.mark.parametrize("case", IN_THE_FOLDER)
def test_the_camera_of_a_folder(case: str) -> None:
    files, fx = IN_THE_FOLDER[case]
    table = lines("x,y,z,qw,qx,qy,qz", *rows(MM, WXYZ))
    imported = read_set(Held({"poses.csv": table} | _pictures("{}.png") | files), None, Chosen())
    assert (imported.camera and imported.camera.matrix[0][0]) == fx


def test_a_camera_is_no_file_that_could_have_had_poses() -> None:
    files = {"calib.npz": npz(mtx=K_PX, dist=[0.1, -0.2, 0, 0, 0])}
    with pytest.raises(DocumentError, match="no file with poses: name it by --poses"):
        read_set(Held(files | _pictures("{}.png")), None, Chosen())


def test_set_ups_of_the_sets() -> None:
    files, _ = SETS["METRIC"]
    beside = files | {"CalibrationInfo.yaml": b"calibration_setup: 1\nsize: 0.05\n"}
    assert read("METRIC").setup == "eye-in-hand"
    assert read_set(Held(beside), "camera1", Chosen()).setup == "eye-to-hand"


def test_easy_handeye_writes_the_base_in_the_effector_when_the_camera_stands() -> None:
    samples = {
        "parameters": {"calibration_type": "eye_on_base"},
        "samples": [{"robot": one, "tracking": one} for one in TRANSFORMS],
    }
    imported = read_set(Held({"a.samples": json.dumps(samples).encode()}), None, Chosen())
    np.testing.assert_allclose(poses_of(imported), inverse(POSES), atol=1e-5)
    assert imported.setup == "eye-to-hand"


def test_joint_states_need_the_arm() -> None:
    names = [f"joint_{at}" for at in (2, 1, 3, 4, 5, 6)]
    joints = [[0.1, 0.2 + 0.1 * at, 0.3, 0.4, 0.5, 0.6] for at in range(3)]
    states = json.dumps({"joint_names": names, "joint_values": joints}).encode()
    files = Held({"states.yaml": states, **_pictures("a{}.png")})
    with pytest.raises(DocumentError, match="joint states, no poses: give the arm by --arm"):
        read_set(files, None, Chosen())
    imported = read_set(files, None, Chosen(), "IRB 1200-5/0.9")
    in_order = np.array([[row[1], row[0], *row[2:]] for row in joints])
    np.testing.assert_allclose(poses_of(imported), find_arm("IRB 1200-5/0.9").forward(in_order), atol=1e-9)


def test_a_session_s_own_pose_pairs() -> None:
    own = [{"translation_mm": mm.tolist(), "quaternion_wxyz": q.tolist()} for mm, q in zip(MM, WXYZ, strict=True)]
    views = [{"base_T_flange": one, "camera_T_target": one} for one in own]
    data = json.dumps({"schema_version": 1, "setup": "eye-to-hand", "views": views}).encode()
    imported = read_set(Held({"session.json": data}), None, Chosen())
    np.testing.assert_allclose(poses_of(imported), POSES, atol=1e-9)
    assert imported.setup == "eye-to-hand"


def test_moveit_s_samples_of_both_kinds() -> None:
    flat = _flat(matrices(metres=True))
    by_name = [{"effector_wrt_world": one, "object_wrt_sensor": one} for one in flat]
    pairs = [[one, one] for one in matrices(metres=True).tolist()]
    for name, data in (("s.yaml", by_name), ("s.json", pairs)):
        imported = read_set(Held({name: json.dumps(data).encode()}), None, Chosen())
        np.testing.assert_allclose(poses_of(imported), POSES, atol=1e-6)
        assert imported.camera_poses is not None


def test_a_set_of_several_cameras_asks_for_one() -> None:
    with pytest.raises(DocumentError, match="2 cameras"):
        read_set(Held(SETS["METRIC"][0]), None, Chosen())


def test_a_picture_too_many_is_refused_with_both_lists() -> None:
    files = {"poses.csv": lines("x,y,z,qw,qx,qy,qz", *rows(MM, WXYZ)), **_pictures("a{}.png"), "a3.png": b""}
    with pytest.raises(DocumentError, match=r"4 pictures \(a0.png, a1.png, a2.png, a3.png\) and 3 poses \(1, 2, 3\)"):
        read_set(Held(files), None, Chosen())


def test_natural_order_and_numbers_pair_pictures_with_poses() -> None:
    names = ("view_2.png", "view_10.png", "view_9.png")
    table = lines("x,y,z,qw,qx,qy,qz", *rows(MM, WXYZ))
    files = {"poses.csv": table, **dict.fromkeys(names, b"")}
    assert read_set(Held(files), None, Chosen()).images == ("view_2.png", "view_9.png", "view_10.png")
    numbered = lines("nr,x,y,z,qw,qx,qy,qz", *(f"{n},{row}" for n, row in zip((9, 10, 2), rows(MM, WXYZ), strict=True)))
    imported = read_set(Held({**files, "poses.csv": numbered}), None, Chosen())
    assert imported.images == ("view_9.png", "view_10.png", "view_2.png")
    assert imported.pairing == "by the numbers in the names"


def test_times_pair_pictures_with_a_trajectory() -> None:
    times = np.array([[100.0 + 0.01 * at] for at in range(300)])
    pose = np.repeat(np.concatenate([MM[:1], np.roll(WXYZ[:1], -1, axis=1)], axis=1), 300, axis=0)
    files = {"hand.tum": lines(*rows(times, pose, separator=" "))}
    files |= {f"{time:.6f}.png": b"" for time in (100.501, 101.499, 102.25)}
    imported = read_set(Held(files), None, Chosen())
    assert imported.poses.times_s is not None
    np.testing.assert_allclose(imported.poses.times_s, [100.5, 101.5, 102.25], atol=1e-6)


INTRINSICS = {
    "ROS": ("a.yaml", "image_width: 640\nimage_height: 480\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
            "  data: [600, 0, 320, 0, 601, 240, 0, 0, 1]\ndistortion_model: plumb_bob\n"
            "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.1, -0.2, 0.001, 0.002, 0.0]\n"),
    "ROS message": ("a.json", json.dumps({"width": 640, "height": 480, "distortion_model": "plumb_bob",
                    "k": [600, 0, 320, 0, 601, 240, 0, 0, 1], "d": [0.1, -0.2, 0.001, 0.002, 0.0]})),
    "OpenCV": ("a.yml", "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n"
               "   rows: 3\n   cols: 3\n   dt: d\n   data: [ 600., 0., 320., 0., 601., 240., 0., 0., 1. ]\n"
               "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n"
               "   data: [ 1.0e-01, -2.0e-01, 1.0e-03, 2.0e-03, 0. ]\n"),
    "Kalibr": ("a.yaml", "cam0:\n  camera_model: pinhole\n  intrinsics: [600, 601, 320, 240]\n"
               "  distortion_model: radtan\n  distortion_coeffs: [0.1, -0.2, 0.001, 0.002]\n"
               "  resolution: [640, 480]\n"),
    "OpenCV with remarks": ("a.yml", "%YAML:1.0\n# written by a line\n---\n# lens 12 mm\nimage_size: [640, 480]\n"
                            "mtx: [[600, 0, 320], [0, 601, 240], [0, 0, 1]]\ndist: [[0.1, -0.2, 0.001, 0.002, 0]]\n"),
    "Zivid": ("a.yml", "ImageSize: [640, 480]\nCamera:\n  CameraMatrix: {CX: 320, CY: 240, FX: 600, FY: 601}\n"
              "  Distortion: {K1: 0.1, K2: -0.2, K3: 0, P1: 0.001, P2: 0.002}\n"),
    "VINS": ("a.yaml", "%YAML:1.0\n---\nmodel_type: PINHOLE\nimage_width: 640\nimage_height: 480\n"
             "distortion_parameters:\n   k1: 0.1\n   k2: -0.2\n   p1: 0.001\n   p2: 0.002\n"
             "projection_parameters:\n   fx: 6.0e+02\n   fy: 601.\n   cx: 320.\n   cy: 240.\n"),
    "handeyed": ("a.json", json.dumps({"camera": {"matrix": [[600, 0, 320], [0, 601, 240], [0, 0, 1]],
                 "distortion": [0.1, -0.2, 0.001, 0.002, 0], "image_size": [640, 480]}})),
}  # fmt: skip


@pytest.mark.parametrize("case", INTRINSICS)
def test_intrinsics(case: str) -> None:
    name, text = INTRINSICS[case]
    camera = read_intrinsics(name, text.encode()).document(None).camera()
    np.testing.assert_allclose(camera.matrix, [[600, 0, 320], [0, 601, 240], [0, 0, 1]])
    np.testing.assert_allclose(camera.distortion[:5], [0.1, -0.2, 0.001, 0.002, 0])
    assert not camera.distortion[5:].any()
    assert camera.image_size == (640, 480)


LEFT = {"K": [600, 0, 320, 0, 601, 240, 0, 0, 1], "D": [0.1, 0, 0, 0, 0]}
NOT_ONE_CAMERA = {
    "two cameras": ({"left": LEFT, "right": {**LEFT, "D": [0.2, 0, 0, 0, 0]}}, "several cameras"),
    "MATLAB's distortion": ({"K": LEFT["K"], "RadialDistortion": [0.1, -0.2]}, "radialdistortion: distortion that"),
    "radial terms alone": ({"K": LEFT["K"], "D": [0.1, -0.2, 0.3]}, "distortion"),
    "not a number": ({"K": LEFT["K"], "D": [0.1, ".Nan", 0, 0, 0]}, "d: distortion that is not read"),
    "double sphere": ({"fx": 350, "fy": 350, "cx": 320, "cy": 240, "xi": -0.2, "alpha": 0.6}, "xi: distortion that"),
    "a point in a coefficient's place": (
        {**dict.fromkeys(("fx", "fy", "cx", "cy"), 300), "k1": [0.1]},
        "k1: distortion",
    ),
    "HALCON's kappa": ({**dict.fromkeys(("fx", "fy", "cx", "cy"), 300), "kappa": -900.0}, "kappa: distortion that"),
    "21 cameras": ({str(at): LEFT | ({"D": [0.2] * 5} if at == 20 else {}) for at in range(21)}, "several cameras"),
    "a model beside": (
        {"lens": "16 mm", "model_type": "MEI", "camera": LEFT},
        "'mei' is not",
    ),
    "omni": ({"camera_model": "omni", "intrinsics": LEFT}, "'omni' is not read"),
    "division": ({"camera": {**LEFT, "distortion_model": "division"}}, "'division' is not read"),
    "a model in the distortion": ({"K": LEFT["K"], "distortion": {"model": "fov", "k1": 0.1}}, "'fov' is not read"),
    "a model with capitals": ({"K": LEFT["K"], "Distortion": {"Model": "Fov", "K1": 0.1}}, "'fov' is not read"),
    "a list beside a number": ({**dict.fromkeys(("fx", "fy", "cx", "cy"), 300), "k1": 0.1, "p1": [0.01]}, "k1: dist"),
    "of the width": ({"fx": 0.9, "fy": 1.2, "cx": 0.5, "cy": 0.5}, "in px"),
}


@pytest.mark.parametrize("case", NOT_ONE_CAMERA)
def test_intrinsics_that_are_not_read_whole_are_refused(case: str) -> None:
    data, what = NOT_ONE_CAMERA[case]
    with pytest.raises(DocumentError, match=what):
        read_intrinsics("a.json", json.dumps(data).encode()).document((640, 480))


FOUR = {"fx": 600, "fy": 601, "cx": 320, "cy": 240}
BESIDE_THE_CAMERA = {
    "name of the lens": {"lens": "Fujinon HF16", "camera": LEFT},
    "name of the camera": {"camera_model": "acA2440", "intrinsics": LEFT},
    "an aspherical lens": {"lens": "aspherical 12 mm, 82 deg HFOV", "camera_model": "oCam-5CRO-U", **LEFT},
    "name of a maker": {"camera_model": "OmniVision OV9281", "lens": {"focal_mm": 8}, **LEFT},
    "orientation beside": {"intrinsics": {**FOUR, "k1": 0.1}, "exterior": {"omega": 0.1, "phi": 0.2, "kappa": 0.3}},
    "points": {**LEFT, "p1": [1, 2, 3], "p2": {"x": 1}},
    "coefficients of another": {"camera": LEFT, "scanner": {"k1": 0.5, "distortion_model": "of the laser"}},
    "distortion around": {"camera_matrix": FOUR, "distortion_coefficients": [0.1, 0, 0, 0, 0]},
    "distortion beside 30 others": {"camera": FOUR, **{f"m{at}": {"a": 1} for at in range(30)}, "dist": {"k1": 0.1}},
    "thousands of pictures": {str(at): {"cam_K": LEFT["K"], "k1": 0.1} for at in range(3000)},
}


@pytest.mark.parametrize("case", BESIDE_THE_CAMERA)
def test_what_stands_beside_a_camera_is_not_its_lens(case: str) -> None:
    read = read_intrinsics("a.json", json.dumps(BESIDE_THE_CAMERA[case]).encode())
    assert (read.matrix[0], read.distortion[0], any(read.distortion[1:])) == ((600, 0, 320), 0.1, False)


def test_the_angles_of_a_camera_s_pose_are_no_distortion() -> None:
    posed = {**FOUR, "omega": 0.1, "phi": 0.2, "kappa": 0.3, "p1": [1, 2, 3], "camera_model": "acA2440"}
    assert not read_intrinsics("a.json", json.dumps(posed).encode()).has_distortion


def test_a_fisheye_and_a_model_that_is_not_read() -> None:
    kalibr = INTRINSICS["Kalibr"][1]
    assert read_intrinsics("a.yaml", kalibr.replace("radtan", "equidistant").encode()).lens == "fisheye"
    short = {"K": LEFT["K"], "D": [0.1]}
    assert read_intrinsics("a.json", json.dumps(short).encode()).distortion == (0.1, 0, 0, 0)
    with pytest.raises(DocumentError, match="'omni' is not read"):
        read_intrinsics("a.yaml", kalibr.replace("pinhole", "omni").encode())


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("chess:9x6:23", "no such kind"),
        ("chessboard:9x6", "write chessboard:COLUMNSxROWS:pitch_mm"),
        ("chessboard:9by6:23", "columns"),
        ("charuco:5x7:18:36:DICT_6X6_250", "smaller"),
    ],
)
def test_a_target_that_is_none_is_refused(text: str, what: str) -> None:
    with pytest.raises(DocumentError, match=what):
        target_of_text(text)


@pytest.mark.parametrize(
    "text",
    [
        "chessboard:9x6:1.0",
        "charuco:12x9:1.0:0.734:DICT_5X5_100",
        "charuco:12x8:20.0:15.0:DICT_4X4_50:legacy",
        "circles-asymmetric:7x11:1.0:white",
        "circles-symmetric:9x6:1.0:black:large-dot",
        "apriltag-grid:5x4:1.0:0.3333:tag36h11",
        "aruco-grid:5x4:1.0:0.25:DICT_5X5_100:3",
        "aruco-marker:1.0:DICT_5X5_100:0",
    ],
)
def test_a_target_is_written_as_it_is_read(text: str) -> None:
    target = target_of_text(text)
    assert target_of_text(text_of_target(target)) == target
    assert text_of_target(target).startswith(text)


def test_circles() -> None:
    target = target_of_text("circles-asymmetric:7x11:20:white")
    assert described(target) == {
        "kind": "circles", "layout": "asymmetric", "columns": 7, "rows": 11, "pitch_mm": 20.0, "dots": "white",
    }  # fmt: skip


TABLE = PoseTable(
    "poses.csv",
    tuple("12345"),
    np.arange(15.0).reshape(5, 3) + 400,
    np.tile([1.0, 0, 0, 0], (5, 1)),
    "quaternion",
    "rows",
)


@pytest.mark.parametrize(
    ("pictures", "rows"),
    [(("img01.png", "img03.png", "img05.png"), (0, 2, 4)), (("0.png", "3.png"), (0, 3)), (("2.png", "3.png"), None)],
)
def test_where_pictures_were_deleted_their_numbers_say_the_row(
    pictures: tuple[str, ...], rows: tuple[int, ...] | None
) -> None:
    """Numbers that may begin with 0 or with 1 are asked for."""
    if rows is None:
        with pytest.raises(DocumentError, match=r"2 pictures .* and 5 poses"):
            pair(pictures, TABLE)
    else:
        assert pair(pictures, TABLE).rows == rows


def test_more_pictures_than_files_of_poses_are_paired_by_their_numbers() -> None:
    named = replace(TABLE, labels=("pose01", "pose02", "pose04", "pose05", "pose06"))
    paired = pair(tuple(f"img{at}.png" for at in range(8)), named)
    assert paired.images == ("img1.png", "img2.png", "img4.png", "img5.png", "img6.png")
    assert paired.words == "by the numbers in the names; 3 pictures without a pose are left out"


XYZW = CONVENTIONS["quaternion-xyzw"]


def _frames(*names: str) -> bytes:
    """Records of each picture with the poses of tf's frames, of which the base and the other arm stand still."""
    still = {"position": [0.0, 0.0, 0.4], "orientation": [0.0, 0.0, 0.0, 1.0], "stamp": {"sec": 7}}
    records = []
    for at, (place, turn) in enumerate(zip(MM / 1000, WXYZ, strict=True)):
        moving = {"position": place.tolist(), "orientation": np.roll(turn, -1).tolist(), "stamp": {"sec": at}}
        records.append(
            {"image": f"{at}.png", "poses": {"world": still, "left_hand": still} | dict.fromkeys(names, moving)}
        )
    return json.dumps(records).encode()


def test_of_the_frames_in_a_record_the_one_that_moves_is_the_robot_s() -> None:
    imported = read_set(Held({"poses.json": _frames("right_hand"), **_pictures("{}.png")}), None, Chosen())
    np.testing.assert_allclose(imported.poses.poses(XYZW, "m", "base_T_flange"), POSES, atol=1e-6)
    assert imported.images == ("0.png", "1.png", "2.png")


def test_of_several_frames_that_move_one_is_named_by_part() -> None:
    files = Held({"poses.json": _frames("link6", "right_hand"), **_pictures("{}.png")})
    with pytest.raises(DocumentError, match=r"2 moving frames \(.*\): name the one .* --part FRAME"):
        read_set(files, None, Chosen())
    named = read_set(files, "link6", Chosen()).poses
    np.testing.assert_allclose(named.poses(XYZW, "m", "base_T_flange"), POSES, atol=1e-6)


def test_a_record_may_hold_the_corners_that_were_seen_from_its_pose() -> None:
    """As recorders of circle grids write it: 20 points beside one pose, which are no 20 views."""
    seen = {
        "found": True,
        "imgpts2d": [[float(at), 2.0 * at] for at in range(20)],
        "points": [[0.1, 0.2, 0.3 * at] for at in range(20)],
    }
    record = {
        "image": "i.png",
        "gripper_pose_base": {"H": matrices()[0].tolist()},
        "joints": [[0.0, 1.0], [2.0]],
        "detection": seen,
    }
    table = table_of_data(record, "he_record_0000.json")
    assert len(table) == 1
    np.testing.assert_allclose(table.lengths[0], matrices()[0][:3, 3])


def test_joints_beside_the_pose_in_a_file_for_each_view_are_not_the_pose() -> None:
    six = np.concatenate([MM / 1000, VECTORS], axis=1)
    files = {
        f"{at}.json": json.dumps({"joints": [0.1 * at] * 6, "pose_flange": row.tolist()}).encode()
        for at, row in enumerate(six)
    }
    poses = read_set(Held(files | _pictures("{}.jpg")), None, Chosen()).poses
    np.testing.assert_allclose(poses.lengths, MM / 1000)
    np.testing.assert_allclose(poses.numbers, VECTORS)


def test_arrays_that_savez_named_are_known_by_their_shapes() -> None:
    size, topic = np.array([[640], [480]]), np.array("/color/image_raw")
    files = {
        f"shot_{at}.npz": npz(place, np.roll(turn, -1), np.zeros((48, 64, 3), np.uint8), size, topic)
        for at, (place, turn) in enumerate(zip(MM, WXYZ, strict=True))
    }
    poses = read_set(Held(files | _pictures("shot_{}.png")), None, Chosen()).poses
    np.testing.assert_allclose(poses.poses(XYZW, "mm", "base_T_flange"), POSES, atol=1e-6)


def test_a_column_for_each_view_is_a_row() -> None:
    views = np.tile(np.concatenate([WXYZ, MM], axis=1), (8, 1))
    table = table_of_data({"hand_poses": views.T.tolist(), "image_width": 640}, "a.yml")
    np.testing.assert_allclose(table.lengths, np.tile(MM, (8, 1)))


def test_opencv_s_yaml_is_known_in_a_text() -> None:
    written = (f"gripper{at}: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: d\n  data: {row}" for at, row in
                 enumerate(_flat(POSES)))  # fmt: skip
    files = {"poses.txt": lines("%YAML:1.0", "---", *written), **_pictures("{}.png")}
    np.testing.assert_allclose(read_set(Held(files), None, Chosen()).poses.lengths, MM)


def test_a_name_in_full_means_that_file_and_a_pattern_the_end_of_a_path() -> None:
    content, other = lines(*rows(MM, WXYZ)), lines(*rows(MM + 1, WXYZ))
    files = {"poses.csv": content, "backup/poses.csv": other, **_pictures("in/shots/{}.png"), "in/board.png": b""}
    imported = read_set(Held(files), None, Chosen(poses="poses.csv", images="shots/*"))
    np.testing.assert_allclose(imported.poses.lengths, MM, atol=1e-6)
    assert imported.images == ("in/shots/0.png", "in/shots/1.png", "in/shots/2.png")


@pytest.mark.parametrize(("name", "fix"), [("poses.xlsx", "save the sheet as CSV"), ("poses.ods", "save it as CSV"),
                                           ("poses.pickle", "save arrays")])  # fmt: skip
def test_a_sheet_or_a_pickle_is_named_rather_than_the_one_pose_of_a_result(name: str, fix: str) -> None:
    result = json.dumps({"R": POSES[0, :3, :3].tolist(), "t": MM[0].tolist()}).encode()
    with pytest.raises(DocumentError, match=fix):
        read_set(Held({name: b"PK", "result.json": result, **_pictures("{}.png")}), None, Chosen())


def test_places_without_orientation_are_named_before_a_camera_s_matrix() -> None:
    files = {"K_rgb.txt": lines("900 0 320", "0 900 240", "0 0 1"), "pos_act.txt": lines(*rows(MM, separator=" "))}
    with pytest.raises(DocumentError, match=r"pos_act.txt: rows: 3 numbers a row: points of one side"):
        read_set(Held(files | _pictures("{}.png")), None, Chosen())

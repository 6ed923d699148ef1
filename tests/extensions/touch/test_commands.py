"""`handeyed tip` and `handeyed touch`."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import ArmErrorModel, Postures
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform
from tests.daemon.calibrations import an_arm
from tests.daemon.cli.running import Ran, handeyed
from tests.daemon.cli.sessions import BASE_T_TARGET, TARGET, TILTS_RAD, base_T_flange, with_corners

TIP = np.array([10.0, -20.0, 160.0])
TILTS = 0.5 * np.array([[1.0, 0, 0], [-1, 0, 0.2], [0, 1, 0.1], [0, -1, 0], [0.7, 0.7, 0.3], [-0.7, 0.7, 0]])


def poses_at(point_mm: Array, noise_mm: float = 0.03) -> Array:
    """base_T_flange (6, 4, 4) with the tip at the point, within the noise."""
    rotations = rotation_from_vector([np.pi, 0, 0]) @ rotation_from_vector(TILTS)
    off = np.random.default_rng(4).normal(0, noise_mm, (len(TILTS), 3))
    return transform(rotations, point_mm - rotations @ TIP + off)


def csv(file: Path, poses: Array, header: str = "name,x,y,z,qw,qx,qy,qz") -> Path:
    documents = [PoseDocument.of(pose) for pose in poses]
    rows = [
        ",".join(map(repr, (f"p{i + 1}", *pose.translation_mm, *pose.quaternion_wxyz))).replace("'", "")
        for i, pose in enumerate(documents)
    ]
    file.write_text("\n".join([header, *rows]) + "\n")
    return file


@pytest.fixture
def tip(tmp_path: Path) -> Path:
    """tip.json by the command."""
    ran = handeyed(
        "tip", csv(tmp_path / "poses.csv", poses_at(np.array([900.0, 300, 50]))), "-o", tmp_path / "tip.json"
    )
    assert (ran.status, ran.err) == (0, "")
    assert "6 of 6 poses used" in ran.out
    return tmp_path / "tip.json"


def test_a_tip_is_found_from_a_file_of_poses(tip: Path) -> None:
    found = json.loads(tip.read_bytes())
    assert found["flange_tip_mm"] == pytest.approx(TIP.tolist(), abs=0.15)
    assert 0.005 < found["placing_sigma_mm"] < 0.1
    assert [pose["name"] for pose in found["poses"]] == ["p1", "p2", "p3", "p4", "p5", "p6"]


def test_angles_of_an_unnamed_convention_are_decided_by_the_poses(tmp_path: Path) -> None:
    from scipy.spatial.transform import Rotation

    poses = poses_at(np.array([900.0, 300, 50]))
    angles = Rotation.from_matrix(poses[:, :3, :3]).as_euler("ZYX", degrees=True)
    rows = [",".join(map(repr, map(float, row))) for row in np.column_stack([poses[:, :3, 3], angles])]
    (tmp_path / "poses.csv").write_text("\n".join(rows) + "\n")
    ran = handeyed("tip", tmp_path / "poses.csv", "--json")
    assert (ran.status, ran.err) == (0, "")
    assert json.loads(ran.out)["flange_tip_mm"] == pytest.approx(TIP.tolist(), abs=0.15)


@pytest.mark.parametrize(("poses", "status", "says"), [
    (poses_at(np.zeros(3))[:3], 1, "3 poses do not show"),
    (transform(np.eye(3)[None].repeat(6, axis=0), np.arange(18.0).reshape(6, 3) + 500), 1, "turn too little"),
], ids=["few", "unturned"])  # fmt: skip
def test_poses_that_show_no_tip_are_refused(tmp_path: Path, poses: Array, status: int, says: str) -> None:
    ran = handeyed("tip", csv(tmp_path / "poses.csv", poses))
    assert ran.status == status
    assert says in ran.err


def touches(file: Path, calibrated: Array, off_mm: Array, **more: Any) -> Path:
    """Touches of three corners by id and of one point by its place in the camera, all `off_mm` beside."""
    corners = {identity: TARGET.points_mm[identity] for identity in (0, 5, 23)}
    look = base_T_flange(TILTS_RAD[0])
    camera_mm = np.array([30.0, -40.0, 500.0])
    points = [map_points(BASE_T_TARGET, corner[None])[0] for corner in corners.values()]
    points.append(map_points(look @ calibrated, camera_mm[None])[0])
    poses = [PoseDocument.of(poses_at(p + off_mm, 0.0)[0]).model_dump(mode="json") for p in points]
    listed: list[dict[str, Any]] = [
        {"id": identity, "base_T_flange": pose} for identity, pose in zip(corners, poses, strict=False)
    ]
    seen_from = PoseDocument.of(look).model_dump(mode="json")
    listed.append(
        {"name": "hole", "camera_mm": camera_mm.tolist(), "seen_from": seen_from, "base_T_flange": poses[3]} | more
    )
    file.write_text(json.dumps({"touches": listed}))
    return file


@pytest.fixture
def calibration(tmp_path: Path, solved: Ran) -> Path:
    (tmp_path / "calibration.json").write_text(solved.out)
    return tmp_path / "calibration.json"


def touch(tmp_path: Path, tip: Path, off_mm: Array, *options: object, **more: Any) -> Ran:
    x = PoseDocument.model_validate(json.loads((tmp_path / "calibration.json").read_bytes())["flange_T_camera"])
    file = touches(tmp_path / "touches.json", x.transform(), off_mm, **more)
    return handeyed(
        "touch", file, "--calibration", tmp_path / "calibration.json", "--tip", tip, "--session",
        with_corners(tmp_path / "looks"), *map(str, options),
    )  # fmt: skip


def test_points_touched_where_the_camera_sees_them_are_accepted(tmp_path: Path, tip: Path, calibration: Path) -> None:
    ran = touch(tmp_path, tip, np.zeros(3), "--tolerance-mm", 1.0, "--json")
    assert (ran.status, ran.err) == (0, "")
    found = json.loads(ran.out)
    assert [point["name"] for point in found["points"]] == ["point 0", "point 5", "point 23", "hole"]
    assert found["largest_mm"] < 0.3
    assert (found["agree"], found["conformance"], found["accepted"]) == (True, "within", True)
    assert all(0 < point["expanded_mm"] < point["claimed_mm"] for point in found["points"])


def test_points_touched_elsewhere_are_not(tmp_path: Path, tip: Path, calibration: Path) -> None:
    ran = touch(tmp_path, tip, np.array([3.0, 0.0, 0.0]), "--tolerance-mm", 1.0)
    assert ran.status == 3
    assert "beyond the tolerance of 1 mm" in ran.out
    assert "(+3.0" in ran.out.splitlines()[-1]
    undecided = touch(tmp_path, tip, np.array([0.5, 0.0, 0.0]), "--tolerance-mm", 0.52, "--json")
    assert undecided.status == 3
    assert json.loads(undecided.out)["conformance"] == "undecided"


def test_a_measured_rest_counts_as_if_the_tip_had_been_there(tmp_path: Path, tip: Path, calibration: Path) -> None:
    ran = touch(tmp_path, tip, np.zeros(3), "--json", miss_mm=[0.0, 0.0, 2.0])
    assert json.loads(ran.out)["points"][3]["miss_mm"][2] == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize(("more", "says"), [
    ({"id": 999, "camera_mm": None, "seen_from": None}, "point 999 was not seen"),
    ({"seen_from": None}, "the pose in which the camera saw it is missing"),
    ({"id": 3}, "one of the two"),
])  # fmt: skip
def test_touches_that_cannot_be_used_are_refused(
    tmp_path: Path, tip: Path, calibration: Path, more: dict[str, Any], says: str
) -> None:
    ran = touch(tmp_path, tip, np.zeros(3), **more)
    assert ran.status == 2
    assert says in ran.err


def test_a_covariance_that_is_none_is_refused(tmp_path: Path, tip: Path, calibration: Path) -> None:
    document = json.loads(tip.read_bytes()) | {"covariance": [[1, 0, 0], [0, -1, 0], [0, 0, 1]]}
    tip.write_text(json.dumps(document))
    ran = touch(tmp_path, tip, np.zeros(3))
    assert ran.status == 2
    assert "no negative variance" in ran.err


def test_a_camera_beside_the_robot_needs_no_pose_of_the_look(tmp_path: Path, tip: Path, calibration: Path) -> None:
    document = json.loads(calibration.read_bytes())
    document |= {"setup": "eye-to-hand", "base_T_camera": document.pop("flange_T_camera"), "base_T_target": None}
    calibration.write_text(json.dumps(document))
    x = PoseDocument.model_validate(document["base_T_camera"]).transform()
    camera_mm = np.array([30.0, -40.0, 500.0])
    pose = PoseDocument.of(poses_at(map_points(x, camera_mm[None])[0], 0.0)[0]).model_dump(mode="json")
    listed = [{"camera_mm": camera_mm.tolist(), "base_T_flange": pose}]
    (tmp_path / "touches.json").write_text(json.dumps({"touches": listed}))
    ran = handeyed("touch", tmp_path / "touches.json", "--calibration", calibration, "--tip", tip, "--json")
    assert (ran.status, ran.err) == (0, "")
    assert json.loads(ran.out)["largest_mm"] < 0.3


def test_touches_are_judged_by_the_arm_as_built(tmp_path: Path, tip: Path, calibration: Path) -> None:
    """The zero of its axis 5 is off by 0.05 rad, which moves camera and tip in other directions in other postures."""
    arm = find_arm("IRB 1600-6/1.45")
    joints = np.radians([[0.0, 20, 10, 0, 40, 0], [0.0, 25, 5, 80, 45, 10]])
    model = ArmErrorModel(arm)
    stood = model.forward(0.05 * np.eye(len(model))[model.index("zero_5")], Postures(joints))
    x = PoseDocument.model_validate(json.loads(calibration.read_bytes())["flange_T_camera"])
    tip_mm = map_points(stood[1], TIP[None])[0]
    camera_mm = map_points(inverse(stood[0] @ x.transform()), tip_mm[None])[0]
    looked, touched = (PoseDocument.of(arm.forward(one)).model_dump(mode="json") for one in joints)
    touch_of_hole = {"camera_mm": camera_mm.tolist(), "seen_from": looked, "base_T_flange": touched}
    (tmp_path / "touches.json").write_text(json.dumps({"touches": [touch_of_hole]}))
    errors = an_arm(zero_5=0.05).model_copy(update={"mount_T_camera": x})
    (tmp_path / "arm.json").write_text(errors.model_dump_json())
    asked = ("touch", tmp_path / "touches.json", "--calibration", calibration, "--tip", tip, "--json")
    drawn, built = (json.loads(handeyed(*asked, *more).out) for more in ((), ("--arm", tmp_path / "arm.json")))
    assert built["largest_mm"] < 0.5 < 5.0 < drawn["largest_mm"]
    missing = handeyed(*asked, "--arm", tip)
    assert missing.status == 2

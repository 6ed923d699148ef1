"""`import handeyed`: arrays in, results out."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import handeyed
from calibration.errors import DocumentError
from calibration.problem import MeasuredPose
from calibration.transforms import Array, difference, inverse, map_points
from tests.calibration.documents.exports.readers import READERS
from tests.simulated.measured_sessions import measured_cell, tracker
from tests.simulated.spoiled_sessions import cell

SIMULATED = cell(21, 10)


def session() -> handeyed.Session:
    problem = SIMULATED.problem
    views = [view for view in problem.views if view.detection is not None]
    target = problem.target
    camera = problem.camera
    assert camera is not None
    return handeyed.Session.of_corners(
        [view.base_T_flange for view in views],
        [view.detection.corners_px for view in views if view.detection],
        {"kind": "chessboard", "columns": target.columns, "rows": target.rows, "pitch_mm": target.pitch_mm},
        ids=[view.detection.ids for view in views if view.detection],
        image_size=problem.image_size,
        camera_matrix=camera.matrix,
        distortion=camera.distortion,
    )


def test_from_arrays_to_points_in_the_base() -> None:
    result = handeyed.solve(session(), tolerance_mm=5.0)
    assert result.flange_T_camera is not None
    x = result.flange_T_camera.transform()
    assert result.uncertainty is not None
    pose, points = np.eye(4), np.array([[0.0, 0.0, 500.0], [10.0, -20.0, 600.0]])
    pose[:3, 3] = 100.0, 200.0, 300.0
    base = handeyed.register(points, result, pose)
    assert np.allclose(base, points @ x[:3, :3].T + x[:3, 3] + pose[:3, 3])
    assert difference(READERS["opencv"](handeyed.export(result, "opencv")), x)[0] < 1e-9


def test_what_does_not_go_together_is_refused() -> None:
    result = handeyed.solve(session())
    with pytest.raises(DocumentError, match="pose of the flange is missing"):
        handeyed.register([[0, 0, 1]], result)
    with pytest.raises(DocumentError, match="do not go together"):
        handeyed.Session.of_corners(np.eye(4), [[[0, 0]]], {"kind": "chessboard"}, image_size=(640, 480))
    with pytest.raises(DocumentError, match="'feet' is no unit"):
        handeyed.read_cloud("cloud.ply", unit="feet")


def pairs() -> tuple[Array, Array, Array]:
    """base_T_flange, camera_T_target (10, 4, 4) and X of a tracker's session."""
    drawn = measured_cell(np.random.default_rng(3), 10, tracker())
    measured = [view.measured for view in drawn.problem.views]
    seen = np.array([one.camera_T_target for one in measured if isinstance(one, MeasuredPose)])
    return np.array([view.base_T_flange for view in drawn.problem.views]), seen, drawn.mount_T_camera


def test_pairs_of_poses_need_no_folder(tmp_path: Path) -> None:
    robot, camera, x = pairs()
    stacks = {"R_gripper2base": robot[:, :3, :3], "t_gripper2base": robot[:, :3, 3], "T_target2cam": camera}
    np.savez(tmp_path / "pairs.npz", **stacks)
    given = [handeyed.Session.of_poses(robot, camera), stacks, tmp_path / "pairs.npz", str(tmp_path / "pairs.npz")]
    for one in (*given, np.load(tmp_path / "pairs.npz")):
        result = handeyed.solve(one, tolerance_mm=4.0)
        assert result.verdict.accepted and result.flange_T_camera is not None
        assert difference(result.flange_T_camera.transform(), x)[0] < 2.0


def test_the_camera_s_own_poses_are_no_measurement() -> None:
    _, camera, _ = pairs()
    result = handeyed.solve(handeyed.Session.of_poses(inverse(camera), camera))
    assert not result.verdict.accepted and result.flange_T_camera is None
    assert result.verdict.findings[-1].code == "circular-poses"


@pytest.mark.parametrize("setup", ["eye-to-hand", "eye-in-hand"])
def test_points_of_a_tip_are_a_calibration(setup: str) -> None:
    robot, _, x = pairs()
    rng = np.random.default_rng(5)
    seen = rng.uniform([-200, -200, 500], [200, 200, 900], (10, 3))
    in_mount = map_points(x, seen) + 0.2 * rng.standard_normal((10, 3))
    touched = in_mount if setup == "eye-to-hand" else map_points(robot, in_mount[:, None])[:, 0]
    poses = None if setup == "eye-to-hand" else robot
    result = handeyed.solve(
        handeyed.Session.of_points(touched, seen, setup=setup, base_T_flange=poses), tolerance_mm=4.0
    )  # type: ignore[arg-type]
    found = result.base_T_camera or result.flange_T_camera
    assert found is not None and result.uncertainty is not None and result.verdict.accepted
    probe = np.array([[0.0, 0.0, 700.0]])
    error_mm = np.linalg.norm(map_points(found.transform(), probe) - map_points(x, probe))
    assert error_mm < max(point.expanded_mm for point in result.uncertainty.points)


def test_a_wrong_argument_says_what_fits() -> None:
    with pytest.raises(TypeError, match="solve takes a Session, a folder, a file or a mapping of arrays, not int"):
        handeyed.solve(3)  # type: ignore[arg-type]
    with pytest.raises(DocumentError, match="only one side's poses"):
        handeyed.solve({"R_gripper2base": np.tile(np.eye(3), (5, 1, 1)), "t_gripper2base": np.zeros((5, 3))})
    with pytest.raises(DocumentError, match="do not go together"):
        handeyed.Session.of_poses(np.eye(4)[None], np.tile(np.eye(4), (2, 1, 1)))
    with pytest.raises(DocumentError, match="X needs four or more"):
        handeyed.solve(handeyed.Session.of_points(np.eye(3), np.eye(3)))
    poses = np.tile(np.eye(4), (3, 1, 1))
    with pytest.raises(DocumentError, match="'eye_in_hand' is no set-up: say 'eye-in-hand' or 'eye-to-hand'"):
        handeyed.Session.of_poses(poses, poses, setup="eye_in_hand")  # type: ignore[arg-type]
    assert "solve" in dir(handeyed) and "Session" in dir(handeyed)


@pytest.mark.parametrize("tolerance_mm", [0.0, -1.0, float("nan"), float("inf")])
def test_a_tolerance_that_is_none_is_refused_before_anything_is_solved(tolerance_mm: float) -> None:
    with pytest.raises(DocumentError, match=r"solve: tolerance_mm: .* is no tolerance: give U in mm"):
        handeyed.solve(session(), tolerance_mm=tolerance_mm)


@pytest.mark.parametrize(
    ("camera", "why"),
    [
        ({"camera_matrix": np.eye(3).ravel()}, "matrix"),
        ({"camera_matrix": np.full((3, 3), np.nan)}, r"matrix\[0\]\[0\]: nan is not finite"),
        ({"camera_matrix": np.eye(3), "distortion": np.zeros(3)}, "distortion"),
        ({"camera_matrix": np.eye(3), "distortion": [0, 0, 0, 0, np.inf]}, r"distortion\[4\]: inf is not finite"),
        ({"camera_matrix": np.eye(3), "image_size": (0, 1200)}, r"image_size\[0\]: 0 is below"),
        ({"camera_matrix": np.eye(3), "image_size": "1920x1200"}, "image_size"),
    ],
)
def test_a_camera_that_is_none_is_refused_before_anything_is_solved(camera: dict[str, Any], why: str) -> None:
    board = {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 20.0}
    sized = {"image_size": (1920, 1200), **camera}
    with pytest.raises(DocumentError, match=f"of_corners: {why}"):
        handeyed.Session.of_corners(np.eye(4)[None], [np.zeros((54, 2))], board, **sized)


@pytest.mark.parametrize(
    "ids",
    [[np.arange(53)], [np.arange(54)] * 2, [np.arange(1, 55)], [np.r_[-1, np.arange(53)]], [[*range(53), np.nan]]],
    ids=["too few", "of two pictures", "beyond the target", "below 0", "nan"],
)
def test_numbers_of_points_that_do_not_go_with_the_corners_are_refused(ids: Any) -> None:
    board = {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 20.0}
    with pytest.raises(DocumentError, match=r"of_corners: ids: .* 0 to 53"):
        handeyed.Session.of_corners(np.eye(4)[None], [np.zeros((54, 2))], board, image_size=(640, 480), ids=ids)


def test_numbers_of_points_may_have_the_shape_that_opencv_gives_them() -> None:
    board = {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 20.0}
    given = handeyed.Session.of_corners(
        np.eye(4)[None], [np.zeros((54, 1, 2))], board, image_size=(640, 480), ids=[np.arange(54)[:, None]]
    )
    (view,) = given.problem.views
    assert view.detection is not None
    assert view.detection.ids.shape == (54,)


def test_a_cloud_is_read_in_mm(tmp_path) -> None:  # type: ignore[no-untyped-def]
    file = tmp_path / "cloud.ply"
    head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    file.write_text(head + "0.1 0.2 0.3\nnan 0 0\n")
    assert np.allclose(handeyed.read_cloud(file, unit="m"), [[100, 200, 300]], atol=1e-4)

"""`import handeyed`: arrays in, results out."""

import numpy as np
import pytest

import handeyed
from calibration.errors import DocumentError
from calibration.transforms import difference
from tests.calibration.documents.exports.readers import READERS
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


def test_a_cloud_is_read_in_mm(tmp_path) -> None:  # type: ignore[no-untyped-def]
    file = tmp_path / "cloud.ply"
    head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    file.write_text(head + "0.1 0.2 0.3\nnan 0 0\n")
    assert np.allclose(handeyed.read_cloud(file, unit="m"), [[100, 200, 300]], atol=1e-4)

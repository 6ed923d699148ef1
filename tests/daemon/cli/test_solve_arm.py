"""`handeyed solve --arm`: arm.json from sessions with joints, and joints of another arm refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from calibration.documents.arm import ArmDocument
from calibration.documents.pose import PoseDocument
from calibration.documents.session import CameraDocument
from calibration.kinematics.abb_arms import find_arm
from calibration.problem import View
from mock_robot.arm.built_arm import build_arm
from tests.daemon.cli.running import handeyed
from tests.simulated.arms import arm_cell, reachable_views, target_before
from tests.simulated.sessions import CAMERA

ARM = find_arm("IRB 2600-20/1.65")


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve views of a standard arm, with corners in place of images."""
    rng, target = np.random.default_rng(0), target_before(ARM)
    cell = arm_cell(rng, build_arm(ARM, "standard", 0), [reachable_views(rng, ARM, target, 12)], [target])
    folder = tmp_path_factory.mktemp("arm") / "session"
    folder.mkdir()
    (folder / "session.json").write_text(
        json.dumps(
            {
                "schema_version": 1,
                "setup": "eye-in-hand",
                "target": {"kind": "chessboard", "columns": 11, "rows": 8, "pitch_mm": 15.0},
                "camera": CameraDocument.of(CAMERA).model_dump(mode="json"),
                "views": [view_document(view) for view in cell.problems[0].views],
            }
        )
    )
    return folder


def view_document(view: View) -> dict[str, object]:
    assert view.joints_rad is not None and view.detection is not None
    corners = np.column_stack([view.detection.ids, view.detection.corners_px])
    return {
        "base_T_flange": PoseDocument.of(view.base_T_flange).model_dump(mode="json"),
        "joints_deg": np.degrees(view.joints_rad).tolist(),
        "corners_px": [[int(name), u, v] for name, u, v in corners.tolist()],
    }


def test_the_arm_is_written_beside_the_calibration(session: Path, tmp_path: Path) -> None:
    solved = handeyed("solve", session, "--arm", "irb 2600-20/1.65", "--out", tmp_path / "calibration.json")
    assert solved.status in (0, 3), solved.err
    assert "errors of the arm are taken up" in solved.out
    written = ArmDocument.model_validate_json((tmp_path / "arm.json").read_text())
    assert written.arm == ARM.name and written.taken_up and written.views == 12
    assert np.linalg.norm(written.estimate().mount_T_camera[:3, 3] - [60.0, 10.0, 90.0]) < 2.0


def test_another_arms_name_is_refused_with_the_right_one(session: Path, tmp_path: Path) -> None:
    solved = handeyed("solve", session, "--arm", "IRB 6700-200/2.60", "--out", tmp_path / "calibration.json")
    assert solved.status == 2
    assert "the session is of an IRB 2600-" in solved.err
    assert not (tmp_path / "arm.json").exists()

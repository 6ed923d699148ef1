"""`handeyed plan` chooses poses; `handeyed assess` predicts what given ones will tell."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.plan import AssessedDocument, PlannedDocument
from calibration.documents.pose import PoseDocument
from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import BASE_T_TARGET, FLANGE_T_CAMERA, TILTS_RAD, pose_json, session


def question(folder: Path, **changes: Any) -> Path:
    """plan.json for the cell of the sessions."""
    known = session([])
    document = {
        "schema_version": 1,
        "target": known["target"],
        "camera": known["camera"],
        "flange_T_camera_guess": PoseDocument.of(FLANGE_T_CAMERA).model_dump(mode="json"),
        "base_T_target_guess": PoseDocument.of(BASE_T_TARGET).model_dump(mode="json"),
        "poses": 3,
    } | changes
    file = folder / "plan.json"
    file.write_text(json.dumps(document))
    return file


@pytest.mark.slow
def test_the_planned_poses_are_predicted_to_be_as_good_as_assess_finds_them(tmp_path: Path) -> None:
    ran = handeyed("plan", question(tmp_path), "--json")
    planned = PlannedDocument.model_validate_json(ran.out)
    poses = [pose.base_T_flange.model_dump(mode="json") for pose in planned.poses]

    assessed = AssessedDocument.model_validate_json(handeyed("assess", question(tmp_path, views=poses), "--json").out)

    assert ran.status == 0
    assert len(planned.poses) == 3
    assert planned.predicted.point_mm == pytest.approx(assessed.predicted.point_mm, rel=1e-6)


@pytest.mark.slow
def test_planned_poses_beat_ordinary_ones(tmp_path: Path) -> None:
    planned = PlannedDocument.model_validate_json(handeyed("plan", question(tmp_path, poses=6), "--json").out)
    ordinary = [pose_json(tilt) for tilt in TILTS_RAD]
    assessed = AssessedDocument.model_validate_json(
        handeyed("assess", question(tmp_path, views=ordinary), "--json").out
    )

    assert planned.predicted.point_mm is not None and assessed.predicted.point_mm is not None
    assert planned.predicted.point_mm < assessed.predicted.point_mm


def test_poses_that_do_not_determine_x_are_status_3(tmp_path: Path) -> None:
    ran = handeyed("assess", question(tmp_path, views=[pose_json(TILTS_RAD[0])] * 3))

    assert ran.status == 3
    assert "do not determine" in ran.out


@pytest.mark.slow
def test_in_words_there_is_a_line_a_pose(tmp_path: Path) -> None:
    ran = handeyed("plan", question(tmp_path))

    assert [line.split()[0] for line in ran.out.splitlines()] == ["pose", "1", "2", "3", "predicted"]


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "no arm of that name": (
        {"robot": "IRB 2600-1.65"},
        "robot: no arm is named 'IRB 2600-1.65'; near are IRB 2600-20/1.65, IRB 2600-12/1.65",
    ),
    "unknown key": ({"pose": 3}, "pose: unknown key: did you mean 'poses'?"),
    "too few": ({"poses": 2}, "poses: 2 is below 3: "),
}


@pytest.mark.parametrize(("changes", "line"), REFUSED.values(), ids=REFUSED)
def test_a_question_that_cannot_be_answered(tmp_path: Path, changes: dict[str, Any], line: str) -> None:
    file = question(tmp_path, **changes)

    ran = handeyed("plan", file)

    assert ran.status == 2
    assert ran.err.startswith(f"{file}: {line}"), ran.err


def test_limits_that_leave_no_room_fail_with_what_to_do(tmp_path: Path) -> None:
    ran = handeyed("plan", question(tmp_path, limits={"box_mm": [[0, 0, 0], [1, 1, 1]]}))

    assert ran.status == 1
    assert "within the limits" in ran.err


def test_assess_needs_poses(tmp_path: Path) -> None:
    ran = handeyed("assess", question(tmp_path))

    assert (ran.status, ran.errors) == (2, [f"{tmp_path / 'plan.json'}: views: missing: add the poses to assess"])


def test_guesses_that_say_nothing_are_refused(tmp_path: Path) -> None:
    still = PoseDocument.of(np.eye(4)).model_dump(mode="json")
    ordinary = [pose_json(tilt) for tilt in TILTS_RAD]
    ran = handeyed("assess", question(tmp_path, views=ordinary, flange_T_camera_guess=still, base_T_target_guess=still))

    assert ran.status == 2
    assert "both guesses are the identity" in ran.err

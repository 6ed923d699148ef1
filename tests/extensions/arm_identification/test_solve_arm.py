"""`handeyed solve --arm`: arm.json from sessions with joints, and joints of another arm refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from calibration.documents.arm import ArmErrorsDocument
from calibration.kinematics.abb_arms import find_arm
from daemon.cli.main import command_line
from mock_robot.arm.built_arm import build_arm
from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import on_a_track, with_corners
from tests.simulated.arms import arm_cell, reachable_views, session_document, target_before

ARM = find_arm("IRB 2600-20/1.65")


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve views of a standard arm, with corners in place of images."""
    rng, target = np.random.default_rng(0), target_before(ARM)
    cell = arm_cell(rng, build_arm(ARM, "standard", 0), [reachable_views(rng, ARM, target, 12)], [target])
    folder = tmp_path_factory.mktemp("arm") / "session"
    folder.mkdir()
    (folder / "session.json").write_text(json.dumps(session_document(cell.problems[0])))
    return folder


@pytest.mark.slow
def test_the_arm_is_written_beside_the_calibration(session: Path, tmp_path: Path) -> None:
    solved = handeyed("solve", session, "--arm", "irb 2600-20/1.65", "--out", tmp_path / "calibration.json")
    assert solved.status in (0, 3), solved.err
    assert "errors of the arm are taken up" in solved.out
    assert "30 pictures more would bring a registered point from" in solved.out
    written = ArmErrorsDocument.model_validate_json((tmp_path / "arm.json").read_text())
    assert written.more_views is not None and len(written.more_views.further) == 30
    assert written.arm == ARM.name and written.taken_up and written.views == 12
    assert np.linalg.norm(written.estimate().mount_T_camera[:3, 3] - [60.0, 10.0, 90.0]) < 2.0


def test_more_views_are_predicted_in_the_box_of_at(session: Path, tmp_path: Path) -> None:
    box_mm = [[900.0, -200.0, -100.0], [1200.0, 200.0, 100.0]]
    (tmp_path / "points.json").write_text(json.dumps({"schema_version": 1, "box_mm": box_mm}))
    at = ("--at", tmp_path / "points.json")
    solved = handeyed("solve", session, "--arm", ARM.name, *at, "--out", tmp_path / "calibration.json")
    assert solved.status in (0, 3), solved.err
    more = ArmErrorsDocument.model_validate_json((tmp_path / "arm.json").read_text()).more_views
    assert more is not None and [list(corner) for corner in more.box_mm] == box_mm
    assert [one.more for one in more.after] == [10, 20, 30]


@pytest.mark.slow
def test_confdata_stands_for_joints_that_were_not_recorded(session: Path, tmp_path: Path) -> None:
    """The session's postures are drawn at random, so that the least travel finds others."""
    document = json.loads((session / "session.json").read_text())
    for view in document["views"]:
        view["confdata"] = list(ARM.configuration(np.radians(view.pop("joints_deg"))))
    (tmp_path / "session.json").write_text(json.dumps(document))
    found = []
    for folder, out in ((session, tmp_path / "joints"), (tmp_path, tmp_path / "confdata")):
        solved = handeyed("solve", folder, "--arm", ARM.name, "--out", out / "calibration.json")
        assert solved.status in (0, 3), solved.err
        found.append(ArmErrorsDocument.model_validate_json((out / "arm.json").read_text()))
    assert [one.joints_from_poses for one in found] == [0, 12]
    values = [[parameter.value for parameter in one.parameters] for one in found]
    np.testing.assert_allclose(values[0], values[1], atol=1e-6)
    for view in document["views"]:
        del view["confdata"]
    (tmp_path / "session.json").write_text(json.dumps(document))
    refused = handeyed("solve", tmp_path, "--arm", ARM.name, "--out", tmp_path / "bare" / "calibration.json")
    assert refused.status == 2
    assert "hold no joints of six axes" in refused.err and "record joints_deg, or confdata" in refused.err


def test_joints_do_not_follow_from_poses_of_a_tool(session: Path, tmp_path: Path) -> None:
    document = json.loads((session / "session.json").read_text())
    for view in document["views"]:
        view["confdata"] = list(ARM.configuration(np.radians(view.pop("joints_deg"))))
    document["poses_of"] = {"tool": "tGrip", "base": ""}
    (tmp_path / "session.json").write_text(json.dumps(document))
    refused = handeyed("solve", tmp_path, "--arm", ARM.name)
    assert refused.status == 2
    assert "no joints, and their poses are of tGrip in the base: record joints_deg, or give the fla" in refused.err


def test_another_arms_name_is_refused_with_the_right_one(session: Path, tmp_path: Path) -> None:
    solved = handeyed("solve", session, "--arm", "IRB 6700-200/2.60", "--out", tmp_path / "calibration.json")
    assert solved.status == 2
    assert "the session is of an IRB 2600-" in solved.err
    assert not (tmp_path / "arm.json").exists()


def test_a_distance_to_a_folder_that_is_not_named_is_refused(session: Path, tmp_path: Path) -> None:
    document = json.loads((session / "session.json").read_text())
    document["distances"] = [{"to": "left", "distance_mm": 1000.0, "sigma_mm": 0.02}]
    (tmp_path / "session.json").write_text(json.dumps(document))
    solved = handeyed("solve", tmp_path, "--arm", ARM.name)
    assert solved.status == 2
    assert "'left' is not the name of one other folder of the command" in solved.err


def test_the_errors_of_an_arm_are_not_found_while_an_axis_moves(tmp_path: Path) -> None:
    ran = handeyed("solve", with_corners(tmp_path / "a", on_a_track()), "--arm", "IRB 1600-6/1.45")
    assert ran.status == 2
    assert "not found while an external axis moves" in ran.err


def test_where_it_is_not_installed_nothing_is_solved(session: Path) -> None:
    refused = handeyed("solve", session, "--arm", ARM.name, command_line=command_line({}))
    assert (refused.status, refused.out) == (2, "")
    assert refused.err == "--arm: no extension is installed that solves it: leave it out\n"

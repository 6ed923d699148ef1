"""`handeyed compare A B`."""

import json
from pathlib import Path

import pytest

from calibration.monitoring.comparison import FALSE_ALARM_PROBABILITY, ComparisonDocument
from daemon.cli.compare import DEFAULT_FALSE_ALARM
from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import with_corners

VERSION_1 = Path(__file__).parents[2] / "calibration" / "documents" / "calibration_version_1.json"


@pytest.mark.slow
def test_two_results_of_one_session_agree_and_another_camera_contradicts(tmp_path: Path) -> None:
    for name in ("a", "b"):
        handeyed("solve", with_corners(tmp_path / name), "--out", tmp_path / f"{name}.json")
    agreeing = handeyed("compare", tmp_path / "a.json", tmp_path / "b.json", "--json")
    assert (agreeing.status, agreeing.err) == (0, "")
    assert ComparisonDocument.model_validate_json(agreeing.out).agree

    moved = json.loads((tmp_path / "b.json").read_bytes())
    moved["flange_T_camera"]["translation_mm"][0] += 5.0
    (tmp_path / "moved.json").write_text(json.dumps(moved))
    ran = handeyed("compare", tmp_path / "a.json", tmp_path / "moved.json")
    assert ran.status == 3
    assert "they contradict each other" in ran.out


def test_version_1_is_compared_without_knowing_whether_it_agrees() -> None:
    ran = handeyed("compare", VERSION_1, VERSION_1)
    assert ran.status == 3
    assert "is not known" in ran.out


def test_an_unreadable_one_is_refused(tmp_path: Path) -> None:
    assert handeyed("compare", VERSION_1, tmp_path / "nowhere.json").status == 2
    session = with_corners(tmp_path / "session") / "session.json"
    ran = handeyed("compare", VERSION_1, session)
    assert (ran.status, len(ran.errors)) == (2, 1)
    assert f"this is a session, not its calibration: solve it: handeyed solve {session.parent}" in ran.err
    assert DEFAULT_FALSE_ALARM == FALSE_ALARM_PROBABILITY

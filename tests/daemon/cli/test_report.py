"""`handeyed report FOLDER|FILE`."""

from pathlib import Path
from typing import get_args

from calibration.sentences.sentence import LANGUAGES
from daemon.cli.report import ReportLanguage
from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import with_corners

VERSION_1 = Path(__file__).parents[2] / "calibration" / "documents" / "calibration_version_1.json"
EXAMPLE = Path(__file__).parents[3] / "deploy" / "handeyed.example.toml"


def test_a_session_folder_is_solved_and_reported(tmp_path: Path) -> None:
    ran = handeyed("report", with_corners(tmp_path / "session"), "--out", tmp_path / "r.html", "--settings", EXAMPLE)
    assert (ran.status, ran.out.strip()) == (0, str(tmp_path / "r.html"))
    html = (tmp_path / "r.html").read_text()
    assert "Accepted." in html
    assert "Uncertainty budget" in html


def test_a_calibration_file_is_reported(tmp_path: Path) -> None:
    assert handeyed("report", VERSION_1, "--out", tmp_path / "r.html").status == 0
    assert "Calibration report" in (tmp_path / "r.html").read_text()
    assert handeyed("report", VERSION_1, "--language", "de", "--out", tmp_path / "r.html").status == 0
    assert "Kalibrierbericht" in (tmp_path / "r.html").read_text()


def test_what_cannot_be_reported_is_refused(tmp_path: Path) -> None:
    assert handeyed("report", tmp_path / "nowhere.json", "--out", tmp_path / "r.html").status == 2
    assert handeyed("report", tmp_path, "--out", tmp_path / "r.html").status == 2
    assert handeyed("report", VERSION_1, "--out", tmp_path / "none" / "r.html").status == 1
    assert handeyed("report", "some-id", "--url", "http://127.0.0.1:1", "--out", tmp_path / "r.html").status == 1


def test_the_command_knows_every_language_of_reports() -> None:
    assert get_args(ReportLanguage) == LANGUAGES

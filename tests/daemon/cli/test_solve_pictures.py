"""`handeyed solve --views` and `--pictures`: which view is how bad, and what was seen in it."""

import json
import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.daemon.cli.running import Ran, handeyed
from tests.daemon.cli.sessions import with_corners, with_images

MISTYPED, COVERED = 2, 4


def with_a_mistyped_pose(document: dict[str, Any]) -> None:
    document["views"][MISTYPED]["base_T_flange"]["translation_mm"][0] += 60.0


def spoilt_session(folder: Path) -> Path:
    """Six pictures, of which one shows no target and one has a wrong pose."""
    session = with_images(folder, with_a_mistyped_pose)
    cv2.imwrite(str(session / f"view_{COVERED:03}.png"), np.random.default_rng(1).integers(0, 255, (480, 640)))
    return session


def views_of(out: str) -> list[tuple[int, str]]:
    """(number of the picture, status) of every line of the table."""
    lines = out[out.index("\npicture  image") :].splitlines()[2:]
    return [(int(line.split()[0]), line.split()[2]) for line in lines if re.match(r" *\d+ ", line)]


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> tuple[Ran, Path]:
    """What `handeyed solve --views --pictures` printed of the spoilt session, and the folder of its pictures."""
    folder = tmp_path_factory.mktemp("solved")
    return handeyed("solve", spoilt_session(folder / "a"), "--views", "--pictures", folder / "out"), folder / "out"


def test_views_are_listed_worst_first(solved: tuple[Ran, Path]) -> None:
    ran, _ = solved

    views = views_of(ran.out)
    assert views[:2] == [(COVERED + 1, "rejected"), (MISTYPED + 1, "rejected")]
    assert sorted(view for view, _ in views) == [1, 2, 3, 4, 5, 6]
    assert "not-found" in ran.out and "pose-disagrees" in ran.out


def test_without_the_option_and_in_json_there_is_no_table(tmp_path: Path) -> None:
    session = with_corners(tmp_path / "a")

    assert "robot deg" not in handeyed("solve", session).out
    assert json.loads(handeyed("solve", session, "--views", "--json").out)["views"]


def test_every_picture_is_written_with_what_was_seen_in_it(solved: tuple[Ran, Path]) -> None:
    ran, out = solved

    assert str(out / "residuals.html") in ran.err
    page = (out / "residuals.html").read_text()
    assert sorted(re.findall(r'<img src="([^"]+)"', page)) == sorted(file.name for file in out.glob("*.jpg"))
    assert "no ChArUco board of 7×5 squares" in page
    assert "the robot&#39;s pose contradicts the image" in page
    good = cv2.imread(str(out / "000_view_000.jpg"))
    covered = cv2.imread(str(out / f"{COVERED:03}_view_{COVERED:03}.jpg"))
    assert good is not None and covered is not None
    assert good.shape[1] >= 1280
    assert _green(good) > 1000
    assert _green(covered) == 0


def _green(picture: np.ndarray) -> int:  # type: ignore[type-arg]
    blue, green, red = (picture[..., channel].astype(int) for channel in range(3))
    return int(np.count_nonzero((green - blue > 40) & (green - red > 40)))


def test_the_page_needs_nothing_from_elsewhere(tmp_path: Path) -> None:
    handeyed("solve", with_images(tmp_path / "a"), "--pictures", tmp_path / "out")

    page = (tmp_path / "out" / "residuals.html").read_text()
    assert not re.search(r"https?://|<script|@import|url\(", page)
    assert page.count("<svg") == 4  # over the image, the distance, the view, and the robot's over the view
    assert page.count('class="used" x=') == 2 * 6


def test_a_session_of_corners_is_drawn_without_images(tmp_path: Path) -> None:
    handeyed("solve", with_corners(tmp_path / "a"), "--pictures", tmp_path / "out")

    assert len(list((tmp_path / "out").glob("*_points.jpg"))) == 6


def test_a_session_without_a_solution_still_shows_what_was_found(tmp_path: Path) -> None:
    def stand_still(document: dict[str, Any]) -> None:
        for view in document["views"]:
            view["base_T_flange"] = document["views"][0]["base_T_flange"]

    ran = handeyed("solve", with_images(tmp_path / "a", stand_still), "--pictures", tmp_path / "out")

    assert ran.status == 3
    assert "No X was found" in (tmp_path / "out" / "residuals.html").read_text()
    picture = cv2.imread(str(tmp_path / "out" / "000_view_000.jpg"))
    assert picture is not None and _green(picture) > 1000


def test_several_sessions_get_a_folder_each(tmp_path: Path) -> None:
    one, other = with_corners(tmp_path / "a"), with_corners(tmp_path / "b")

    handeyed("solve", one, other, "--pictures", tmp_path / "out")

    assert (tmp_path / "out" / "a" / "residuals.html").is_file() and (
        tmp_path / "out" / "b" / "residuals.html"
    ).is_file()


@pytest.mark.parametrize("blocked", ["file", "file/deeper"])
def test_a_folder_that_cannot_be_made_is_reported(tmp_path: Path, blocked: str) -> None:
    (tmp_path / "file").write_text("")

    ran = handeyed("solve", with_corners(tmp_path / "a"), "--pictures", tmp_path / blocked)

    assert ran.status == 1
    assert "cannot be written" in ran.err

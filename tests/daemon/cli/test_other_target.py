"""Pictures that show another target than session.json describes: `solve` names the settings to change."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import with_images


def exchanged(document: dict[str, Any]) -> None:
    document["target"].update(columns=5, rows=7)


def other_dictionary(document: dict[str, Any]) -> None:
    document["target"].update(dictionary="DICT_6X6_250")


@pytest.mark.parametrize(
    ("change", "settings"),
    [(exchanged, "set columns = 7, rows = 5"), (other_dictionary, 'set dictionary = "DICT_5X5_250"')],
)
def test_the_settings_to_change_are_named(tmp_path: Path, change: Any, settings: str) -> None:
    ran = handeyed("solve", with_images(tmp_path / "a", change), "--json")

    assert ran.status == 3
    assert ran.errors[0].startswith(f"{tmp_path / 'a' / 'session.json'}: views[0-5]: no ChArUco board")
    assert settings in ran.errors[0]
    findings = json.loads(ran.out)["verdict"]["findings"]
    assert any("found in 0 of 6 pictures" in finding["message"] and settings in finding["fix"] for finding in findings)


def test_a_covered_target_is_no_other_target(tmp_path: Path) -> None:
    session = with_images(tmp_path / "a")
    for file in sorted(session.glob("*.png"))[:2]:
        cv2.imwrite(str(file), np.random.default_rng(1).integers(0, 255, (480, 640)))

    ran = handeyed("solve", session)

    assert "views[0-1]: no ChArUco board" in ran.err
    assert "differs" not in ran.err


@pytest.mark.slow
@pytest.mark.data
@pytest.mark.parametrize(
    ("slip", "settings"), [("swapped", "set columns = 5, rows = 7"), ("wrongdict", 'set dictionary = "DICT_6X6')]
)
def test_real_pictures_show_what_they_hold(tmp_path: Path, real_data: Path, slip: str, settings: str) -> None:
    for picture in (real_data / "ic_charuco").glob("*.png"):
        (tmp_path / picture.name).symlink_to(picture)
    (tmp_path / "session.json").write_bytes((real_data / "odd_sessions" / f"{slip}.json").read_bytes())

    assert settings in handeyed("solve", tmp_path).err

"""`handeyed solve` with lenses of more coefficients than five, in session.json and by --camera."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import CAMERA, with_corners

INTRINSICS = {"matrix": CAMERA.matrix.tolist(), "distortion": [0.0] * 4, "image_size": [640, 480]}


@pytest.mark.parametrize("count", [4, 5, 8, 12, 14])
def test_every_count_of_opencv_is_read(tmp_path: Path, count: int) -> None:
    def change(document: dict[str, Any]) -> None:
        document["camera"]["distortion"] = [0.0] * count

    ran = handeyed("solve", with_corners(tmp_path / "a", change), "--json")

    assert ran.status == 0
    camera = json.loads(ran.out)["camera"]
    assert len(camera["distortion"]) == max(count, 5)
    assert (camera["lens"], camera["source"]) == ("pinhole", "given")


@pytest.mark.parametrize(("lens", "count"), [("pinhole", 6), ("pinhole", 3), ("fisheye", 5)])
def test_other_counts_are_refused_with_those_that_exist(tmp_path: Path, lens: str, count: int) -> None:
    def change(document: dict[str, Any]) -> None:
        document["camera"].update(distortion=[0.0] * count, lens=lens)

    ran = handeyed("solve", with_corners(tmp_path / "a", change))

    assert ran.status == 2
    assert "camera" in ran.err and str(count) in ran.err


def test_a_wrong_lens_is_named_and_widens_u_and_the_right_one_is_not(tmp_path: Path) -> None:
    session = with_corners(tmp_path / "a")
    (tmp_path / "wrong.json").write_text(json.dumps({**INTRINSICS, "lens": "fisheye"}))
    (tmp_path / "right.json").write_text(json.dumps({"camera": {**INTRINSICS, "source": "given"}}))

    wrong = json.loads(handeyed("solve", session, "--camera", tmp_path / "wrong.json", "--json").out)
    right = json.loads(handeyed("solve", session, "--camera", tmp_path / "right.json", "--json").out)

    assert wrong["camera"]["lens"] == "fisheye"
    assert right["verdict"]["accepted"]
    assert "intrinsics-do-not-fit" in codes(wrong) - codes(right)
    assert worst_mm(wrong) > 1.3 * worst_mm(right)  # the estimate takes up most of another radial distortion
    off_mm = np.subtract(wrong["flange_T_camera"]["translation_mm"], right["flange_T_camera"]["translation_mm"])
    assert np.linalg.norm(off_mm) < 1.5 * worst_mm(wrong), "U covers what the wrong lens does to X"


def codes(document: dict[str, Any]) -> set[str]:
    return {finding["code"] for finding in document["verdict"]["findings"]}


def worst_mm(document: dict[str, Any]) -> float:
    """U (k = 2) of the worst of the points that matter."""
    return max(point["expanded_mm"] for point in document["uncertainty"]["points"])


@pytest.mark.parametrize("content", ["no JSON", "[]", '{"matrix": 3}'])
def test_a_file_without_a_camera_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "camera.json").write_text(content)

    ran = handeyed("solve", with_corners(tmp_path / "a"), "--camera", tmp_path / "camera.json")

    assert ran.status == 2
    assert str(tmp_path / "camera.json") in ran.err


def test_json_of_ros_is_read_as_its_yaml_is(tmp_path: Path) -> None:
    message = {"width": 640, "height": 480, "k": CAMERA.matrix.ravel().tolist(), "d": [0.0] * 5}
    (tmp_path / "camera_info.json").write_text(json.dumps(message))

    ran = handeyed("solve", with_corners(tmp_path / "a"), "--camera", tmp_path / "camera_info.json", "--json")

    assert json.loads(ran.out)["camera"]["source"] == "given"

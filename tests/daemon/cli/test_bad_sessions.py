"""Every way a session folder can be spoilt: one line that says file, place, what and what to do; status 2."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import with_corners, with_images

SESSION = "session.json"


def _set(*path: str | int, to: Any) -> Callable[[dict[str, Any]], None]:
    def change(document: dict[str, Any]) -> None:
        place: Any = document
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = to

    return change


def _rename(old: str, new: str) -> Callable[[dict[str, Any]], None]:
    return lambda document: document.update({new: document.pop(old)})


SPOILT_DOCUMENTS = {
    "unknown key": (_rename("setup", "setpu"), "setpu: unknown key: did you mean 'setup'?"),
    "NaN": (
        _set("views", 2, "base_T_flange", "translation_mm", 1, to=float("nan")),
        "views[2].base_T_flange.translation_mm[1]: nan is not finite: give a number",
    ),
    "quaternion of norm 0.9": (
        _set("views", 1, "base_T_flange", "quaternion_wxyz", to=[0.9, 0, 0, 0]),
        "norm 0.9 is not 1: a quaternion is w, x, y, z with w first and norm 1",
    ),
    "no views": (_set("views", to=[]), "views: there are none: a calibration needs three views or more"),
    "unknown version": (_set("schema_version", to=2), "schema_version: 2 is not possible: give 1"),
    "unknown target": (
        _set("target", "kind", to="checker"),
        "target: 'checker' is not possible: give one of 'chessboard', 'charuco'",
    ),
    "point outside the target": (
        _set("views", 0, "corners_px", 3, 0, to=24),
        "views[0].corners_px[3]: the target has no point 24: ids run from 0 to 23, row by row",
    ),
    "point twice": (
        _set("views", 0, "corners_px", 3, 0, to=2),
        "views[0].corners_px[3]: point 2 appears twice: keep one of them",
    ),
    "image and corners": (_set("views", 0, "image", to="a.png"), "a view has one of 'image', 'corners_px'"),
    "image elsewhere": (
        lambda document: document["views"].append(
            {"image": "../secret.png", "base_T_flange": document["views"][0]["base_T_flange"]}
        ),
        "views[6].image: '../secret.png' is outside the session's folder: copy it there",
    ),
    "sizes that disagree": (
        _set("image_size", to=[800, 600]),
        "image_size: 800 x 600, but camera.image_size is 640 x 480: make them agree, or remove one",
    ),
    "no size at all": (
        _set("camera", to=None),
        "image_size: missing, and no image shows it: add it, or add the camera",
    ),
}


@pytest.mark.parametrize(("change", "line"), SPOILT_DOCUMENTS.values(), ids=SPOILT_DOCUMENTS)
def test_a_spoilt_document(tmp_path: Path, change: Callable[[dict[str, Any]], None], line: str) -> None:
    folder = with_corners(tmp_path / "cell", change)

    ran = handeyed("solve", folder, "--json")

    assert (ran.status, ran.out) == (2, "")
    assert ran.errors[0].startswith(f"{folder / SESSION}: ")
    assert any(line in error for error in ran.errors), ran.err


def _torn(folder: Path) -> None:
    file = folder / SESSION
    file.write_bytes(file.read_bytes()[:-40])


def _smaller(folder: Path) -> None:
    cv2.imwrite(str(folder / "view_003.png"), np.zeros((240, 320), np.uint8))


def _all_smaller(folder: Path) -> None:
    for file in folder.glob("view_*.png"):
        cv2.imwrite(str(file), np.zeros((240, 320), np.uint8))


def _cut(folder: Path) -> None:
    file = folder / "view_003.png"
    file.write_bytes(file.read_bytes()[:-200])


def _damaged(folder: Path) -> None:
    content = bytearray((folder / "view_003.png").read_bytes())
    content[len(content) // 2] ^= 0xFF
    (folder / "view_003.png").write_bytes(content)


AGAIN = "take the picture again, or remove the view from session.json"

SPOILT_FILES = {
    "session missing": (
        lambda folder: (folder / SESSION).unlink(),
        "file: the folder holds pictures, and no session.json: make one of them and a file of poses: handeyed import",
    ),
    "session torn": (_torn, "line 1, column"),
    "session not text": (
        lambda folder: (folder / SESSION).write_bytes(b"\xff{}"),
        "byte 0: not UTF-8 text: restore the file, or write it again",
    ),
    "session empty": (lambda folder: (folder / SESSION).write_bytes(b""), "line 1, column 1: not JSON"),
    "image missing": (
        lambda folder: (folder / "view_003.png").unlink(),
        "views[3].image: 'view_003.png' is not there: restore the file, or remove the view",
    ),
    "image of 0 bytes": (
        lambda folder: (folder / "view_003.png").write_bytes(b""),
        f"views[3].image: 'view_003.png' is empty (0 bytes): {AGAIN}",
    ),
    "image of another size": (
        _smaller,
        f"views[3].image: 'view_003.png' is 320 x 240 pixels where the session has 640 x 480: {AGAIN}",
    ),
    "images of another size than the camera": (
        _all_smaller,
        "camera.image_size: 640 x 480, but the pictures are 320 x 240: give intrinsics found at the pictures' size",
    ),
    "image cut off": (_cut, f"views[3].image: 'view_003.png' is cut off or damaged: {AGAIN}"),
    "image damaged": (_damaged, f"views[3].image: 'view_003.png' is cut off or damaged: {AGAIN}"),
    "image that is none": (
        lambda folder: (folder / "view_003.png").write_bytes(b"hello"),
        f"views[3].image: 'view_003.png' is not a picture: {AGAIN}",
    ),
}


@pytest.mark.parametrize(("spoil", "line"), SPOILT_FILES.values(), ids=SPOILT_FILES)
def test_a_spoilt_file(
    tmp_path: Path, spoil: Callable[[Path], None], line: str, capfd: pytest.CaptureFixture[str]
) -> None:
    folder = with_images(tmp_path / "cell")
    spoil(folder)

    ran = handeyed("solve", folder, "--json")

    assert (ran.status, ran.out) == (2, "")
    assert [error for error in ran.errors if error.startswith(f"{folder / SESSION}: {line}")], ran.err
    assert capfd.readouterr().err == ""  # no library writes past us


def test_without_a_camera_the_size_of_most_pictures_counts_and_not_that_of_the_first(tmp_path: Path) -> None:
    folder = with_images(tmp_path / "cell", lambda document: document.update(camera=None))
    cv2.imwrite(str(folder / "view_000.png"), np.zeros((240, 320), np.uint8))

    (error,) = handeyed("solve", folder).errors

    assert f"views[0].image: 'view_000.png' is 320 x 240 pixels where the session has 640 x 480: {AGAIN}" in error


def test_every_bad_image_is_reported_at_once(tmp_path: Path) -> None:
    folder = with_images(tmp_path / "cell")
    for index in (1, 4):
        (folder / f"view_{index:03}.png").write_bytes(b"")

    assert len(handeyed("solve", folder).errors) == 2


def test_a_view_without_the_target_is_reported_and_the_rest_is_solved(tmp_path: Path) -> None:
    folder = with_images(tmp_path / "cell")
    cv2.imwrite(str(folder / "view_002.png"), np.full((480, 640), 128, np.uint8))

    ran = handeyed("solve", folder, "--json")

    assert ran.status == 0
    assert ran.err.startswith(f"{folder / SESSION}: views[2]: ")
    assert json.loads(ran.out)["views"][2]["status"] == "rejected"


def test_no_view_with_the_target_is_a_refusal_with_the_reason(tmp_path: Path) -> None:
    folder = with_images(tmp_path / "cell")
    for index in range(6):
        cv2.imwrite(str(folder / f"view_{index:03}.png"), np.full((480, 640), 128, np.uint8))

    ran = handeyed("solve", folder, "--json")

    document = json.loads(ran.out)
    assert ran.status == 3
    assert document["flange_T_camera"] is None
    assert document["verdict"]["findings"]


def test_two_views_at_the_same_pose_are_reported(tmp_path: Path) -> None:
    def same(document: dict[str, Any]) -> None:
        document["views"][4]["base_T_flange"] = document["views"][3]["base_T_flange"]

    folder = with_corners(tmp_path / "cell", same)
    ran = handeyed("solve", folder, "--json")

    assert ran.status in (0, 3)
    assert ran.errors[0].startswith(f"{folder / SESSION}: views[4].base_T_flange: the same as that of views[3]: ")

"""Why a target was not detected is a sentence with id and parameters, everywhere."""

import ast
from pathlib import Path

import numpy as np
import pytest

from calibration.detection.detect import detect
from calibration.errors import DetectionError
from calibration.observations.observations import observe
from calibration.problem import Detection, Problem, View
from calibration.sentences.sentence import AS_WRITTEN, Sentence, as_sentence, text_of, with_fix
from calibration.targets import (
    AprilTagGrid,
    ArucoGrid,
    ArucoMarker,
    Charuco,
    Chessboard,
    CircleGrid,
    Target,
    require_markers,
)

ROOM = Path(__file__).parents[3] / "calibration"
TARGETS: tuple[Target, ...] = (
    Chessboard(9, 6, 20.0),
    Charuco(9, 7, 20.0, 15.0, "DICT_5X5_100"),
    CircleGrid("symmetric", 9, 7, 20.0),
    AprilTagGrid(4, 3, 30.0, 9.0),
    ArucoGrid(4, 3, 30.0, 9.0, "DICT_5X5_100"),
    ArucoMarker(100.0, "DICT_5X5_100", 7),
)
NOISE = np.random.default_rng(1).integers(60, 200, (120, 160)).astype(np.uint8)


def test_no_detection_error_is_written_as_text() -> None:
    written = []
    for file in sorted(ROOM.rglob("*.py")):
        for call in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            named = isinstance(call, ast.Call) and getattr(call.func, "id", "") in ("DetectionError", "UnusableReason")
            if named and any(isinstance(value, ast.JoinedStr | ast.Constant) for value in call.args[1:]):  # type: ignore[attr-defined]
                written.append(f"{file.relative_to(ROOM)}:{call.lineno}")  # type: ignore[attr-defined]
    assert written == []


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: type(target).__name__)
def test_a_target_that_is_not_there_is_missed_in_a_sentence(target: Target) -> None:
    with pytest.raises(DetectionError) as missed:
        detect(NOISE, target)
    said = with_fix(missed.value.what, missed.value.fix)
    pair = said.pair()
    assert str(said) == str(missed.value) == text_of(pair["id"], pair["params"])
    assert AS_WRITTEN not in (pair["params"]["what"]["id"], pair["params"]["fix"]["id"])


@pytest.mark.parametrize(
    ("image", "code"),
    [
        (np.zeros((99, 99), np.uint16), "image-type"),
        (np.zeros((9, 9, 2), np.uint8), "image-shape"),
        (np.zeros((9, 9), np.uint8), "image-too-small"),
        (np.zeros((99, 99), np.uint8), "image-black"),
        (np.full((99, 99), 255, np.uint8), "image-saturated"),
        (np.full((99, 99), 99, np.uint8), "image-flat"),
    ],
)
def test_an_unusable_image_is_refused_in_a_sentence(image: np.ndarray, code: str) -> None:
    with pytest.raises(DetectionError) as refused:
        detect(image, TARGETS[0])
    assert refused.value.code == code
    assert {as_sentence(refused.value.what).id, as_sentence(refused.value.fix).id}.isdisjoint({AS_WRITTEN})


@pytest.mark.parametrize(
    ("target", "text"),
    [
        (AprilTagGrid(4, 3, 30.0, 9.0, family="tag99h9"), "the tag family 'tag99h9' is not known: use one of tag"),
        (ArucoGrid(4, 3, 30.0, 9.0, "DICT_9X9"), "the dictionary 'DICT_9X9' is not known: use one of OpenCV's"),
        (Charuco(20, 20, 20.0, 15.0, "DICT_5X5_50"), "DICT_5X5_50 has 50 markers, a target of this size needs 200"),
    ],
)
def test_a_target_that_cannot_be_printed_is_refused_in_a_sentence(target: Target, text: str) -> None:
    with pytest.raises(DetectionError) as refused:
        require_markers(target)
    assert str(refused.value).startswith(text) and isinstance(refused.value.what, Sentence)


@pytest.mark.parametrize(
    ("ids", "pixels", "text"),
    [
        ([0, 1, 2, 99], [[10, 10], [20, 10], [10, 20], [20, 20]], "a corner id is outside 0..53"),
        ([0, 1, 1, 9], [[10, 10], [20, 10], [10, 20], [20, 20]], "the same corner id stands twice"),
        ([0, 1], [[10, 10], [20, 10]], "2 usable corners; a view needs 4 or more"),
    ],
)
def test_corners_that_cannot_be_used_are_refused_in_a_sentence(
    ids: list[int], pixels: list[list[float]], text: str
) -> None:
    view = View(0, np.eye(4), Detection(np.array(ids), np.array(pixels, float)))
    _, refused = observe(Problem("eye-in-hand", TARGETS[0], None, (160, 120), (view,)))
    assert isinstance(refused[0].what, Sentence) and refused[0].what == text

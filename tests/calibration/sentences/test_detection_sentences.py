"""Reasons and causes are sentences with id and parameters, everywhere; so are those why a target was not detected."""

import ast
from pathlib import Path

import numpy as np
import pytest

from calibration.detection.detect import detect
from calibration.errors import DetectionError
from calibration.kinematics.stance import Stance
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

ROOT = Path(__file__).parents[3]
TEXT_FROM = {
    "DetectionError": 1,
    "UnusableReason": 1,
    "UndeterminedError": 1,
    "Hypothesis": 4,
    "Reading": 1,
    "Finding": 2,
}
"""What takes a sentence or two, and the position of the first."""

TARGETS: tuple[Target, ...] = (
    Chessboard(9, 6, 20.0),
    Charuco(9, 7, 20.0, 15.0, "DICT_5X5_100"),
    CircleGrid("symmetric", 9, 7, 20.0),
    AprilTagGrid(4, 3, 30.0, 9.0),
    ArucoGrid(4, 3, 30.0, 9.0, "DICT_5X5_100"),
    ArucoMarker(100.0, "DICT_5X5_100", 7),
)
NOISE = np.random.default_rng(1).integers(60, 200, (120, 160)).astype(np.uint8)


def is_text(value: ast.expr) -> bool:
    return isinstance(value, ast.JoinedStr) or (isinstance(value, ast.Constant) and isinstance(value.value, str))


def texts_in(file: Path) -> list[str]:
    """Places at which text stands, itself or under a name, where a sentence belongs."""
    nodes = list(ast.walk(ast.parse(file.read_text(encoding="utf-8"))))
    assigned = [node for node in nodes if isinstance(node, ast.Assign) and is_text(node.value)]
    named = {name.id for node in assigned for name in node.targets if isinstance(name, ast.Name)}
    written = []
    for call in nodes:
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in TEXT_FROM:
            sentences = call.args[TEXT_FROM[call.func.id] :][:2]
            if any(is_text(value) or (isinstance(value, ast.Name) and value.id in named) for value in sentences):
                written.append(f"{file.relative_to(ROOT)}:{call.lineno}")
    return written


@pytest.mark.parametrize("room", ["calibration", "registration"])
def test_no_reason_and_no_cause_is_written_as_text(room: str) -> None:
    assert [place for file in sorted((ROOT / room).rglob("*.py")) for place in texts_in(file)] == []


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
        ([0, 1], [[10, 10], [20, 10]], "2 usable corners; a picture needs 4 or more"),
    ],
)
def test_corners_that_cannot_be_used_are_refused_in_a_sentence(
    ids: list[int], pixels: list[list[float]], text: str
) -> None:
    view = View(0, Stance(np.eye(4)), Detection(np.array(ids), np.array(pixels, float)))
    _, refused = observe(Problem("eye-in-hand", TARGETS[0], None, (160, 120), (view,)))
    assert isinstance(refused[0].what, Sentence) and refused[0].what == text

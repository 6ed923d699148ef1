"""What every target is made of, markers that OpenCV has; and the documents of targets."""

from dataclasses import fields
from typing import get_args, get_type_hints

import cv2
import pytest

from calibration.documents.target import TargetDocument
from calibration.errors import DetectionError
from calibration.targets import (
    MARKER_COUNTS,
    TAG_FAMILIES,
    AprilTagGrid,
    Charuco,
    Chessboard,
    Target,
    TrackedFrame,
    require_markers,
)


def test_the_table_of_dictionaries_is_opencvs() -> None:
    names = [name for name in dir(cv2.aruco) if name.startswith("DICT_")]
    assert {name: len(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name)).bytesList) for name in names} == (
        MARKER_COUNTS
    )
    assert set(TAG_FAMILIES.values()) <= set(MARKER_COUNTS)


@pytest.mark.parametrize(
    ("target", "code"),
    [
        (Charuco(9, 7, 20.0, 15.0, "DICT_NONE"), "unknown-dictionary"),
        (Charuco(90, 70, 20.0, 15.0, "DICT_4X4_50"), "dictionary-too-small"),
        (AprilTagGrid(4, 3, 30.0, 9.0, "tag99h9"), "unknown-dictionary"),
        (AprilTagGrid(6, 6, 30.0, 9.0, "tag16h5"), "dictionary-too-small"),
    ],
)
def test_markers_that_do_not_exist_are_refused(target: Target, code: str) -> None:
    with pytest.raises(DetectionError) as refusal:
        require_markers(target)
    assert refusal.value.code == code


def test_a_target_without_markers_needs_none() -> None:
    require_markers(Chessboard(9, 6, 20.0))


def test_every_target_has_a_document_of_its_name_and_its_fields() -> None:
    documents = get_args(get_args(TargetDocument)[0])
    described = {get_args(get_type_hints(one)["kind"])[0]: one.model_fields.keys() - {"kind"} for one in documents}
    known = {one.kind: {field.name for field in fields(one)} for one in get_args(Target) if one is not TrackedFrame}
    assert described == known  # a tracked frame is not described

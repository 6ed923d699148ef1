"""What every target is made of, markers that OpenCV has; and the documents of targets."""

from typing import get_args

import cv2
import pytest
from pydantic import TypeAdapter

from calibration.documents.target import TargetDocument
from calibration.errors import DetectionError
from calibration.targets import (
    MARKER_COUNTS,
    TAG_FAMILIES,
    AprilTagGrid,
    Charuco,
    Chessboard,
    PrintedTarget,
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


def test_every_target_stands_in_documents_by_its_kind() -> None:
    printed = get_args(PrintedTarget)
    assert {*printed} == {*get_args(Target)} - {TrackedFrame}  # a tracked frame is not described
    read = TypeAdapter(TargetDocument).json_schema()["discriminator"]["mapping"]
    assert {kind: each.rsplit("/")[-1] for kind, each in read.items()} == {one.kind: one.__name__ for one in printed}

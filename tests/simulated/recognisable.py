"""Pictures of targets of every kind and of many sizes, photographs of some, and what recognition makes of them."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from calibration.detection.detect import detect
from calibration.detection.recognition import DICTIONARY_GROUPS, recognise
from calibration.documents.target import TargetDocument
from calibration.errors import DetectionError
from calibration.targets import (
    MARKER_COUNTS,
    TAG_FAMILIES,
    AprilTagGrid,
    ArucoGrid,
    ArucoMarker,
    Charuco,
    Chessboard,
    CircleGrid,
    Target,
)
from mock_robot.scene.printed_target import PrintOptions
from tests.simulated.views import BLURRED, ORDINARY, industrial_camera, take_picture

CAMERA = industrial_camera(1600, 1200)
DICTIONARIES = tuple(name for group in DICTIONARY_GROUPS for name in group if not name.startswith("DICT_APRILTAG"))
MIN_SHARE = 0.95
"""Of pictures with a target in view, those whose target is recognised."""
RATIO_TOLERANCE = 0.2
"""Of a marker's side over the square's, or the gap's over the marker's: a proposal only, as a person measures both."""


def random_target(number: int, rng: np.random.Generator) -> Target:
    """A target: each kind in turn, its sizes at random, in mm."""

    def whole(low: int, high: int) -> int:
        return int(rng.integers(low, high + 1))

    def dictionary(needed: int) -> str:
        return str(rng.choice([name for name in DICTIONARIES if MARKER_COUNTS[name] >= needed]))

    columns, rows, edge = whole(4, 12), whole(4, 12), float(rng.uniform(10, 40))
    gap = edge * float(rng.uniform(0.2, 0.5))
    match number % 8:
        case 0 | 1:
            ratio = float(rng.uniform(0.6, 0.82))
            return Charuco(columns, rows, edge, edge * ratio, dictionary(72), bool(rng.integers(2)))
        case 2:
            return Chessboard(max(columns, rows), min(columns, rows), edge)
        case 3:
            return CircleGrid("symmetric", columns, rows, edge, str(rng.choice(["black", "white"])), "large-dot")  # type: ignore[arg-type]
        case 4:
            return CircleGrid("asymmetric", whole(3, 6), 2 * whole(3, 6) + 1, edge)
        case 5:
            return AprilTagGrid(whole(3, 7), whole(2, 5), edge, gap, str(rng.choice([*TAG_FAMILIES][:3])))
        case 6:
            return ArucoGrid(whole(3, 7), whole(2, 5), edge, gap, dictionary(60), whole(0, 20))
        case _:
            return ArucoMarker(edge, dictionary(50), whole(0, 49))


def recognisable_pictures(count: int, seed: int = 1) -> Iterator[tuple[Target, NDArray[Any]]]:
    """Targets and 1600 × 1200 pictures of them, tilted up to 40 degrees, a third of them blurred and noisy."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        target = random_target(number, rng)
        optics = BLURRED if rng.integers(3) == 0 else ORDINARY
        large = isinstance(target, CircleGrid) and target.origin is not None
        sheet = PrintOptions(large_dot_ratio=0.8) if large else None
        fill = float(rng.uniform(0.3, 0.75))
        yield target, take_picture(CAMERA, target, rng, optics, fill=fill, sheet=sheet).image


def is_same_print(recognised: Any, printed: Any) -> bool:
    """Whether a recognised target names the print, whatever its size; a dictionary by its markers."""
    if type(recognised) is not type(printed):
        return False
    return _shape(recognised) == _shape(printed) and abs(
        _ratio(recognised) - _ratio(printed)
    ) < RATIO_TOLERANCE * _ratio(printed)


def _shape(target: Any) -> tuple[Any, ...]:
    names = ("columns", "rows", "layout", "dots", "origin", "family", "first_id", "id")
    group = next((g[0] for g in DICTIONARY_GROUPS if getattr(target, "dictionary", None) in g), None)
    size: tuple[Any, ...] = tuple(getattr(target, name, None) for name in names)
    # A legacy board of an odd number of rows is printed as any other; a plain grid has no first corner.
    legacy = getattr(target, "legacy", False) and target.rows % 2 == 0
    if isinstance(target, Chessboard) or (
        isinstance(target, CircleGrid) and target.layout == "symmetric" and not target.origin
    ):
        size = (max(size[:2]), min(size[:2]), *size[2:])
    return (*size, group, legacy)


def _ratio(target: Any) -> float:
    """Of the lengths of a target, the second over the first."""
    match target:
        case Charuco():
            return target.marker_mm / target.square_mm
        case AprilTagGrid():
            return target.gap_mm / target.tag_mm
        case ArucoGrid():
            return target.gap_mm / target.marker_mm
        case _:
            return 1.0


def photographs(folder: Path) -> Iterator[tuple[str, Target, NDArray[Any]]]:
    """Name, target and image of every photograph of sessions with a target."""
    for file in sorted(folder.rglob("session.json")):
        session = json.loads(file.read_text())
        try:
            target = TypeAdapter(TargetDocument).validate_python(session["target"])
        except (KeyError, ValueError):
            continue
        for view in session["views"]:
            image = cv2.imread(str(file.parent / view["image"]), cv2.IMREAD_GRAYSCALE) if view.get("image") else None
            if image is not None:
                yield str(file.parent.relative_to(folder)), target, image


def outcome(image: NDArray[Any], target: Target) -> str:
    """`right`, `nothing`, `wrong` or `wrong, doubted`; `not in view` where its description finds nothing, either."""
    try:
        found = recognise(image)
    except DetectionError:
        found = None
    if found is None:
        try:
            detect(image, target)
        except DetectionError:
            return "not in view"
        return "nothing"
    if is_same_print(found.target, target):
        return "right"
    return "wrong, doubted" if found.doubts else "wrong"

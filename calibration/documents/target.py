"""Targets in documents and settings; the field `kind` selects the class."""

import json
from dataclasses import asdict
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from calibration.documents.validation import Document
from calibration.errors import DetectionError
from calibration.targets import (
    AprilTagGrid,
    ArucoGrid,
    ArucoMarker,
    Charuco,
    Chessboard,
    CircleGrid,
    PrintedTarget,
    Target,
    TrackedFrame,
    require_markers,
)


def printable(target: PrintedTarget) -> PrintedTarget:
    """The target, whose markers exist and fit. Raises ValueError."""
    if isinstance(target, Charuco) and target.marker_mm >= target.square_mm:
        raise ValueError("marker_mm must be smaller than square_mm")
    try:
        require_markers(target)
    except DetectionError as error:
        raise ValueError(str(error)) from None
    return target


_PRINTABLE = AfterValidator(printable)

TargetDocument = Annotated[
    Chessboard
    | Annotated[Charuco, _PRINTABLE]
    | CircleGrid
    | Annotated[AprilTagGrid, _PRINTABLE]
    | Annotated[ArucoGrid, _PRINTABLE]
    | Annotated[ArucoMarker, _PRINTABLE],
    Field(discriminator="kind"),
]
"""A target as a document holds it."""


def document_of_target(target: Target) -> PrintedTarget | None:
    """The target as documents hold it; None for a frame that is tracked, which has no size."""
    return None if isinstance(target, TrackedFrame) else target


def described(target: Target) -> dict[str, Any]:
    """What a document says of it, without what is left out there."""
    return {name: value for name, value in asdict(target).items() if value is not None}


def json_of_target(target: PrintedTarget) -> str:
    """The same as JSON in one line."""
    return json.dumps(asdict(target), separators=(",", ":"))


class TargetFile(Document):
    """The part of a session.json, plan.json or handeyed.toml that describes the target."""

    target: TargetDocument

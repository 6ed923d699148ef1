"""The document of a target; the field `kind` selects its model."""

from collections.abc import Callable
from dataclasses import asdict
from typing import Annotated, Literal, Self, get_args

from pydantic import Field, PositiveFloat, TypeAdapter, model_validator

from calibration import targets
from calibration.documents.validation import Document
from calibration.errors import DetectionError

Count = Annotated[int, Field(ge=2, le=200)]
MarkerId = Annotated[int, Field(ge=0, le=10000)]

_TARGETS: dict[str, Callable[..., targets.Target]] = {one.kind: one for one in get_args(targets.Target)}


class _TargetDocument(Document):
    """What all of them share: the fields beside `kind` are those of the target, and its markers exist."""

    kind: str

    @model_validator(mode="after")
    def _markers_exist(self) -> Self:
        try:
            targets.require_markers(self.target())
        except DetectionError as error:
            raise ValueError(str(error)) from None
        return self

    def target(self) -> targets.Target:
        return _TARGETS[self.kind](**self.model_dump(exclude={"kind"}))


class ChessboardDocument(_TargetDocument):
    """Inner corners."""

    kind: Literal["chessboard"]
    """Kind of target."""
    columns: Count
    """Points in a row: inner corners of a chessboard, squares of a ChArUco board, circles, or tags."""
    rows: Count
    """Rows of points, as columns."""
    pitch_mm: PositiveFloat
    """Distance of neighbouring points, mm; of asymmetric circles half the distance within a row."""


class CharucoDocument(_TargetDocument):
    """Squares."""

    kind: Literal["charuco"]
    """Kind of target."""
    columns: Count
    """Points in a row: inner corners of a chessboard, squares of a ChArUco board, circles, or tags."""
    rows: Count
    """Rows of points, as columns."""
    square_mm: PositiveFloat
    """Side of a square, mm."""
    marker_mm: PositiveFloat
    """Side of a marker with its black border, mm."""
    dictionary: str
    """OpenCV's name of the markers' dictionary."""
    legacy: bool = False
    """OpenCV's pattern before 4.6: boards with an even number of rows begin with a white square."""

    @model_validator(mode="after")
    def _marker_inside_square(self) -> "CharucoDocument":
        if self.marker_mm >= self.square_mm:
            raise ValueError("marker_mm must be smaller than square_mm")
        return self


class CirclesDocument(_TargetDocument):
    """Circle centres, OpenCV's conventions."""

    kind: Literal["circles"]
    """Kind of target."""
    layout: Literal["symmetric", "asymmetric"]
    """symmetric or asymmetric, as OpenCV has them."""
    columns: Count
    """Points in a row: inner corners of a chessboard, squares of a ChArUco board, circles, or tags."""
    rows: Count
    """Rows of points, as columns."""
    pitch_mm: PositiveFloat
    """Distance of neighbouring points, mm; of asymmetric circles half the distance within a row."""
    dots: Literal["black", "white"] = "black"
    """black dots on white, or white on black."""
    origin: Literal["large-dot"] | None = None
    """large-dot: the first point is a larger dot; null without."""


class AprilTagGridDocument(_TargetDocument):
    """Tags."""

    kind: Literal["apriltag-grid"]
    """Kind of target."""
    columns: Annotated[int, Field(ge=1, le=200)]
    """Points in a row: inner corners of a chessboard, squares of a ChArUco board, circles, or tags."""
    rows: Annotated[int, Field(ge=1, le=200)]
    """Rows of points, as columns."""
    tag_mm: PositiveFloat
    """Side of a tag with its black border, mm."""
    gap_mm: PositiveFloat
    """Gap between neighbouring tags or markers, mm."""
    family: str = "tag36h11"
    """AprilTag family."""


class ArucoGridDocument(_TargetDocument):
    """OpenCV's GridBoard."""

    kind: Literal["aruco-grid"]
    """Kind of target."""
    columns: Annotated[int, Field(ge=1, le=200)]
    """Points in a row: inner corners of a chessboard, squares of a ChArUco board, circles, or tags."""
    rows: Annotated[int, Field(ge=1, le=200)]
    """Rows of points, as columns."""
    marker_mm: PositiveFloat
    """Side of a marker with its black border, mm."""
    gap_mm: PositiveFloat
    """Gap between neighbouring tags or markers, mm."""
    dictionary: str
    """OpenCV's name of the markers' dictionary."""
    first_id: MarkerId = 0
    """Id of the first marker."""


class ArucoMarkerDocument(_TargetDocument):
    """One marker."""

    kind: Literal["aruco-marker"]
    """Kind of target."""
    marker_mm: PositiveFloat
    """Side of a marker with its black border, mm."""
    dictionary: str
    """OpenCV's name of the markers' dictionary."""
    id: MarkerId
    """Id of the marker."""


TargetDocument = Annotated[
    ChessboardDocument
    | CharucoDocument
    | CirclesDocument
    | AprilTagGridDocument
    | ArucoGridDocument
    | ArucoMarkerDocument,
    Field(discriminator="kind"),
]


def document_of_target(target: targets.Target) -> TargetDocument | None:
    """The document that describes this target; None for a frame that is tracked, which has no size."""
    if isinstance(target, targets.TrackedFrame):
        return None
    found: TargetDocument = TypeAdapter(TargetDocument).validate_python({"kind": target.kind, **asdict(target)})
    return found


class TargetFile(Document):
    """The part of a session.json, plan.json or handeyed.toml that describes the target."""

    target: TargetDocument

"""Planar targets: the coordinates of their points in mm, in the target's frame.

x runs along a row (columns count along it), y runs down the columns, z points into the board, away from the
camera that looks at it. The id of a point is its index, row by row. Documents and settings hold the same classes:
`kind` selects one there, the text below a field describes it, and its limits are checked when one is read.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, Field, PositiveFloat

from calibration.errors import DetectionError
from calibration.sentences.described import Described
from calibration.sentences.sentence import Sentence

if TYPE_CHECKING:
    from calibration.transforms import Array

Points = list[tuple[float, float, float]]
"""x, y, z in mm, in the order of the ids."""

Count = Annotated[int, Field(ge=2, le=200)]
MarkerCount = Annotated[int, Field(ge=1, le=200)]
MarkerId = Annotated[int, Field(ge=0, le=10000)]

_MARKERS = {
    **{f"DICT_{bits}X{bits}_{count}": count for bits in (4, 5, 6, 7) for count in (50, 100, 250, 1000)},
    "DICT_ARUCO_ORIGINAL": 1024,
    "DICT_ARUCO_MIP_36h12": 250,
    "DICT_APRILTAG_16h5": 30,
    "DICT_APRILTAG_25h9": 35,
    "DICT_APRILTAG_36h10": 2320,
    "DICT_APRILTAG_36h11": 587,
}
MARKER_COUNTS = _MARKERS | {name.upper(): count for name, count in _MARKERS.items()}
"""Number of markers in each of OpenCV's dictionaries, by its name in cv2.aruco, where some have a second spelling."""

TAG_FAMILIES = {
    "tag36h11": "DICT_APRILTAG_36h11",
    "tag36h10": "DICT_APRILTAG_36h10",
    "tag25h9": "DICT_APRILTAG_25h9",
    "tag16h5": "DICT_APRILTAG_16h5",
}
"""OpenCV's dictionary of each AprilTag family."""


def require_kind(schema: dict[str, Any]) -> None:
    """A document names the kind of its target; only the code's own classes have it by default."""
    del schema["properties"]["kind"]["default"]
    schema["required"] = ["kind", *schema["required"]]


IN_DOCUMENTS = ConfigDict(extra="forbid", allow_inf_nan=False)
"""Of a dataclass that documents hold as it stands: strict as `calibration.documents.validation.Document`."""


class _Printed(Described):
    """What all have. Each class states its fields, in order and with their limits; here stands what describes them."""

    __pydantic_config__: ClassVar[ConfigDict] = {**IN_DOCUMENTS, "json_schema_extra": require_kind}

    kind: str
    """Kind of target."""


class _Rows(_Printed):
    """What those in rows have."""

    columns: int
    """Points in a row: inner corners of a chessboard, squares of a ChArUco board, circles, or tags."""
    rows: int
    """Rows of points, as columns."""


def _grid(columns: int, rows: int, pitch_mm: float) -> Points:
    return [(u * pitch_mm, v * pitch_mm, 0.0) for v in range(rows) for u in range(columns)]


def _array(points: Points) -> "Array":
    """(n, 3)"""
    import numpy as np  # here: settings and printed boards need no arrays, and numpy takes longest to import

    return np.array(points, dtype=np.float64)


@dataclass(frozen=True)
class Chessboard(_Rows):
    """`columns` × `rows` inner corners; the origin is the first of them."""

    kind: Literal["chessboard"] = field(default="chessboard", kw_only=True)
    columns: Count
    rows: Count
    pitch_mm: PositiveFloat
    """Distance of neighbouring points in a row, mm; OpenCV's samples take half of it for asymmetric circles."""

    @cached_property
    def points_mm(self) -> "Array":
        """(n, 3)"""
        return _array(_grid(self.columns, self.rows, self.pitch_mm))


@dataclass(frozen=True)
class Charuco(_Rows):
    """`columns` × `rows` squares; its points are the inner corners, its origin the board's outer corner (as OpenCV)."""

    kind: Literal["charuco"] = field(default="charuco", kw_only=True)
    columns: Count
    rows: Count
    square_mm: PositiveFloat
    """Side of a square, mm."""
    marker_mm: PositiveFloat
    """Side of a marker with its black border, mm."""
    dictionary: str
    """OpenCV's name of the markers' dictionary."""
    legacy: bool = False
    """OpenCV's pattern before 4.6: boards with an even number of rows begin with a white square."""

    @cached_property
    def points_mm(self) -> "Array":
        """(n, 3)"""
        edge = self.square_mm
        return _array([(x + edge, y + edge, z) for x, y, z in _grid(self.columns - 1, self.rows - 1, edge)])


@dataclass(frozen=True)
class CircleGrid(_Rows):
    """Circle centres; asymmetric: OpenCV's, `pitch_mm` between neighbours in a row, odd rows shifted by half."""

    kind: Literal["circles"] = field(default="circles", kw_only=True)
    layout: Literal["symmetric", "asymmetric"]
    """symmetric or asymmetric, as OpenCV has them."""
    columns: Count
    rows: Count
    pitch_mm: PositiveFloat
    """Distance of neighbouring points in a row, mm; OpenCV's samples take half of it for asymmetric circles."""
    dots: Literal["black", "white"] = "black"
    """black dots on white, or white on black."""
    origin: Literal["large-dot"] | None = None
    """large-dot: the first point is a larger dot; null without."""

    @property
    def centres_mm(self) -> Points:
        """The points, without numpy."""
        if self.layout == "symmetric":
            return _grid(self.columns, self.rows, self.pitch_mm)
        half = self.pitch_mm / 2
        return [((2 * u + v % 2) * half, v * half, 0.0) for v in range(self.rows) for u in range(self.columns)]

    @cached_property
    def points_mm(self) -> "Array":
        """(n, 3)"""
        return _array(self.centres_mm)


@dataclass(frozen=True)
class MarkerGrid:
    """`columns` × `rows` square markers of a dictionary of OpenCV, numbered row by row from `first`.

    Four corners a marker, id = 4 (number - first) + corner; the origin is the first corner of the first marker.
    """

    columns: int
    rows: int
    side_mm: float
    gap_mm: float
    dictionary: str
    first: int = 0

    @property
    def count(self) -> int:
        return self.columns * self.rows

    @cached_property
    def points_mm(self) -> "Array":
        """(n, 3)"""
        side = self.side_mm
        origins = _grid(self.columns, self.rows, side + self.gap_mm)
        corners = ((0.0, 0.0), (side, 0.0), (side, side), (0.0, side))
        return _array([(x + right, y + down, z) for x, y, z in origins for right, down in corners])


class _OfMarkers(_Printed, ABC):
    """A target whose points are those of its markers."""

    @property
    @abstractmethod
    def markers(self) -> MarkerGrid: ...

    @cached_property
    def points_mm(self) -> "Array":
        """(n, 3)"""
        return self.markers.points_mm


@dataclass(frozen=True)
class AprilTagGrid(_Rows, _OfMarkers):
    """`columns` × `rows` tags, numbered row by row from 0; points as in MarkerGrid."""

    kind: Literal["apriltag-grid"] = field(default="apriltag-grid", kw_only=True)
    columns: MarkerCount
    rows: MarkerCount
    tag_mm: PositiveFloat
    """Side of a tag with its black border, mm."""
    gap_mm: PositiveFloat
    """Gap between neighbouring tags or markers, mm."""
    family: str = "tag36h11"
    """AprilTag family."""

    @property
    def markers(self) -> MarkerGrid:
        dictionary = TAG_FAMILIES.get(self.family, self.family)
        return MarkerGrid(self.columns, self.rows, self.tag_mm, self.gap_mm, dictionary)


@dataclass(frozen=True)
class ArucoGrid(_Rows, _OfMarkers):
    """OpenCV's GridBoard: `columns` × `rows` markers, numbered row by row from `first_id`; points as in MarkerGrid."""

    kind: Literal["aruco-grid"] = field(default="aruco-grid", kw_only=True)
    columns: MarkerCount
    rows: MarkerCount
    marker_mm: PositiveFloat
    """Side of a marker with its black border, mm."""
    gap_mm: PositiveFloat
    """Gap between neighbouring tags or markers, mm."""
    dictionary: str
    """OpenCV's name of the markers' dictionary."""
    first_id: MarkerId = 0
    """Id of the first marker."""

    @property
    def markers(self) -> MarkerGrid:
        return MarkerGrid(self.columns, self.rows, self.marker_mm, self.gap_mm, self.dictionary, self.first_id)


@dataclass(frozen=True)
class ArucoMarker(_OfMarkers):
    """One ArUco marker: its four corners, the first of them the origin. A board of several is far more accurate."""

    kind: Literal["aruco-marker"] = field(default="aruco-marker", kw_only=True)
    marker_mm: PositiveFloat
    """Side of a marker with its black border, mm."""
    dictionary: str
    """OpenCV's name of the markers' dictionary."""
    id: MarkerId
    """Id of the marker."""

    @property
    def markers(self) -> MarkerGrid:
        return MarkerGrid(1, 1, self.marker_mm, self.marker_mm, self.dictionary, self.id)


@dataclass(frozen=True)
class TrackedFrame:
    """A frame whose pose a tracker gives, without printed points: errors are taken at the corners of a square."""

    kind: ClassVar = "frame"
    half_side_mm: float = 100.0

    @cached_property
    def points_mm(self) -> "Array":
        """(4, 3)"""
        half = self.half_side_mm
        return _array([(x, y, 0.0) for y in (-half, half) for x in (-half, half)])


Grid = Chessboard | Charuco | CircleGrid | AprilTagGrid | ArucoGrid
PrintedTarget = Grid | ArucoMarker
Target = PrintedTarget | TrackedFrame
MarkerTarget = AprilTagGrid | ArucoGrid | ArucoMarker


def outline_mm(points_mm: "Array") -> "Array":
    """The rectangle (4, 3) around the points (n, 3) of a target."""
    (left, bottom, _), (right, top, _) = points_mm.min(axis=0), points_mm.max(axis=0)
    return _array([(left, bottom, 0.0), (right, bottom, 0.0), (right, top, 0.0), (left, top, 0.0)])


def orientation_advice(target: Target) -> str | None:
    """What to do about a target that looks the same turned by 180 degrees; None for one that does not."""
    match target:
        case Chessboard() if (target.columns + target.rows) % 2 == 0:
            return "make one of columns and rows odd, the other even"
        case CircleGrid() if target.origin is None and (target.layout == "symmetric" or target.rows % 2 == 1):
            return "use a grid with a large dot, or an asymmetric grid with an even number of rows"
        case _:
            return None


def require_markers(target: Target) -> None:
    """Raises DetectionError `unknown-dictionary` or `dictionary-too-small` for a target that cannot be printed."""
    match target:
        case Charuco():
            name, needed = target.dictionary, target.columns * target.rows // 2
        case ArucoGrid() | ArucoMarker():
            name, needed = target.dictionary, target.markers.first + target.markers.count
        case AprilTagGrid():
            if target.family not in TAG_FAMILIES:
                what = Sentence("unknown-family", family=target.family)
                raise DetectionError("unknown-dictionary", what, Sentence("use-family", families=list(TAG_FAMILIES)))
            name, needed = TAG_FAMILIES[target.family], target.columns * target.rows
        case _:
            return
    if name not in MARKER_COUNTS:
        what = Sentence("unknown-dictionary", dictionary=name)
        raise DetectionError("unknown-dictionary", what, Sentence("use-dictionary"))
    if needed > MARKER_COUNTS[name]:
        what = Sentence("dictionary-too-small", dictionary=name, markers=MARKER_COUNTS[name], needed=needed)
        raise DetectionError("dictionary-too-small", what, Sentence("check-dictionary"))

"""Lay out a target on a page: centred, with two rulers to check the print, and a caption."""

import math
import textwrap
from dataclasses import dataclass
from functools import singledispatch

from calibration.targets import AprilTagGrid, ArucoGrid, ArucoMarker, Charuco, Chessboard, CircleGrid, Target
from daemon.tools.target_print.errors import PrintRefused
from daemon.tools.target_print.shapes import Artwork, Box, Disc, Rectangles, Sheet, TextLine, chessboard_squares

DOT_RADIUS = 0.25
"""Relative to the distance to the nearest neighbour: dots and gaps are equally wide."""

LARGE_DOT_RADIUS = 0.375
"""The origin dot of a circle grid: 1.5 times the radius of the others."""


@singledispatch
def artwork(target: Target) -> Artwork:
    """The shapes of `target` and the paper it needs. Raises DetectionError for markers that OpenCV does not have."""
    raise TypeError(f"no artwork for {type(target).__name__}")


@artwork.register
def _(target: Chessboard) -> Artwork:
    pitch = target.pitch_mm
    squares = chessboard_squares(target.columns + 1, target.rows + 1, pitch, origin=-pitch)
    black = tuple(box for column, row, box in squares if (column + row) % 2 == 0)
    extent = Box(-2 * pitch, -2 * pitch, (target.columns + 1) * pitch, (target.rows + 1) * pitch)
    return Artwork((Rectangles(black),), extent)


@artwork.register
def _(target: CircleGrid) -> Artwork:
    neighbour = target.pitch_mm if target.layout == "symmetric" else target.pitch_mm / math.sqrt(2)
    centres = target.centres_mm
    columns_mm, rows_mm = [x for x, _, _ in centres], [y for _, y, _ in centres]
    extent = Box(
        min(columns_mm) - neighbour, min(rows_mm) - neighbour, max(columns_mm) + neighbour, max(rows_mm) + neighbour
    )
    ground = (Rectangles((extent,)),) if target.dots == "white" else ()
    large = 0 if target.origin == "large-dot" else None
    dots = tuple(
        Disc(x, y, (LARGE_DOT_RADIUS if index == large else DOT_RADIUS) * neighbour, target.dots)
        for index, (x, y, _) in enumerate(centres)
    )
    return Artwork((*ground, *dots), extent)


@artwork.register
def _(target: Charuco) -> Artwork:
    from daemon.tools.target_print.marker_artwork import charuco

    return charuco(target)


@artwork.register(AprilTagGrid)
@artwork.register(ArucoGrid)
@artwork.register(ArucoMarker)
def _(target: AprilTagGrid | ArucoGrid | ArucoMarker) -> Artwork:
    from daemon.tools.target_print.marker_artwork import marker_grid

    return marker_grid(target)


PAGES_MM: dict[str, tuple[float, float]] = {
    "A4": (210.0, 297.0),
    "A3": (297.0, 420.0),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
    "letter": (215.9, 279.4),
    "tabloid": (279.4, 431.8),
}
UNPRINTABLE_MM = 6.0
"""The margin that most printers cannot print on."""

RULERS_MM = (100.0, 50.0)
TEXT_MM = 2.6
LINE_MM = 1.3 * TEXT_MM
STRIP_MM = 9.0
"""Space for a ruler and its label along the left and the lower edge."""

PRINT_NOTE = "Print at 100 % (no 'fit to page'). Then measure: both rulers must have the length written at them."


@dataclass(frozen=True)
class Page:
    """A page in portrait orientation; sizes in mm."""

    name: str
    width: float
    height: float


def parse_page(text: str) -> Page:
    """The page `A4`, `letter`, ... or `WIDTHxHEIGHT` in mm. Raises PrintRefused."""
    for name, (width, height) in PAGES_MM.items():
        if text.lower() == name.lower():
            return Page(name, width, height)
    try:
        width, height = (float(part) for part in text.lower().split("x"))
    except ValueError:
        width = height = float("nan")
    if not (20 <= width <= 5000 and 20 <= height <= 5000):
        fix = f"one of {', '.join(PAGES_MM)}, or WIDTHxHEIGHT in mm such as 600x400"
        raise PrintRefused(f"page: none is called {text!r}", fix)
    return Page(text, width, height)


def lay_out(target: Target, page: Page, title: str, snippet: str) -> Sheet:
    """Place `target` on `page`, in landscape if only that fits. Raises PrintRefused when neither does."""
    art = artwork(target)
    upright, turned = (page.width, page.height), (page.height, page.width)
    order = (upright, turned) if art.extent.height >= art.extent.width else (turned, upright)
    for width, height in order:
        words = _words(width, title, snippet)
        room = Box(
            UNPRINTABLE_MM + STRIP_MM,
            UNPRINTABLE_MM,
            width - UNPRINTABLE_MM,
            height - UNPRINTABLE_MM - STRIP_MM - len(words) * LINE_MM,
        )
        if art.extent.width <= room.width + 1e-9 and art.extent.height <= room.height + 1e-9:
            break
    else:
        need = f"{art.extent.width:g} x {art.extent.height:g} mm with its white margin"
        fix = "a larger --page, fewer columns and rows, or a smaller pitch"
        raise PrintRefused(f"page: {page.name} is too small for the target, which needs {need}", fix)
    x = room.left + (room.width - art.extent.width) / 2 - art.extent.left
    y = room.top + (room.height - art.extent.height) / 2 - art.extent.top
    lower = height - UNPRINTABLE_MM - len(words) * LINE_MM
    captions = [
        TextLine(UNPRINTABLE_MM, lower + (line + 1) * LINE_MM, TEXT_MM, text) for line, text in enumerate(words)
    ]
    rulers = [
        *_ruler(UNPRINTABLE_MM + STRIP_MM, lower - 1, _ruler_length(width), across=True),
        *_ruler(UNPRINTABLE_MM, UNPRINTABLE_MM + 1, _ruler_length(height), across=False),
    ]
    return Sheet(width, height, (x, y), (*(shape.translate(x, y) for shape in art.shapes), *rulers, *captions))


def _ruler_length(side: float) -> float:
    return next((length for length in RULERS_MM if length <= side - 4 * STRIP_MM), 10.0)


def _ruler(x: float, y: float, length: float, across: bool) -> list[Rectangles | TextLine]:
    """A ruler with a tick each mm from 0 to `length`, measured between the outer edges of the two end ticks."""
    thin = 0.1
    boxes = []
    for millimetre in range(int(length) + 1):
        height = 5.0 if millimetre % 10 == 0 else 3.5 if millimetre % 5 == 0 else 2.0
        # The two end ticks lie inside the length, so that a caliper set to it meets black.
        start = min(max(millimetre - thin / 2, 0.0), length - thin)
        boxes.append(
            Box(x + start, y - height, x + start + thin, y)
            if across
            else Box(x, y + start, x + height, y + start + thin)
        )
    label = f"{length:g} mm"
    words = TextLine(x + length + 1.5, y, TEXT_MM, label) if across else TextLine(x, y + length + 4, TEXT_MM, label)
    return [Rectangles(tuple(boxes)), words]


def _words(width: float, title: str, snippet: str) -> list[str]:
    letters = int((width - 2 * UNPRINTABLE_MM) / (0.55 * TEXT_MM))
    return [line for text in (f"{title}. {PRINT_NOTE}", snippet) for line in textwrap.wrap(text, letters)]

"""Lay out a target on a page: centred, with two rulers to check the print, and a caption."""

import math
import textwrap
from functools import singledispatch

from calibration.documents.target import json_of_target
from calibration.sentences.sentence import Sentence
from calibration.targets import Charuco, Chessboard, CircleGrid, PrintedTarget
from daemon.errors import PrintRefused
from daemon.tools.target_print.shapes import Artwork, Box, Disc, Rectangles, Sheet, TextLine, chessboard_squares

DOT_RADIUS = 0.25
"""Relative to the distance to the nearest neighbour: dots and gaps are equally wide."""

LARGE_DOT_RADIUS = 0.375
"""The origin dot of a circle grid: 1.5 times the radius of the others."""


@singledispatch
def artwork(target: PrintedTarget) -> Artwork:
    """The shapes of `target` and the paper it needs. Raises DetectionError for markers that OpenCV does not have."""
    from daemon.tools.target_print.marker_artwork import charuco, marker_grid

    assert not isinstance(target, Chessboard | CircleGrid)  # these have functions of their own
    return charuco(target) if isinstance(target, Charuco) else marker_grid(target)


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


PAGES_MM: dict[str, tuple[float, float]] = {
    "A4": (210.0, 297.0),
    "A3": (297.0, 420.0),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
    "letter": (215.9, 279.4),
    "tabloid": (279.4, 431.8),
}
"""Width and height of a page in portrait orientation."""
UNPRINTABLE_MM = 6.0
"""The margin that most printers cannot print on."""

RULERS_MM = (100.0, 50.0)
TEXT_MM = 2.6
LINE_MM = 1.3 * TEXT_MM
STRIP_MM = 9.0
"""Space for a ruler and its label along the left and the lower edge."""

PRINT_NOTE = "Print at 100 % (no 'fit to page'). Then measure: both rulers must have the length written at them."


def page_mm(text: str) -> tuple[float, float]:
    """Width and height of the page `A4`, `letter`, ... or `WIDTHxHEIGHT` in mm. Raises PrintRefused."""
    for name, sides in PAGES_MM.items():
        if text.lower() == name.lower():
            return sides
    try:
        width, height = (float(part) for part in text.lower().split("x"))
    except ValueError:
        width = height = float("nan")
    if not (20 <= width <= 5000 and 20 <= height <= 5000):
        raise PrintRefused(Sentence("no-such-page", page=text), Sentence("name-page", pages=list(PAGES_MM)))
    return width, height


def lay_out(target: PrintedTarget, page: str | None = None) -> Sheet:
    """Place `target` on a page, in landscape if only that fits; None: the smallest of A4 to A0 that holds it.

    Raises PrintRefused when the page does not hold it, or none is called so.
    """
    art, title = artwork(target), f"handeyed target: {target.kind}"
    pages = [page] if page else [name for name in PAGES_MM if name.startswith("A")]
    tall, snippet = art.extent.height >= art.extent.width, json_of_target(target)
    for width, height in (sides[::turn] for sides in map(page_mm, pages) for turn in ((1, -1) if tall else (-1, 1))):
        letters, texts = int((width - 2 * UNPRINTABLE_MM) / (0.55 * TEXT_MM)), (f"{title}. {PRINT_NOTE}", snippet)
        words = [line for text in texts for line in textwrap.wrap(text, letters)]
        room = Box(
            UNPRINTABLE_MM + STRIP_MM,
            UNPRINTABLE_MM,
            width - UNPRINTABLE_MM,
            height - UNPRINTABLE_MM - STRIP_MM - len(words) * LINE_MM,
        )
        if art.extent.width <= room.width + 1e-9 and art.extent.height <= room.height + 1e-9:
            break
    else:
        need = {"width_mm": art.extent.width, "height_mm": art.extent.height}
        raise PrintRefused(Sentence("page-too-small", page=pages[-1], **need), Sentence("take-larger-page"))
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
    return Sheet(width, height, (x, y), title, (*(shape.translate(x, y) for shape in art.shapes), *rulers, *captions))


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

"""Recognition of a target that nobody has described: its kind, columns, rows, dictionary, and relative sizes.

Markers are read by every dictionary; where they stand beside each other and how they are numbered gives the board.
Without markers the picture is searched for a lattice of corners, then of dots. What is recognised is looked for by its
own detector, so that a name is never given without its points.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import product
from math import ceil
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.detection.charuco import find_charuco_lattices, identify_lattice
from calibration.detection.chessboard import find_boards
from calibration.detection.detect import detect, silence_opencv
from calibration.detection.dot_lattice import grow_dot_lattices
from calibration.detection.dots import find_dots
from calibration.detection.image import Grey, downscale, grey_image, to_full_size
from calibration.detection.plane_view import fit_plane_view
from calibration.detection.squares import squares_are_blank
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.sentences.sentence import Sentence, as_sentence
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
from calibration.transforms import Array

SEARCH_PIXELS = (2.0e6, 1.3e7)
"""Pixels of the picture in which markers are read, one after the other until a board is recognised."""
MIN_SHARE, SURE_SHARE = 0.6, 0.9
"""Least share of a target's points that are found, and below which it is doubtful."""
MIN_BOARD, MIN_DOTS = 3, 12
"""Least columns and rows of a chessboard, and dots: a part of a larger pattern may look like less."""
MIN_ARRANGED, MAX_COLUMNS = 3, 40
"""Least markers that agree on a board, and its most columns."""
MIN_ADDED = 4
"""Points seen for each one missing, of a row that is added to those whose markers were read."""
CELL_TOLERANCE = 0.2
"""A marker's distance from its place beside another one, as a share of the step."""
NEAR_STEPS = 1.6
"""Markers nearer than this many least steps are neighbours."""
MARKERS_TRIED = (0.75, 0.6, 0.85)
"""Sides of a ChArUco marker over the square's, the usual one first, where no marker can be read alone."""
MIN_FILLED = 0.85
"""Least share of a symmetric grid's places that hold a dot; an asymmetric one fills about half."""
DICTIONARY_GROUPS = (
    *(tuple(f"DICT_{bits}X{bits}_{count}" for count in (100, 50, 250, 1000)) for bits in (4, 5, 6, 7)),
    *((name,) for name in ("DICT_ARUCO_ORIGINAL", "DICT_ARUCO_MIP_36h12", *TAG_FAMILIES.values())),
)
"""OpenCV's dictionaries; those of a group begin with the same markers, and the first with enough of them is named."""
SURE_DICTIONARIES = ("DICT_5X5", "DICT_6X6", "DICT_7X7", "DICT_APRILTAG_36", "DICT_ARUCO_MIP")
"""Dictionaries whose markers nothing else is taken for, so that one alone is believed."""
SEARCHES_OF_KIND: dict[type, int] = {
    AprilTagGrid: 1, ArucoGrid: 1, Charuco: 2, Chessboard: 2, CircleGrid: 3, ArucoMarker: 4
}  # fmt: skip
"""How many of the searches, in their order, may give a target of a kind; later ones give other kinds only."""


@dataclass(frozen=True)
class Recognised:
    """A target in a picture, its square, pitch or marker 1 long; how many of its points are seen, and what is doubtful.

    A chessboard and a symmetric grid without a large dot have at least as many columns as rows.
    """

    target: Target
    points: int
    doubts: tuple[Sentence, ...]


def recognise(image: NDArray[Any], kind: type | None = None) -> Recognised | None:
    """The target that an 8-bit picture (h, w) or (h, w, 3) shows; None where there is none. Raises DetectionError.

    With a `kind`, what only another kind can be is not searched; another one that comes first is still returned.
    """
    grey = grey_image(image)
    searches = (boards_of_markers, boards_of_corners, grids_of_dots, single_markers)
    with silence_opencv():
        for search in searches if kind is None else searches[: SEARCHES_OF_KIND[kind]]:
            for candidates in search(grey):
                found = [one for target in candidates if (one := verify(grey, target)) is not None]
                if found:
                    return max(found, key=lambda one: one.points - MIN_ADDED * (len(one.target.points_mm) - one.points))
    return None


def verify(image: Grey, target: Target) -> Recognised | None:
    """The target as its detector sees it; None when too little of it is there."""
    try:
        seen = detect(image, target)
    except DetectionError:
        return None
    share = len(seen.ids) / len(target.points_mm)
    if share < MIN_SHARE:
        return None
    doubts = [Sentence("doubt-few-points", found=len(seen.ids), of=len(target.points_mm))] if share < SURE_SHARE else []
    if _may_go_on(image, target, seen):
        doubts.append(Sentence("doubt-beyond-picture"))
    if isinstance(target, Charuco) and target.marker_mm in MARKERS_TRIED:
        doubts.append(Sentence("doubt-marker-size"))
    if isinstance(target, ArucoMarker) and not target.dictionary.startswith(SURE_DICTIONARIES):
        doubts.append(Sentence("doubt-one-marker", dictionary=target.dictionary))
    return Recognised(target, len(seen.ids), tuple(doubts))


def _may_go_on(image: Grey, target: Target, seen: Detection) -> bool:
    """Whether one more line of the pattern would lie outside the picture."""
    size = np.array(image.shape[::-1])
    points = target.points_mm[:, :2]
    view, _ = fit_plane_view(points[seen.ids], seen.corners_px, (int(size[0]), int(size[1])))
    step = 0.0 if isinstance(target, ArucoMarker) else 0.5 if isinstance(target, CircleGrid) else 1.0
    low, high = points.min(axis=0) - step, points.max(axis=0) + step
    around = view.map(
        np.array([[x, y] for x in np.linspace(low[0], high[0], 5) for y in np.linspace(low[1], high[1], 5)])
    )
    return bool(np.any((around < 0) | (around > size - 1)))


# --- beside a description ---


@dataclass(frozen=True)
class Alternative:
    """A target that the image shows, and its settings that are other than described."""

    target: Target
    changes: tuple[tuple[str, str], ...]

    def error(self, refusal: DetectionError) -> DetectionError:
        """The refusal of the target described, with what the image shows instead; its code is kept."""
        names = [name for name, _ in self.changes]
        settings = [f"{name} = {value}" for name, value in self.changes]
        what = Sentence("seen-another", refused=as_sentence(refusal.what), settings=names)
        return DetectionError(refusal.code, what, Sentence("see-settings", settings=settings))


def find_alternative(image: Grey, described: Target) -> Alternative | None:
    """What an image shows in which `described` was not found, with its lengths; None where it is of another kind."""
    found = recognise(image, type(described))
    if found is None or type(found.target) is not type(described):
        return None
    lengths = {field.name: getattr(described, field.name) for field in fields(described) if field.name.endswith("_mm")}
    seen: Any = replace(found.target, **lengths)
    for group in (group for group in DICTIONARY_GROUPS if getattr(seen, "dictionary", None) in group):
        same = [name for name in group if MARKER_COUNTS[name] == MARKER_COUNTS.get(described.dictionary)]  # type: ignore[union-attr]
        seen = replace(seen, dictionary=next(iter(same), seen.dictionary))
    values = ((field.name, getattr(described, field.name), getattr(seen, field.name)) for field in fields(seen))
    # As JSON and TOML write it.
    changes = tuple(
        (name, f'"{there}"' if isinstance(there, str) else str(there).lower())
        for name, here, there in values
        if here != there
    )
    return Alternative(seen, changes) if changes else None


# --- markers ---


@dataclass(frozen=True, eq=False)
class ReadMarkers:
    """Markers of a dictionary: `ids` (n,), `corners` (n, 4, 2) px of the whole picture."""

    group: tuple[str, ...]
    ids: NDArray[np.intp]
    corners: Array

    def dictionary(self, needed: int) -> str:
        """The first of the group that has the markers needed."""
        return next((name for name in self.group if MARKER_COUNTS[name] >= needed), self.group[-1])

    def cells(self) -> tuple[bool, float, dict[int, tuple[int, int]]]:
        """Whether neighbours stand diagonally, the step along an axis in sides, and the cells of the largest block.

        Each marker's own corners are a frame in which its neighbours are one step away.
        """
        square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32) - np.float32(0.5)
        frames = [cv2.getPerspectiveTransform(corners.astype(np.float32), square) for corners in self.corners]
        middles = np.array([_map(np.linalg.inv(frame), np.zeros((1, 2)))[0] for frame in frames])
        away = np.array([_map(frame, middles) for frame in frames])
        # To and fro: what perspective adds to one it takes from the other.
        away = (away - away.transpose(1, 0, 2)) / 2
        length = np.hypot(*np.moveaxis(away, -1, 0)) + np.diag(np.full(len(frames), np.inf))
        nearest = away[np.arange(len(frames)), length.argmin(axis=1)]
        along = np.sort(np.abs(nearest), axis=1)
        diagonal = bool(np.median(along[:, 0] / along[:, 1]) > 0.5)
        step = float(np.median(along[:, 1]))
        near = [np.flatnonzero(row < NEAR_STEPS * step * (np.sqrt(2) if diagonal else 1)) for row in length]
        blocks = []
        free = set(range(len(frames)))
        while free:
            start = free.pop()
            cells, queue = {start: (0, 0)}, [start]
            for here in queue:
                for there in (int(one) for one in near[here] if int(one) in free):
                    cell = away[here, there] / step
                    if np.all(np.abs(cell - np.rint(cell)) < CELL_TOLERANCE):
                        free.discard(there)
                        queue.append(there)
                        cells[there] = (cells[here][0] + round(cell[0]), cells[here][1] + round(cell[1]))
            blocks.append(cells)
        return diagonal, step, max(blocks, key=len)

    def boards(self, image: Grey) -> Iterator[Target]:
        """The boards on which most markers stand where their numbers have them."""
        diagonal, step, cells = self.cells()
        if len(cells) < MIN_ARRANGED:
            return
        ids, at = self.ids[list(cells)], np.array(list(cells.values()))
        most, best = 0, None
        # Columns, and the number of the first marker below them, or whether a ChArUco board begins with a marker.
        numberings = ((n, k) for n in range(2 if diagonal else 1, MAX_COLUMNS + 1) for k in range(2 if diagonal else n))
        for columns, first in numberings:
            places = (
                charuco_places(ids, columns, first)
                if diagonal
                else np.column_stack(np.divmod(ids - first, columns)[::-1])
            )
            (shift, count), *_ = Counter(map(tuple, (at - places).tolist())).most_common(1)
            if count > most:
                most, best = count, (columns, first, places[np.all(at - places == shift, axis=1)])
        if best is None or most < MIN_ARRANGED:
            return
        columns, first, places = best
        top, rows = int(places[:, 1].min()), int(places[:, 1].max()) + 1
        if diagonal:
            # Not every row has a marker that can be read alone; the lattice of corners shows them.
            sizes = [tuple(seen.lattice.cells.max(axis=0) + 2) for seen in find_charuco_lattices(image)]
            more = {int(size[1 - k]) for size in sizes for k in (0, 1) if abs(size[k] - columns) <= 1}
            for count in sorted({max(rows, size + added, 2) for size in (rows, *more) for added in (0, 1)}):
                if not (first and count % 2):
                    name = self.dictionary(columns * count // 2)
                    yield Charuco(columns, count, 1.0, round(1 / step, 3), name, legacy=first == 1)
            return
        dictionary = self.dictionary(int(ids.max()) + 1)
        family = next((name for name, its in TAG_FAMILIES.items() if its == dictionary), None)
        if family is not None and first == 0:
            yield AprilTagGrid(columns, rows, 1.0, round(step - 1, 3), family)
        else:
            yield ArucoGrid(columns, rows - top, 1.0, round(step - 1, 3), dictionary, first + top * columns)


def _map(homography: Any, points: Any) -> Array:
    """Points (n, 2) by a homography."""
    uvw = np.column_stack([points, np.ones(len(points))]) @ homography.T
    return np.asarray(uvw[:, :2] / uvw[:, 2:])


def _read_markers(image: Grey, pixels: float) -> Iterator[ReadMarkers]:
    """What each dictionary reads."""
    small, factor = downscale(image, pixels)
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    for group in DICTIONARY_GROUPS:
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, group[-1]))
        corners, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(small)
        if ids is not None:
            full = to_full_size(np.array(corners, float).reshape(-1, 2), factor).reshape(-1, 4, 2)
            yield ReadMarkers(group, np.ravel(ids).astype(np.intp), full)


def boards_of_markers(image: Grey) -> Iterator[list[Target]]:
    """Boards by the markers that each dictionary reads."""
    for pixels in SEARCH_PIXELS:
        for read in _read_markers(image, pixels):
            if len(read.ids) >= MIN_ARRANGED:
                yield list(read.boards(image))
        if image.size <= pixels:
            return


def charuco_places(ids: NDArray[np.intp], columns: int, first: int) -> NDArray[np.intp]:
    """Column and row (n, 2) of the square of each marker; `first` 1: the board begins with a marker."""
    pair, rest = np.divmod(ids, columns)
    upper = (columns + first) // 2
    lower = rest >= upper
    column = 2 * np.where(lower, rest - upper, rest) + np.where(lower, first, 1 - first)
    return np.column_stack([column, 2 * pair + lower])


def single_markers(image: Grey) -> Iterator[list[Target]]:
    """Markers of which there is one of a dictionary."""
    read = [one for one in _read_markers(image, SEARCH_PIXELS[-1]) if len(one.ids) == 1]
    yield [ArucoMarker(1.0, one.dictionary(int(one.ids[0]) + 1), int(one.ids[0])) for one in read]


# --- corners and dots ---


def boards_of_corners(image: Grey) -> Iterator[list[Target]]:
    """Chessboards, and ChArUco boards none of whose markers can be read alone."""
    for seen in find_charuco_lattices(image):
        size = tuple(int(one) for one in seen.lattice.cells.max(axis=0) + 2)
        for (columns, rows), group, legacy, marker in product(
            {size, size[::-1]}, DICTIONARY_GROUPS, (False, True), MARKERS_TRIED
        ):
            name = next((name for name in group if MARKER_COUNTS[name] >= columns * rows // 2), None)
            if name is not None and not (legacy and rows % 2):
                board = Charuco(columns, rows, 1.0, marker, name, legacy)
                if identify_lattice(seen, board) is not None:
                    yield [board]
    sizes = {
        tuple(sorted(board.found.shape))
        for board in find_boards(image, Chessboard(MIN_BOARD, MIN_BOARD, 1.0))
        if min(board.found.shape) >= MIN_BOARD and squares_are_blank(image, board.points)
    }
    yield [Chessboard(columns, rows, 1.0) for rows, columns in sizes]


def grids_of_dots(image: Grey) -> Iterator[list[Target]]:
    """Grids by the lattices of dots, black and white."""
    for pixels in SEARCH_PIXELS:
        small, factor = downscale(image, pixels)
        inks: dict[Literal["black", "white"], Grey] = {"black": small, "white": np.asarray(255 - small, np.uint8)}
        for dots, ink in inks.items():
            for lattice, _ in grow_dot_lattices(find_dots(ink), MIN_DOTS):
                grids = list(dot_grids(lattice.cells))
                plain = [replace(grid, dots=dots) for grid in grids]
                yield [*(replace(grid, origin="large-dot") for grid in plain), *plain]
        if factor == 1:
            break


def dot_grids(cells: NDArray[np.intp]) -> Iterator[CircleGrid]:
    """Grids whose dots fill a lattice's cells (n, 2), either way round."""
    columns, rows = sorted((int(one) for one in cells.max(axis=0) + 1), reverse=True)
    if len(cells) >= MIN_FILLED * columns * rows:
        yield CircleGrid("symmetric", columns, rows, 1.0)
        if columns != rows:
            yield CircleGrid("symmetric", rows, columns, 1.0)
        return
    for turned in (cells, np.column_stack([cells[:, 1], -cells[:, 0]])):
        x, v = turned[:, 0] - turned[:, 1], turned.sum(axis=1)
        yield CircleGrid("asymmetric", ceil((np.ptp(x) + 1) / 2), int(np.ptp(v)) + 1, 1.0)

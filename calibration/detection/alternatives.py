"""Descriptions near a target's own, tried on an image in which the target was not found: the image may show one.

Tried are columns and rows exchanged or other by one, other dictionaries and families, ChArUco boards in OpenCV's legacy
pattern, and circle grids of the other layout and colour.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import Any

from calibration.detection.charuco import find_charuco_lattices, identify_lattice
from calibration.detection.chessboard import board_sizes
from calibration.detection.detect import detect
from calibration.detection.image import Grey
from calibration.errors import DetectionError
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
    require_markers,
)

MIN_SHARE = 0.6
"""Least share of an alternative's points that are found."""
OTHER_SIZES = tuple(step for step in product((0, -1, 1), repeat=2) if step != (0, 0))
"""Columns and rows that are other by one."""
MIN_COUNT = 2
"""Least columns and rows."""
MIN_BOARD = 3
"""Least columns and rows of a chessboard much smaller than described; a part of a larger pattern may look like less."""
DICTIONARY_GROUPS = (
    *(tuple(f"DICT_{bits}X{bits}_{count}" for count in (50, 100, 250, 1000)) for bits in (4, 5, 6, 7)),
    *((name,) for name in ("DICT_ARUCO_ORIGINAL", "DICT_ARUCO_MIP_36h12", *TAG_FAMILIES.values())),
)
"""OpenCV's dictionaries; those of a group begin with the same markers."""


@dataclass(frozen=True)
class Alternative:
    """A target that the image shows, and its settings that are other than described."""

    target: Target
    changes: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, described: Target, found: Target) -> "Alternative":
        """The settings of `found` that differ from `described`, which is of the same kind."""
        pairs = ((field.name, getattr(described, field.name), getattr(found, field.name)) for field in fields(found))
        return cls(found, tuple((name, _written(there)) for name, here, there in pairs if here != there))

    def error(self, refusal: DetectionError) -> DetectionError:
        """The refusal of the target described, with what the image shows instead; its code is kept."""
        names = [name for name, _ in self.changes]
        settings = [f"{name} = {value}" for name, value in self.changes]
        what = Sentence("seen-another", refused=as_sentence(refusal.what), settings=names)
        return DetectionError(refusal.code, what, Sentence("see-settings", settings=settings))


def _written(value: object) -> str:
    """A value as JSON and TOML write it."""
    return f'"{value}"' if isinstance(value, str) else str(value).lower()


def find_alternative(image: Grey, target: Target) -> Alternative | None:
    """The nearest description that fits an image (h, w) in which `target` was not found; None when none fits."""
    found = _search(image, target)
    return None if found is None else Alternative.of(target, found)


def _search(image: Grey, target: Target) -> Target | None:
    match target:
        case Charuco():
            return _charuco(image, target)
        case Chessboard():
            return _chessboard(image, target)
        case _:
            return _first_fit(image, _neighbours(target))


def _charuco(image: Grey, target: Charuco) -> Charuco | None:
    """The description whose markers agree with a lattice of corners in the image, which is searched once."""
    descriptions = list(_charuco_descriptions(target))
    best: tuple[tuple[int, float], Charuco] | None = None
    for lattice in find_charuco_lattices(image):
        for described in descriptions:
            try:
                found = identify_lattice(lattice, described)
            except DetectionError:  # more markers than the dictionary has
                continue
            count = 0 if found is None else len(found.ids)
            share = count / len(described.points_mm)
            if share >= MIN_SHARE and (best is None or (count, share) > best[0]):
                best = (count, share), described
        if best is not None:
            return best[1]
    return None


def _charuco_descriptions(target: Charuco) -> Iterator[Charuco]:
    """Fewest changes first; the described one is not among them."""
    own = [other for other in _sizes(target) if other != target]
    yield from own
    yield from (replace(other, legacy=not target.legacy) for other in (target, *own))
    for name in _other_dictionaries(target.dictionary, target.columns * target.rows // 2):
        other = replace(target, dictionary=name)
        turned = _turned(other)
        yield from (other, turned, *(replace(one, legacy=not target.legacy) for one in (other, turned)))


def _other_dictionaries(described: str, needed: int) -> Iterator[str]:
    """One dictionary of each group but the described one's, with the markers needed."""
    for group in DICTIONARY_GROUPS:
        name = _dictionary_of(group, described, needed)
        if name is not None and described.upper() not in map(str.upper, group):
            yield name


def _dictionary_of(group: tuple[str, ...], like: str, needed: int) -> str | None:
    """The dictionary of a group with as many markers as `like`, else the least that has the markers needed."""
    enough = [name for name in group if MARKER_COUNTS[name] >= needed]
    same = [name for name in enough if MARKER_COUNTS[name] == MARKER_COUNTS.get(like)]
    return next(iter([*same, *enough]), None)


def _chessboard(image: Grey, target: Chessboard) -> Target | None:
    """A chessboard smaller than described, by one before by more; the detector itself reports a larger one."""
    sizes = set(board_sizes(image, target))
    fitting = (other for other in _sizes(target) if sizes & {(other.columns, other.rows), (other.rows, other.columns)})
    smaller = (size for size in sorted(sizes, key=lambda size: -size[0] * size[1]) if min(size) >= MIN_BOARD)
    return next(fitting, None) or next((replace(target, columns=max(s), rows=min(s)) for s in smaller), None)


def _first_fit(image: Grey, descriptions: Iterable[Target]) -> Target | None:
    for described in descriptions:
        try:
            require_markers(described)
            found = detect(image, described)
        except DetectionError:
            continue
        if len(found.ids) >= MIN_SHARE * len(described.points_mm):
            return described
    return None


def _neighbours(target: Target) -> Iterator[Target]:
    """Descriptions near that of a grid of circles or tags, fewest changes first."""
    if not isinstance(target, ArucoMarker):
        yield from _sizes(target)
    match target:
        case CircleGrid():
            other = "symmetric" if target.layout == "asymmetric" else "asymmetric"
            yield replace(target, dots="white" if target.dots == "black" else "black")
            for described in (target, _turned(target)):
                yield replace(described, layout=other)
        case ArucoGrid() | ArucoMarker():
            for name in _other_dictionaries(target.dictionary, target.markers.first + target.markers.count):
                yield replace(target, dictionary=name)
        case AprilTagGrid():
            for family in (name for name in TAG_FAMILIES if name != target.family):
                other_family = replace(target, family=family)
                yield from (other_family, _turned(other_family))


def _turned(target: Any) -> Any:
    """Columns and rows exchanged."""
    return replace(target, columns=target.rows, rows=target.columns)


def _sizes(target: Any) -> Iterator[Any]:
    """Columns and rows exchanged, then other by one, then both."""
    turned = _turned(target)
    if target.columns != target.rows:
        yield turned
    for described in (target, turned) if target.columns != target.rows else (target,):
        for columns, rows in OTHER_SIZES:
            if min(described.columns + columns, described.rows + rows) >= MIN_COUNT:
                yield replace(described, columns=described.columns + columns, rows=described.rows + rows)

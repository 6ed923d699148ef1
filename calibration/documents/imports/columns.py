"""What named numbers mean: the headers of a table, or the keys of a JSON or YAML record.

A name is split into words. Its last word says the axis or the position in a list; the others say whether it is a
length, an orientation, a matrix, a picture, a time or a label. Units in a name count: `x_mm`, `rx [deg]`.
"""

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sides import WORD_FRAMES, WORDS
from calibration.kinematics.conventions import CONVENTIONS, MM, Convention, LengthUnit

Family = Literal["length", "turn", "pose"]

LENGTH_WORDS, TURN_WORDS, QUATERNION_WORDS, VECTOR_WORDS, POSE_WORDS, IMAGE_WORDS, TIME_WORDS, LABEL_WORDS = (
    frozenset(WORDS[f"of_{what}"].split())
    for what in ("lengths", "turns", "quaternions", "vectors", "poses", "images", "times", "labels")
)
NOISE = frozenset((*WORDS["of_nothing"].split(), *WORD_FRAMES))
"""Words that do not say what a number is; whose it is, is for `sides`."""

UNITS = {unit: unit for unit in MM} | {word: unit for unit, words in WORDS["units"].items() for word in words.split()}
"""Words of a unit of lengths."""

ANGLES = dict.fromkeys(WORDS["degrees"].split(), True) | dict.fromkeys(WORDS["radians"].split(), False)
"""Words of a unit of angles, and whether it is degrees."""

AXIS_WORDS = frozenset("xyzw")
AXES = {"roll": "x", "pitch": "y", "yaw": "z"}
SEQUENCES = (("a", "b", "c"), ("w", "p", "r"), ("o", "a", "t"), ("alpha", "beta", "gamma"), ("phi", "theta", "psi"))
"""Names of three angles in the order of their rotations."""

JOINT_WORDS = frozenset(("joint", "joints", "axis", "j", "q", "theta", "angle", "angles", "jnt"))
"""Before the numbers of six joints."""

JOINTS = (5, 6, 7, 8)
"""So many numbers in sequence, such as q1 to q6, are joints: an orientation has three, four or nine."""

_FRAMES = re.compile(r"[A-Za-z0-9]+_[Tt]_[A-Za-z0-9]+")
_SHORT = re.compile(r"(q|quat|rot|rvec|r|e|euler|t|p|pos|trans|o)([xyzw]|\d)|(pose|tvec|tcp)(\d+)")
_ELEMENT = re.compile(r"(?:[rmt]|mat|rot)([0-4])([0-4])")


@dataclass
class Columns:
    """Where what stands among the named numbers: indices, and what the names say of unit and convention.

    lengths : three; turn: the numbers of the orientation, in their order; by_axis: named after the axes x, y, z.
    joints : six, where there is no pose.
    pose : a whole pose as a list of numbers, instead of the two.
    """

    lengths: list[int] = field(default_factory=list)
    turn: list[int] = field(default_factory=list)
    pose: list[int] = field(default_factory=list)
    joints: list[int] = field(default_factory=list)
    by_axis: bool = False
    convention: Convention | None = None
    unit: LengthUnit | None = None
    scale: float = 1.0
    degrees: bool | None = None
    image: int | None = None
    time: int | None = None
    label: int | None = None
    ignored: list[int] = field(default_factory=list)


def words_of(name: str) -> list[str]:
    """The words of a name in lower case and without accents; letters and Chinese characters side by side are two."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z][a-z])", " ", _FRAMES.sub("", name)).replace("µ", "u").replace("μ", "u")
    plain = "".join(one for one in unicodedata.normalize("NFKD", spaced.lower()) if not unicodedata.combining(one))
    apart = re.sub(r"(?<=[a-z0-9])(?=[\u3040-\u9fff])|(?<=[\u3040-\u9fff])(?=[a-z0-9])", " ", plain)
    words = [word for word in re.split(r"[^\w°#]+|_+", apart) if word]
    return [*words[:-1], "inch"] if len(words) == 2 and words[0] in AXIS_WORDS and words[1] == "in" else words


class _Named:
    """The names sorted into families by their words."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = names
        self.columns = Columns()
        self.slots: dict[Family, dict[str, int]] = {"length": {}, "turn": {}, "pose": {}}
        self.elements: dict[tuple[int, int], int] = {}
        self.plain: dict[str, int] = {}
        self.turn_words: dict[str, set[str]] = {}
        self.unit_of: dict[int, str] = {}
        words = [words_of(name) for name in names]
        self.is_grid = {"00", "22"} <= {one[-1] for one in words if one}
        for index, one in enumerate(words):
            self._take(index, one)
        turn = self.slots["turn"]
        if len(_in_order(turn)) in JOINTS:  # q1 to q6 beside an orientation
            self.slots["turn"] = {slot: index for slot, index in turn.items() if not slot.isdigit()}

    def _take(self, index: int, words: list[str]) -> None:
        units = [word for word in words if word in UNITS or word in ANGLES]
        if len(units) < len(words):
            words = [word for word in words if word not in units or word == words[0]]
        words = [word for word in words if word not in NOISE] or words[-1:] or [""]
        element = _ELEMENT.fullmatch("".join(words[-2:] if len(words) > 1 and words[-1].isdigit() else words[-1:]))
        if element is None and self.is_grid:  # ee_00 to ee_33
            element = re.fullmatch(r"([0-3])([0-3])", words[-1])
        if element is not None:
            self.elements[int(element[1]), int(element[2])] = index
            return
        if len(words) > 1 and words[0] in AXIS_WORDS and {words[-1]} <= LENGTH_WORDS | TURN_WORDS:
            words = [*words[1:], words[0]]  # x_pos, w_rot
        if short := _SHORT.fullmatch(words[-1]):
            words = [*words[:-1], *filter(None, short.groups())]
        slot = AXES.get(words[-1], words[-1])
        before = set(words[:-1]) | ({"rpy"} if words[-1] in AXES else set())
        family: Family | None = None
        if slot in ("x", "y", "z", "w") or slot.isdigit():
            family = self._family(before, slot)
        if family is not None and slot not in self.slots[family]:
            self.slots[family][slot] = index
            if family == "turn":
                self.turn_words[slot] = before
            for unit in units:
                if (unit in ANGLES) == (family == "turn"):
                    self.unit_of[index] = unit
            return
        self._take_plain(index, words, units)

    def _family(self, before: set[str], slot: str) -> Family | None:
        if before & TURN_WORDS or (before == {"o"} and slot in "xyzw"):
            return "turn"
        if before & LENGTH_WORDS or (before <= POSE_WORDS and slot in ("x", "y", "z")):
            return "length"
        return "pose" if before & POSE_WORDS or (not before and slot.isdigit()) else None

    def _take_plain(self, index: int, words: list[str], units: list[str]) -> None:
        word, columns = words[-1], self.columns
        if word in IMAGE_WORDS or (words[0] in IMAGE_WORDS and word not in ("width", "height")):
            columns.image = index if columns.image is None else columns.image
        elif word in TIME_WORDS or words[0] in TIME_WORDS or (word in ("t", "ns") and "t" not in self.plain):
            columns.time = index if columns.time is None else columns.time
            self.plain.setdefault(word, index)
        else:
            if word in LABEL_WORDS and columns.label is None:
                columns.label = index
            self.plain.setdefault(word, index)
            for unit in units:
                if unit in ANGLES:
                    self.unit_of[index] = unit


def recognise_columns(names: Sequence[str], origin: str) -> Columns:
    """The meaning of `names`. Raises DocumentError when they hold no pose."""
    named = _Named(names)
    columns = named.columns
    pose = _in_order(named.slots["pose"])
    if len(pose) in (6, 7, 12, 16):
        columns.pose = pose
    else:
        columns.lengths = _lengths(named)
        _set_turn(columns, named)
    if not columns.pose and not (len(columns.lengths) == 3 and columns.turn):
        columns.joints = joints_of(names)
        columns.lengths, columns.turn = [], []
    texts = [one for one in (columns.image, columns.time, columns.label) if one is not None]
    if {*named.slots["length"]} == {*"xyz"} and len(names) == 3 + len(texts):
        columns.lengths = _lengths(named)  # points of a tip or a ball
    elif not columns.joints and not columns.pose and not columns.turn:
        what = f"no pose among the names {', '.join(names[:12])}" + (" ..." if len(names) > 12 else "")
        fix = "name the numbers x, y, z and qw, qx, qy, qz, or rx, ry, rz, or A, B, C, or W, P, R"
        raise refusal(origin, "header", what, fix)
    if (length := _unit_of(named, columns.lengths, origin)) is not None:
        unit: LengthUnit = "m" if UNITS[length] == "m" else "mm"
        columns.unit, columns.scale = unit, MM[UNITS[length]] / MM[unit]
    if (turn := _unit_of(named, columns.turn, origin)) is not None:
        columns.degrees = ANGLES[turn]
    if columns.joints:
        said = {ANGLES[word] for index in columns.joints for word in words_of(names[index]) if word in ANGLES}
        columns.degrees = said.pop() if len(said) == 1 else None
    used = {*columns.lengths, *columns.turn, *columns.pose, *columns.joints, columns.image, columns.time, columns.label}
    columns.time = None if columns.time in columns.turn else columns.time
    columns.ignored = [index for index in range(len(names)) if index not in used]
    return columns


def text_columns(names: Sequence[str]) -> Columns:
    """Where a picture's name, a time and a label stand, which belong to the poses of both sides."""
    columns = _Named(names).columns
    used = (columns.image, columns.time, columns.label)
    columns.ignored = [index for index in range(len(names)) if index not in used]
    return columns


def joints_of(names: Sequence[str]) -> list[int]:
    """Indices of six joints, numbered in sequence: joint1 to joint6, j1_deg, actual_q_0; [] where there are none."""
    found: dict[str, int] = {}
    for index, name in enumerate(names):
        words = [word for word in words_of(name) if word not in ANGLES]
        numbered = re.fullmatch(r"(\D*?)_*(\d+)", "_".join(words))
        if numbered and set(re.split(r"_+", numbered[1])) & JOINT_WORDS:
            found.setdefault(numbered[2], index)
    listed = _in_order(found)
    return listed if len(listed) == 6 else []


def _unit_of(named: _Named, indices: Sequence[int], origin: str) -> str | None:
    """The unit that the names of these numbers say; None for none. Raises DocumentError where they differ."""
    said = {index: named.unit_of[index] for index in indices if index in named.unit_of}
    meanings = {(UNITS.get(unit), ANGLES.get(unit)) for unit in said.values()}
    if len(meanings) > 1:
        columns = ", ".join(named.names[index] for index in said)
        raise refusal(origin, "header", f"different units in {columns}", "write them in one unit, and name it")
    return next(iter(said.values()), None)


def _in_order(slots: dict[str, int]) -> list[int]:
    """Indices of numbered slots that are consecutive from 0 or 1."""
    numbered = {int(slot): index for slot, index in slots.items() if slot.isdecimal()}  # 00 and 01, too
    numbers, n = sorted(numbered), len(numbered)
    return [numbered[number] for number in numbers] if numbers in ([*range(n)], [*range(1, n + 1)]) else []


def _lengths(named: _Named) -> list[int]:
    slots = named.slots["length"]
    if {"x", "y", "z"} <= set(slots):
        return [slots[axis] for axis in "xyz"]
    if len(listed := _in_order(slots)) == 3:
        return listed
    base = 1 if (4, 4) in named.elements or ((3, 3) in named.elements and (0, 0) not in named.elements) else 0
    return [named.elements[row + base, 3 + base] for row in range(3) if (row + base, 3 + base) in named.elements]


def _set_turn(columns: Columns, named: _Named) -> None:
    slots = named.slots["turn"]
    words = set().union(*(named.turn_words[slot] for slot in slots))
    listed = _in_order(slots)
    if set("xyz") <= set(slots) and words & QUATERNION_WORDS and "w" in named.plain and "w" not in slots:
        slots = slots | {"w": named.plain["w"]}
    if set("xyzw") <= set(slots):
        columns.turn = [slots[axis] for axis in "wxyz"]
        columns.convention = CONVENTIONS["quaternion-wxyz"]
    elif set("xyz") <= set(slots) and not words & QUATERNION_WORDS:
        columns.turn, columns.by_axis = [slots[axis] for axis in "xyz"], not words & VECTOR_WORDS
        columns.convention = CONVENTIONS["rotation-vector"] if words & VECTOR_WORDS else None
    elif len(listed) == 4:
        columns.turn = listed
        for order in ("wxyz", "xyzw"):
            if order in words:
                columns.convention = CONVENTIONS[f"quaternion-{order}"]
    elif len(listed) in (3, 9):
        columns.turn = listed
        if len(listed) == 3 and words & VECTOR_WORDS:
            columns.convention = CONVENTIONS["rotation-vector"]
    elif elements := _elements(named.elements):
        columns.turn, columns.convention = elements, CONVENTIONS["matrix"]
    else:
        for sequence in SEQUENCES:
            if all(name in named.plain for name in sequence):
                columns.turn = [named.plain[name] for name in sequence]
                break


def _elements(elements: dict[tuple[int, int], int]) -> list[int]:
    for base in (0, 1):
        wanted = [(row + base, column + base) for row in range(3) for column in range(3)]
        if all(place in elements for place in wanted) and (base or (4, 4) not in elements):
            return [elements[place] for place in wanted]
    return []

"""Rows of numbers, named or not, to a table of poses: what CSV, JSON, YAML and NPY have in common.

A name is split into words. Its last word says the axis or the position in a list; the others say whether it is a
length, an orientation, a matrix, a picture, a time or a label. Units in a name count: `x_mm`, `rx [deg]`. Without names
the number of columns says what stands there: 6, 7, 8 (with a time), 12 or 16.
"""

import contextlib
import re
import unicodedata
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import product
from typing import Any, Literal

import numpy as np

from calibration.documents.imports.pose_table import MAX_ANGLE_DEG, NAMED, PoseTable, table_of_arrays, table_of_matrices
from calibration.documents.imports.refusal import MAX_POSES, refusal
from calibration.documents.imports.sides import MIN_PAIRS, WORDS, best_split, build_by_sides, choose_frame, relation_of
from calibration.errors import DocumentError
from calibration.kinematics.conventions import CONVENTIONS, MM, Convention, LengthUnit
from calibration.transforms import QUATERNION_NORM_TOLERANCE, Array

Family = Literal["length", "turn", "pose"]

LENGTH_WORDS, TURN_WORDS, QUATERNION_WORDS, VECTOR_WORDS, POSE_WORDS, IMAGE_WORDS, TIME_WORDS, LABEL_WORDS = (
    frozenset(WORDS[f"of_{what}"].split())
    for what in ("lengths", "turns", "quaternions", "vectors", "poses", "images", "times", "labels")
)
UNITS = {unit: unit for unit in MM} | {word: unit for unit, words in WORDS["units"].items() for word in words.split()}
"""Words of a unit of lengths."""

ANGLES = dict.fromkeys(WORDS["degrees"].split(), True) | dict.fromkeys(WORDS["radians"].split(), False)
"""Words of a unit of angles, and whether it is degrees."""

AXIS_WORDS = frozenset("xyzw")
AXES = {"roll": "x", "pitch": "y", "yaw": "z"}
SEQUENCES = (("a", "b", "c"), ("w", "p", "r"), ("o", "a", "t"), ("alpha", "beta", "gamma"), ("phi", "theta", "psi"))
"""Names of three angles in the order of their rotations."""

NOISE = frozenset(" ".join((WORDS["of_nothing"], *WORDS["frames"].values())).split())
"""Words that do not say what a number is; whose it is, is for `sides`."""

BLANKS = ("", "-", "None", "null", "N/A")
JOINT_WORDS = frozenset(("joint", "joints", "axis", "j", "q", "theta", "angle", "angles", "jnt"))
"""Before the numbers of six joints."""

JOINTS = (5, 6, 7, 8)
"""So many numbers in sequence, such as q1 to q6, are joints: an orientation has three, four or nine."""

_FRAMES = re.compile(r"[A-Za-z0-9]+_[Tt]_[A-Za-z0-9]+")
_SHORT = re.compile(r"(q|quat|rot|rvec|r|e|euler|t|p|pos|trans|o)([xyzw]|\d)|(pose|tvec|tcp)(\d+)")
_EGM = {f"u{at}": f"q{axis}" for at, axis in enumerate("wxyz")}  # EgmQuaternion of ABB's egm.proto
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
        base = int((4, 4) in self.elements or ((3, 3) in self.elements and (0, 0) not in self.elements))
        self.elements = {(row - base, column - base): at for (row, column), at in self.elements.items()}
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
        words = [*words[:-1], _EGM.get(words[-1], words[-1])]
        if short := _SHORT.fullmatch(words[-1]):
            words = [*words[:-1], *filter(None, short.groups())]
        slot = AXES.get(words[-1], words[-1])
        before = set(words[:-1]) | ({"rpy"} if words[-1] in AXES else set())
        family = self._family(before, slot) if slot in ("x", "y", "z", "w") or slot.isdigit() else None
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
    columns.time = None if columns.time in columns.turn else columns.time
    return columns


def text_columns(names: Sequence[str]) -> Columns:
    """Where a picture's name, a time and a label stand, which belong to the poses of both sides."""
    return _Named(names).columns


def joints_of(names: Sequence[str]) -> list[int]:
    """Indices of six joints, numbered in sequence: joint1 to joint6, j1_deg, actual_q_0; [] where there are none."""
    found: dict[str, int] = {}
    for index, name in enumerate(names):
        numbered = re.fullmatch(r"(\D*?)_*(\d+)", "_".join(word for word in words_of(name) if word not in ANGLES))
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
    return [named.elements[row, 3] for row in range(3) if (row, 3) in named.elements]


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
    elif len(listed) in (3, 4, 9):
        said = [f"quaternion-{order}" for order in ("wxyz", "xyzw") if len(listed) == 4 and order in words]
        said += ["rotation-vector"] if len(listed) == 3 and words & VECTOR_WORDS else []
        columns.turn, columns.convention = listed, CONVENTIONS[said[-1]] if said else None
    elif {*product(range(3), range(3))} <= {*named.elements}:
        columns.turn = [named.elements[place] for place in product(range(3), range(3))]
        columns.convention = CONVENTIONS["matrix"]
    else:
        sequence = next((names for names in SEQUENCES if {*names} <= {*named.plain}), ())
        columns.turn = [named.plain[name] for name in sequence]


Cell = float | str

WIDTHS = "6 (x, y, z and three angles), 7 (x, y, z and a quaternion), 8 (with a time before), 12 or 16 (a matrix)"

_GAP = r"[-_.:/ ]?"
_YEAR_FIRST = rf"(?P<year>(?:19|20)\d{{2}}){_GAP}(?P<month>\d{{2}}){_GAP}(?P<day>\d{{2}})"
_DAY_FIRST = r"(?P<day>\d{1,2})\.(?P<month>\d{1,2})\.(?P<year>(?:19|20)\d{2})"
_CLOCK = rf"(?P<hour>\d{{2}}){_GAP}(?P<minute>\d{{2}}){_GAP}(?P<second>\d{{2}})(?:[._,-]?(?P<fraction>\d{{1,9}}))?"
_ZONE = r"(?P<zone>Z|[+-]\d{2}:?\d{2})?"
_FORMS = tuple(re.compile(rf"(?<!\d){date}[T_\- ]?{_CLOCK}(?!\d){_ZONE}") for date in (_YEAR_FIRST, _DAY_FIRST))
"""Date and time in texts: `2026-11-22T10:15:02.118Z`, `22.11.2026 10:15:02`, and `IMG_20261122_101502` in names."""


def table_of_columns(origin: str, names: Sequence[str], rows: Sequence[Sequence[Cell]]) -> PoseTable:
    """The table of rows with named columns, with the camera's poses where they name both. Raises DocumentError."""
    if len(rows) > MAX_POSES:
        raise refusal(origin, "rows", f"{len(rows)}, where {MAX_POSES} are read", "give one for each picture")
    return table_of_sides(origin, names, [*zip(*rows, strict=True)], table_of_one_side)


Named = Callable[[str, Sequence[str], Sequence[Sequence[Any]]], PoseTable]  # makes a table of named columns of one side


def table_of_sides(origin: str, names: Sequence[str], columns: Sequence[Sequence[Any]], build: Named) -> PoseTable:
    """What `build` makes of the columns (numbers, texts, arrays) of each side, or pairs of points. DocumentError."""

    def of_columns(at: Sequence[int], called: Sequence[str]) -> PoseTable:
        return _both_sides(origin, [called[one] for one in at], [columns[one] for one in at], build)

    return choose_frame(origin, names, columns, of_columns)


def _both_sides(origin: str, names: Sequence[str], columns: Sequence[Sequence[Any]], build: Named) -> PoseTable:
    stems = [re.sub(r"\.1$", "", name) for name in names]  # pandas calls the second x x.1
    if sum(stems.count(one) == 2 for one in stems) >= 12:
        names = [f"{'ab'[one in stems[:at]]}_{one}" if stems.count(one) == 2 else one for at, one in enumerate(stems)]
    letters = {name[0].lower() for name in names if name[1:2] == "_"}
    if "c" in letters and letters - {"c"} in ({"w"}, {"r"}, {"b"}):  # C_X beside W_X, R_X or B_X
        names = [f"{'camera' if n[0] in 'cC' else 'robot'}{n[1:]}" if n[1:2] == "_" else n for n in names]
    found = text_columns(names)
    shared = [at for at in (found.image, found.time, found.label) if at is not None and np.ndim(columns[at][0]) == 0]
    sides = [None if at in shared or one is None else one.side for at, one in enumerate(map(relation_of, names))]
    seen = [column for side, column in zip(sides, columns, strict=True) if side == "camera"]
    blind = [  # where nothing was detected: blanks, NaN, zeros, the identity
        all(cell in BLANKS if isinstance(cell, str) else np.all(np.isnan(cell) | np.isin(cell, (0, 1))) for cell in row)
        for row in zip(*seen, strict=True)
    ]
    if "robot" in sides and sum(np.size(column[0]) for column in seen) >= 6 and 0 < 2 * sum(blind) < len(blind):
        left = [[cell for cell, out in zip(column, blind, strict=True) if not out] for column in columns]
        rows = ", ".join(str(at) for at, out in enumerate(blind, 1) if out)
        table = _both_sides(origin, names, left, build)
        return replace(table, notes=(*table.notes, f"without a pose of the camera, and left out: rows {rows}"))
    points = _point_pairs(origin, names, columns)
    groups: dict[str, dict[str, int]] = {}
    for index, name in enumerate(names):
        groups.setdefault(name.partition("_")[0], {})[name.partition("_")[2]] = index
    both = [group for group in groups.values() if len(group) >= 6]  # h_x to h_rz, and e_x to e_rz
    if len(both) == 2 and both[0].keys() == both[1].keys() and not any(map(relation_of, names)):
        with contextlib.suppress(DocumentError):
            one, other = (
                build(origin, [*own, *(names[at] for at in shared)], [columns[at] for at in (*own.values(), *shared)])
                for own in both
            )
            if (split := best_split([(one, other)])) is not None:
                return split
    try:
        built = build_by_sides(
            names, shared, lambda at: build(origin, [names[one] for one in at], [columns[one] for one in at])
        )
    except DocumentError:
        if points is None:
            raise
        return points
    used = built.layout.replace(",", " ").split()
    apart = points is not None and built.camera is None and not {*points.layout.split()[1:]} & {*used}
    return points if points is not None and apart else built  # p_robot and p_cam beside the robot's pose


def _point_pairs(origin: str, names: Sequence[str], columns: Sequence[Sequence[Any]]) -> PoseTable | None:
    """The robot's points with the camera's, where the names of each side give three numbers; else None."""
    found = []
    for side in ("robot", "camera"):
        said = [relation_of(name) for name in names]
        own = [at for at, one in enumerate(said) if one is not None and one.side == side and not one.weak]
        axes = [(words_of(names[at]) or [""])[-1] for at in own]
        own = [own[axes.index(axis)] for axis in "xyz"] if sorted(axes) == ["x", "y", "z"] else own
        own = own if len(own) == 3 else [at for at in own if np.shape(columns[at][0]) == (3,)]
        try:  # of lists of other lengths and texts there are none
            points = np.column_stack([np.array(columns[at], float) for at in own])
        except ValueError:
            return None
        if points.ndim != 2 or points.shape[1] != 3:
            return None
        layout = f"points {', '.join(names[at] for at in own)}"
        found.append(table_of_arrays(origin, (), points, points[:, 3:], layout, "points", frame="base_T_flange"))
    return replace(found[0], side="robot", camera=replace(found[1], side="camera"))


def table_of_one_side(origin: str, names: Sequence[str], cells: Sequence[Sequence[Cell]]) -> PoseTable:
    """The table of columns of cells with names, whosever they are. Raises DocumentError."""
    columns = recognise_columns(names, origin)
    numbers = [*columns.lengths, *columns.turn, *columns.pose, *columns.joints]
    for index in numbers:
        for at, cell in enumerate(cells[index], 1):
            if isinstance(cell, str):
                what = f"{cell[:40]!r} is no number" if cell else "empty"
                raise refusal(origin, f"row {at}, {names[index]}", what, "correct it")
    values = np.column_stack([np.array(cells[index], float) for index in numbers])
    values[:, : len(columns.lengths)] *= columns.scale
    layout = NAMED + ", ".join(names[index] for index in numbers[:8]) + (" ..." if len(numbers) > 8 else "")
    if columns.joints:
        unit = None if columns.degrees is None else CONVENTIONS["joints" if columns.degrees else "joints-rad"]
        table = replace(table_of_joints(origin, (), values, layout), convention=unit)
    elif columns.pose or not columns.turn:
        table = table_of_rows(origin, values, [str(at + 1) for at in range(len(values))], layout)
    else:
        said = columns.convention.name if columns.convention else ""
        said += "-deg" if said == "rotation-vector" and columns.degrees else ""
        table = table_of_arrays(origin, (), values[:, :3], values[:, 3:], layout, said, by_axis=columns.by_axis)
    table = replace(table, layout=layout, unit=table.unit or columns.unit).checked()
    if columns.unit is not None:
        table.require_reach(columns.unit, "header")
    return with_names(table, columns, names, cells)


def with_names(table: PoseTable, columns: Columns, names: Sequence[str], cells: Sequence[Sequence[Cell]]) -> PoseTable:
    """The table with the labels, pictures and times of the columns of cells, and a note of those that are not used."""
    used = {*columns.lengths, *columns.turn, *columns.pose, *columns.joints, columns.image, columns.time, columns.label}
    ignored = [name for index, name in enumerate(names) if index not in used]
    images, times, labels = table.images, table.times_s, table.labels
    if columns.image is not None and all(isinstance(cell, str) for cell in cells[columns.image]):
        images = tuple(str(cell).strip() for cell in cells[columns.image])
    if columns.time is not None:
        seconds = [cell if isinstance(cell, float) else seconds_of(cell) for cell in cells[columns.time]]
        times = times if any(one is None for one in seconds) else np.array(seconds, float)
    for index in (one for one in (columns.image, columns.label) if one is not None):  # the later one counts
        named = tuple(
            str(int(cell) if isinstance(cell, float) and cell.is_integer() and abs(cell) < 1e15 else cell).strip()
            for cell in cells[index]
        )
        labels = named if len(set(named)) == len(named) else labels
    notes = (f"not used: {', '.join(ignored)}",) if ignored else ()
    return replace(table, labels=labels, images=images, times_s=times, notes=(*table.notes, *notes))


def table_of_joints(origin: str, labels: Sequence[str], joints: Array, layout: str) -> PoseTable:
    """The table of joints (n, 6), from which poses follow when the arm is known."""
    said: dict[str, Any] = {"unit": "mm", "frame": "base_T_flange"}
    return table_of_arrays(origin, labels, np.zeros((len(joints), 3)), joints, f"joints: {layout}", **said)


def table_of_rows(origin: str, rows: Array, labels: Sequence[str] | None = None, layout: str = "") -> PoseTable:
    """The table of rows (n, k) without names. Raises DocumentError for a number of columns that is no pose."""
    rows = np.asarray(rows, float)
    width, names = rows.shape[1], tuple(labels or (str(at + 1) for at in range(len(rows))))
    of_pose = width == 7 and _unit_norms(rows[:, 3:])
    if width in (7, 13, 17) and not of_pose and _counts(rows[:, 0]):
        names, rows, width = tuple(str(int(number)) for number in rows[:, 0]), rows[:, 1:], width - 1
    said = layout or f"{width} numbers a row"
    if width == 16:
        return table_of_matrices(origin, names, rows.reshape(-1, 4, 4), said)
    if width == 12:  # 3 x 4, or nine numbers of the rotation beside the translation: what is a rotation decides
        matrices = rows.reshape(-1, 3, 4)
        if are_rotations(matrices[:, :, :3]):
            return table_of_matrices(origin, names, matrices, said)
        for turn, length in ((rows[:, :9], rows[:, 9:]), (rows[:, 3:], rows[:, :3])):
            if are_rotations(turn.reshape(-1, 3, 3)):
                return table_of_arrays(origin, names, length, turn, said)
        if (both := _halves(origin, rows, names)) is not None:
            return both
        raise refusal(origin, "pose 1", "twelve numbers without a rotation matrix among them", f"give {WIDTHS}")
    times = None
    if width == 8 and _unit_norms(rows[:, 4:]):
        times, rows, width = rows[:, 0], rows[:, 1:], 7
        names = names if labels else tuple(f"{time:.9g}" for time in times)
    if width in (14, 24, 32) and (both := _halves(origin, rows, names)) is not None:
        return both
    if width == 3:
        return table_of_arrays(origin, names, rows, np.empty((len(rows), 0)), said, "points")
    if width not in (6, 7):
        raise refusal(origin, "rows", f"{width} numbers a row without names", f"give {WIDTHS}, or a header")
    notes: tuple[str, ...] = ()
    first, last = np.abs(rows[:, :3]).max(), np.abs(rows[:, 3:]).max()
    if (last > MAX_ANGLE_DEG >= first) if width == 6 else (_unit_norms(rows[:, :4]) and not _unit_norms(rows[:, 3:])):
        notes = ("the orientation stands before the place: the rows' last three numbers can be no orientation",)
        rows = np.concatenate([rows[:, width - 3 :], rows[:, : width - 3]], axis=1)
    if width == 7 and not _unit_norms(rows[:, 3:]):
        norm = float(np.linalg.norm(rows[0, 3:]))
        what = f"seven numbers a row, of which the last four have norm {norm:.4g}, not 1"
        raise refusal(origin, "pose 1", what, "give a quaternion of norm 1, or a header that says what stands there")
    return table_of_arrays(origin, names, rows[:, :3], rows[:, 3:], said, times_s=times, notes=notes)


def _halves(origin: str, rows: Array, labels: Sequence[str]) -> PoseTable | None:
    """The robot's and the camera's pose side by side in each row, whose rotations agree; None where they do not.

    Raises DocumentError for halves that are no poses.
    """
    splits = []
    for shift in (0, 3) if rows.shape[1] == 12 else (0,):  # a place before its angles, or behind them
        halves = [np.roll(half, shift, axis=1) for half in np.split(rows, 2, axis=1)]
        splits.append((table_of_rows(origin, halves[0], labels), table_of_rows(origin, halves[1], labels)))
    return best_split(splits) if len(rows) >= MIN_PAIRS else None


def _counts(column: Array) -> bool:
    """Whether a column counts up in whole numbers."""
    return bool(np.all(column == np.round(column)) and np.all(np.diff(column) > 0) and np.all(np.abs(column) < 1e9))


def _unit_norms(numbers: Array) -> bool:
    return bool(np.all(np.abs(np.linalg.norm(numbers, axis=1) - 1) <= 2 * QUATERNION_NORM_TOLERANCE))


def are_rotations(matrices: Array) -> bool:
    """Whether all of (n, 3, 3) are rotations, about."""
    with np.errstate(over="ignore", invalid="ignore"):
        squares = matrices @ np.swapaxes(matrices, 1, 2)
    return bool(np.all(np.abs(squares - np.eye(3)) < 0.02))


def seconds_of(text: str) -> float | None:
    """Seconds since 1970 of the first date with a time in a text, in UTC where no zone is said; None without one."""
    found = next((match for form in _FORMS if (match := form.search(text))), None)
    if found is None:
        return None
    parts = [int(found[part]) for part in ("year", "month", "day", "hour", "minute", "second")]
    with contextlib.suppress(ValueError):
        moment = datetime(*parts, tzinfo=datetime.strptime(found["zone"] or "Z", "%z").tzinfo)  # type: ignore[arg-type,misc]
        return moment.timestamp() + float(f"0.{found['fraction'] or 0}")
    return None

"""Robot programs and poses that name each number: RAPID; KUKA's {X 1, Y 2, ... A 4}, Fanuc's X = 1 mm ... R = 6 deg,
UR's p[...], pendants, and HALCON's pose files (.dat), as write_pose writes them.

Of a program only numbers are read. A value of RAPID with an expression is refused by its name: without it, every later
pose would stand beside another picture.
"""

import math
import re
from bisect import bisect, bisect_left
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import reduce
from itertools import chain

import numpy as np

from calibration.documents.imports.leaves import NO_AXIS
from calibration.documents.imports.number_tables import table_of_columns, table_of_joints
from calibration.documents.imports.pose_table import PoseTable, table_of_arrays
from calibration.documents.imports.refusal import decode, refusal
from calibration.documents.imports.sides import MIN_PAIRS, WORDS
from calibration.errors import GeometryError
from calibration.kinematics.conventions import CONVENTIONS
from calibration.problem import PosesOf
from calibration.transforms import Array, inverse, quaternion_from_rotation, transform_from_quaternion

_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_UR = re.compile(rf"(?:(\w+)\s*=\s*)?p\s*\[\s*({_NUMBER}(?:\s*,\s*{_NUMBER}){{5}})\s*\]")
_MOVE = re.compile(r"\b(?:movej|movel|movep|movec|servoj|get_inverse_kin)\s*\(", re.IGNORECASE)
_NAME = re.compile(r"\s*(\w+)")
_SET_TOOL = re.compile(rf"\bset_tcp\s*\(\s*(?:(\w+)\s*[,)]|p\s*\[\s*({_NUMBER}(?:\s*,\s*{_NUMBER}){{5}})\s*\])")
_OFFSET = re.compile(r"\b(pose_trans|pose_add|interpolate_pose)\s*\(")
_LIST = re.compile(
    rf"\b([A-Za-z]\w{{0,13}}(?: \(\w+\))?)\s*[=:]?\s*[\[(]\s*({_NUMBER}(?:[\s,;]+{_NUMBER}){{2,15}})\s*[\])]"
)
_LISTED = re.compile(rf"(.*?[\[(=]\s*)({_NUMBER}(?:\s*,\s*{_NUMBER}){{5,15}})\s*(?:[\])].*)?$")
_NULL_FRAME = r"\$|\s|\w+\s*\[\s*0\s*\]"  # $NULLFRAME, BASE_DATA[0]
_FRAMES = re.compile(
    rf"\b(UF|UT|TOOL_NO|BASE_NO)\s*[: =]\s*([1-9]\d*|F\b)|\$(TOOL|BASE)\s*=\s*(?!{_NULL_FRAME})([^\n;]+)"
)
_OF_TOOL = re.compile("UT|TOOL")  # TOOL_NO, $TOOL
_COMMA_NUMBER = r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?"
_PAIR = re.compile(
    rf"\b([A-Za-z][A-Za-z0-9_]{{0,19}})\s*[=:\s]\s*({_COMMA_NUMBER}|{_NUMBER})\s*(mm|m|deg|°|rad)?"
    r"(?=[\s;}\]]|,(?!\d)|$)"
)

MAX_LISTS = 8  # lists of numbers that a record of a log has
KEYS = tuple(tuple(keys.split()) for keys in WORDS["poses"])
"""The numbers of a pose, in the order in which they are written."""

HALCON_ORDERS = {0: "euler-XYZ", 2: "euler-xyz", 4: "rotation-vector"}
"""By HALCON's `f`, the sum of 1 (view: coordinate system), 2 (abg), 4 (Rodrigues), 8 (R(p-T)): MVTec, create_pose.
gba is R = Rx Ry Rz, abg is R = Rz Ry Rx, both in degrees; the translation is in metres."""


def read_keyed_text(content: bytes, origin: str) -> PoseTable:
    """The poses of a text that names each number. Raises DocumentError."""
    text = decode(content, origin)
    if _UR.search(text):
        return _universal_robots(origin, text)
    text = _LIST.sub(_as_pairs, text.partition("\n/POS")[2] or text)  # of Fanuc's programs the positions
    used = sorted({" ".join(filter(None, match)) for match in _FRAMES.findall(text)})
    of_tool, of_base = (
        ", ".join(one for one in used if bool(_OF_TOOL.match(one)) == is_tool) for is_tool in (True, False)
    )
    poses_of = PosesOf(of_tool, of_base) if used else None
    found: dict[str, list[float]] = {}
    units: set[str] = set()
    pairs = _PAIR.findall(text)
    if {mark for _, number, _ in pairs for mark in ",." if mark in number} == {",", "."}:
        raise refusal(origin, "text", "some numbers have a comma, others a point", "write decimals with one of them")
    for key, number, unit in pairs:
        found.setdefault(key.upper(), []).append(float(number.replace(",", ".")))
        units |= {unit} - {""}
    by_keys: dict[tuple[str, ...], list[int]] = {keys: [len(found.get(key, [])) for key in keys] for keys in KEYS}
    uneven = {keys: counts for keys, counts in by_keys.items() if all(counts) and len({*counts}) > 1}
    most = max(map(len, found.values()), default=0)
    by_keys[tuple(key for key, numbers in found.items() if len(numbers) == most)] = [] if uneven else [most]
    for keys, counts in by_keys.items():
        if any(counts) and len({*counts}) == 1:
            names = [f"{key} mm" if key in "XYZ" and "mm" in units else key for key in keys]
            rows = zip(*(found[key] for key in keys), strict=True)
            table = table_of_columns(origin, names, [list(row) for row in rows])
            return table if table.kind == "joints" else replace(table, poses_of=poses_of)
    for keys, counts in uneven.items():
        counted = ", ".join(f"{count} {key}" for key, count in zip(keys, counts, strict=True))
        fix = "give every pose all numbers, and remove tools and bases"
        raise refusal(origin, "text", f"not as many of every number: {counted}", fix)
    raise refusal(origin, "text", "no poses in it", "give X, Y, Z with A, B, C, W, P, R or q1 to q4, or a table")


def lists_in_lines(text: str) -> dict[str, list[list[float]]]:
    """The numbers that each line has in brackets or behind `=`, by the words before them: those of a log, of
    `P1 = XY(...) /L1`, of `P000=...`. {} where lines that begin with the same words have other numbers, or none."""
    found: dict[str, list[list[float]]] = {}
    begun = [re.sub(r"\d+", "0", line) for line in text.splitlines()]
    for listed in filter(None, map(_LISTED.match, text.splitlines())):
        found.setdefault(re.sub(r"\d+", "0", listed[1]), []).append([float(number) for number in listed[2].split(",")])
    named = {" ".join(re.findall("[A-Za-z]+", words)) or "pose": rows for words, rows in found.items()}
    if not len(named) == len(found) <= MAX_LISTS:
        return {}
    counts = {len(rows) for rows in named.values()} | {sum(line.startswith(one) for line in begun) for one in found}
    widths = [len({*map(len, rows)}) for rows in named.values()]
    return named if len(counts) == 1 and min(counts) >= MIN_PAIRS and max(widths) == 1 else {}


def _as_pairs(listed: re.Match[str]) -> str:
    """`Q=[1, 0, 0, 0]` as Q1=1 Q2=0 Q3=0 Q4=0, and `rvec: [...]` as rvec_1=... of lists with longer names."""
    key = listed[1] if len(listed[1]) == 1 else re.sub(r"\W+", "_", f"{listed[1]}_")
    return " ".join(f"{key}{at}={number}" for at, number in enumerate(re.split(r"[\s,;]+", listed[2]), 1))


def _universal_robots(origin: str, text: str) -> PoseTable:
    """The poses to which a program moves, or all poses of a list. Raises DocumentError for poses that it computes."""
    text = re.sub(r"#.*", "", text)
    named = {match[1]: match for match in _UR.finditer(text) if match[1]}
    tool = _SET_TOOL.search(text)
    if _MOVE.search(text):
        if offset := _OFFSET.search(text):
            what = f"poses that the program computes ({offset[1]})"
            raise refusal(origin, "text", what, "write the poses to which it moves as p[...]", "robot-poses")
        goals = (_UR.match(text, move.end()) or _NAME.match(text, move.end()) for move in _MOVE.finditer(text))
        known_goals = (goal if goal.re is _UR else named.get(goal[1]) for goal in goals if goal)
        found = [(goal[1] or "", goal[2]) for goal in known_goals if goal]
    else:
        found = [(match[1] or "", match[2]) for match in _UR.finditer(text) if tool is None or match[1] != tool[1]]
        found = [one for one in found if tool is None or one[1] != tool[2]]
    if not found:
        raise refusal(origin, "text", "no pose p[...] to which the program moves", "write them, or a list of p[...]")
    rows: Array = np.array([[float(number) for number in numbers.split(",")] for _, numbers in found])
    labels = [name or str(at + 1) for at, (name, _) in enumerate(found)]
    labels = labels if len(set(labels)) == len(labels) else []
    said = "p[x, y, z, rx, ry, rz] of URScript", "rotation-vector"
    table = table_of_arrays(origin, labels, rows[:, :3], rows[:, 3:], *said, unit="m")
    if tool is None:
        return table
    known = named.get(tool[1] or "")
    numbers = tool[2] or (known and known[2])
    called = f"{tool[1] or 'set_tcp'} p[{numbers or 'not read as numbers'}]"
    if numbers is None or len(_SET_TOOL.findall(text)) > 1:
        return replace(table, poses_of=PosesOf(called))
    offsets = np.array([[float(number) for number in numbers.split(",")]] * len(table))
    notes = (f"the flange's poses are those of the program and of its tool {called} (m, rad)",) if offsets.any() else ()
    return replace(table, offsets=offsets, notes=notes)


def read_halcon_pose(content: bytes, origin: str) -> PoseTable:
    """The pose of a .dat file. Raises DocumentError, also for intrinsics."""
    text = decode(content, origin)
    rows = dict(re.findall(r"^\s*([frt])\s+(.+?)\s*$", text, re.MULTILINE))
    if "r" not in rows or "t" not in rows:
        what = "intrinsics, no pose" if "ParGroup" in text else "no lines r and t"
        raise refusal(origin, "text", what, "give a file of write_pose", "halcon")
    try:
        code = int(rows.get("f", "0"))
        turn, length = (np.array([[float(number) for number in rows[key].split()]]) for key in ("r", "t"))
    except ValueError:
        raise refusal(origin, "text", "a number is damaged", "write the pose again", "halcon") from None
    if turn.shape != (1, 3) or length.shape != (1, 3) or code & 9 or code not in HALCON_ORDERS:
        what = f"representation {code} of {turn.shape[1]} and {length.shape[1]} numbers is not read"
        raise refusal(origin, "f", what, "convert it: convert_pose_type(Pose, 'Rp+T', 'gba', 'point')", "halcon")
    if code == 4:
        length_of = np.linalg.norm(turn)  # the tangent of half the angle
        turn = turn * (2 * np.arctan(length_of) / length_of if length_of > 0 else 2.0)
    layout = f"a pose of HALCON, representation {code}"
    return table_of_arrays(origin, "1", length, turn, layout, HALCON_ORDERS[code], unit="m")


_TEXT_OR_COMMENT = re.compile(r'("[^"\n]*")|!.*')
_WRITTEN = re.compile(r"\s*[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?\s*")
_CELL = r"[^][,;]*"
_POSE = re.compile(rf"\[\s*\[({_CELL}(?:,{_CELL}){{2}})\]\s*,\s*\[({_CELL}(?:,{_CELL}){{3}})\]")
_EXTAX = re.compile(rf"\s*,\s*\[[^][]*\]\s*,\s*\[({_CELL}(?:,{_CELL}){{5}})\]")
_JOINTS = re.compile(rf"\[\s*\[({_CELL}(?:,{_CELL}){{5}})\]\s*,\s*\[{_CELL}(?:,{_CELL}){{5}}\]\s*\]")
_DATA = re.compile(
    r"\b(?:CONST|PERS|VAR)\s+(?P<kind>\w+)\s+(?P<name>\w+)\s*(?:\{(?P<sizes>[^}]*)\})?\s*:=(?P<value>[^;]*)",
    re.IGNORECASE,
)
_RAPID_MOVE = re.compile(r"\bMove[CJL]\w*\s*(\[\s*\[[^][]*\]\s*,\s*\[[^;]*)", re.IGNORECASE)
_TARGET = re.compile(r"\b(?:CONST|PERS|VAR)\s+(?:robtarget|pose)\s+(\w+)", re.IGNORECASE)
_ASSIGNED = re.compile(r"(?<![\w.])(\w+)(?:\{[^}]*\})?(?:\.\w+)*\s*:=", re.IGNORECASE)
_SHIFTING = re.compile(r"\b(?:PDisp|EOffs)(?:Set|On)\b", re.IGNORECASE)
_COMPUTED = re.compile(rf"\b(?:Offs|RelTool|CRobT|CalcRobT)\s*\(|{_SHIFTING.pattern}", re.IGNORECASE)
_MOVED = re.compile(r"\bMove([CJL])", re.IGNORECASE)
_WOBJ = re.compile(r"\\\s*WObj\s*:=\s*(\w+\s*(?:\{[^}]*\})?)", re.IGNORECASE)
_WITHIN = re.compile(r"\[[^][]*\]|\([^()]*\)|\\(?:\{[^{}]*\}|[^,{])*")  # brackets and options of an instruction
_TOOL_LAST = re.compile(r"\\\s*WObj\b|\b(?:Trigg|Search)[CJL]\b", re.IGNORECASE)
_TYPES = frozenset(("robtarget", "pose"))
_FRAME = rf"\s*,\s*{_POSE.pattern}\s*\]"
_FRAME_DATA = re.compile(
    rf"\b(?:tool|wobj)data\s+(\w+)\s*:=\s*\[\s*(?:FALSE\s*,\s*TRUE\s*,\s*\"[^\"\n]*\"(?:{_FRAME}){{2}}|TRUE{_FRAME})",
    re.I,
)


def read_rapid(content: bytes, origin: str) -> PoseTable:
    """The robtargets and poses of a text in RAPID, in its order. Raises DocumentError."""
    text = _TEXT_OR_COMMENT.sub(lambda one: one[1] or "", decode(content, origin))
    data = [*_DATA.finditer(text)]
    found = [(match, _declared(match.start(), data)) for match in _POSE.finditer(text)]
    # Without those of tools and work objects.
    found = [(match, one) for match, one in found if one is None or one["kind"].lower() in _TYPES]
    _require_values(origin, text, data, [match.start() for match, _ in found])
    labels, counts = list[str](), Counter[str]()
    lengths, turns, axes = [], [], []
    for match, one in found:
        name = one["name"] if one else ""
        counts[name] += one is not None
        array = counts[name] > 1 or (one is not None and one["sizes"] is not None)
        labels.append((f"{name}{{{counts[name]}}}" if array else name) or str(len(labels) + 1))
        lengths.append(_numbers(origin, labels[-1], match[1]))
        turns.append(_numbers(origin, labels[-1], match[2]))
        behind = _EXTAX.match(text, match.end() - 1) or _EXTAX.match(text, match.end())
        axes.append(_numbers(origin, labels[-1], behind[1]) if behind else [9e9] * 6)
    if not labels:
        listed = [(match, _declared(match.start(), data)) for match in _JOINTS.finditer(text)]
        listed = [(match, one) for match, one in listed if one is None or one["kind"].lower() == "jointtarget"]
        names = [one["name"] if one is not None else str(at) for at, (_, one) in enumerate(listed, 1)]
        joints = [_numbers(origin, name, match[1]) for name, (match, _) in zip(names, listed, strict=True)]
        if joints:
            table = table_of_joints(origin, names, np.array(joints), f"{len(joints)} jointtargets of RAPID")
            return replace(table, convention=CONVENTIONS["joints"])
        named = re.search(r"\bjointtarget\b", text, re.IGNORECASE)
        what = "joint targets that are not read as numbers" if named else "no robtarget and no pose in it"
        raise refusal(origin, "text", what, "give robtargets: [[x, y, z], [q1, q2, q3, q4], ...]", "rapid")
    layout = f"{len(labels)} robtargets or poses of RAPID"
    external = np.where(np.abs(axes) > NO_AXIS, np.nan, axes)
    table = table_of_arrays(
        origin, labels, np.array(lengths), np.array(turns), layout, "quaternion-wxyz", unit="mm",
        frame="base_T_flange", notes=_notes(text), external_axes=external,
    )  # fmt: skip
    return _of_flange(table, text, [match.start() for match, _ in found])


def _declared(at: int, data: Sequence[re.Match[str]]) -> re.Match[str] | None:
    """The declaration in whose value a place of the text lies."""
    before = bisect(data, at, key=lambda one: one.start("value"))
    return data[before - 1] if before and at < data[before - 1].end("value") else None


def _numbers(origin: str, label: str, cells: str) -> list[float]:
    """The numbers of a position or an orientation. Raises DocumentError for anything else, such as an expression."""
    for cell in cells.split(","):
        if not _WRITTEN.fullmatch(cell):
            what = f"{cell.strip()[:40]!r} is no number"
            raise refusal(origin, f"robtarget {label}", what, "write its value, or remove it with its picture", "rapid")
    return [float(cell.strip()) for cell in cells.split(",")]


def _require_values(origin: str, text: str, data: Sequence[re.Match[str]], starts: Sequence[int]) -> None:
    """Raises DocumentError for a target whose value is not written as numbers: an expression, another target's name."""
    for one in (declared for declared in data if declared["kind"].lower() in _TYPES):
        count = bisect_left(starts, one.end("value")) - bisect_left(starts, one.start("value"))
        sizes = [int(size) for size in re.findall(r"[0-9]{1,9}", one["sizes"] or "1")]
        if count == 0 or count != math.prod(sizes):
            value = " ".join(one["value"].split())
            what = f"{value[:60]!r} is not read as " + ("numbers" if count == 0 else f"{math.prod(sizes)} targets")
            fix = "write its value in numbers, or remove it with its picture"
            raise refusal(origin, f"{one['kind'].lower()} {one['name']}", what, fix, "rapid")
    written = {*starts}
    for match in _RAPID_MOVE.finditer(text):
        if match.start(1) not in written:
            raise refusal(origin, "text", f"{match[1][:60]!r} is not read as numbers", "write numbers", "rapid")


def _notes(text: str) -> tuple[str, ...]:
    """What the module says of poses that it computes."""
    targets = {name.lower() for name in _TARGET.findall(text)}
    code = _DATA.sub("", text)
    computed = {name for name in _ASSIGNED.findall(code) if name.lower() in targets}
    computed |= {call.rstrip("( \t") for call in _COMPUTED.findall(code)}
    called = ", ".join(sorted(computed))
    return (f"the program computes poses ({called}): only written numbers are taken",) if computed else ()


Frames = tuple[str, str]  # names of a tool and of a work object


def frames_of_rapid(text: str) -> dict[str, Array]:
    """tframe of tools on the flange, uframe and oframe of work objects that stand, by their names in lower case, where
    the text holds their numbers, declares no others by that name and assigns nothing to them."""
    frames = {"tool0": np.eye(4), "wobj0": np.eye(4)}
    for data in _FRAME_DATA.finditer(text):
        with suppress(ValueError, GeometryError):
            poses = [transform_from_quaternion(*(one.split(",") for one in pose)) for pose in _POSE.findall(data[0])]
            frames[data[1].lower()] = reduce(np.matmul, poses)
    unsure = {one.lower() for one in _ASSIGNED.findall(_DATA.sub("", text))}
    declared = {(name.lower(), "".join(value.split())) for _, name, _, value in _DATA.findall(text)}
    unsure |= {name for name, count in Counter(name for name, _ in declared).items() if count > 1}
    return {name: frame for name, frame in frames.items() if name not in unsure and np.isfinite(frame).all()}


def moves_of_rapid(text: str) -> Iterator[tuple[range, set[str], Frames]]:
    """Of each instruction that moves its places, the words in it in lower case, and its frames as written.

    The tool stands behind the zone; else it is a tool that the text declares, beside a target; in other instructions
    that search, trigger or have a work object it is the last argument. Of a routine's call with a target and a tool a
    work object beside them is taken, too; it counts for targets that no instruction moves to.
    """
    tools, works = ({f"{kind}0", *re.findall(rf"\b{kind}data\s+(\w+)", text.lower())} for kind in ("tool", "wobj"))
    moved, calls = set[str](), list[tuple[range, set[str], Frames]]()
    targets = {name.lower() for name in _TARGET.findall(text)}
    for move in re.finditer(r"[^;]+", text):
        bare, kept, wobj, kind = "", move[0], _WOBJ.search(move[0]), _MOVED.search(move[0])
        while bare != kept:
            bare, kept = kept, _WITHIN.sub(lambda within: "" if within[0][0] == "\\" else "_", kept)
        cells, words = re.findall(r"(?:\{[^{}]*\}|[^,{])+", bare), {*re.findall(r"\w+", move[0].lower())}
        arguments = [one for cell in cells if (one := "".join(cell.split()))]
        zones = [at for at, one in enumerate(arguments[:-1]) if re.fullmatch(r"fine|z\d+", one, re.IGNORECASE)]
        is_call = not (zones or kind or _TOOL_LAST.search(move[0]))
        if words & targets and not _SHIFTING.search(bare):
            zones += [at for at, one in enumerate(arguments[1:]) if one.partition("{")[0].lower() in tools]
        behind = bool(re.search(r"\bMove\w+\s*$", bare.partition(",")[0], re.IGNORECASE))  # MoveL\Conc, p1
        zones += [2 + behind + (kind[1] in "Cc")] if kind else []
        zones += [len(arguments) - 2] if _TOOL_LAST.search(move[0]) else []
        for tool in arguments[zones[0] + 1 :][:1] if zones and "moveabsj" not in bare.lower() else ():
            beside = next((one for one in arguments if is_call and one.lower() in works), "wobj0")
            found = range(*move.span()), words, (tool, "".join(wobj[1].split()) if wobj else beside)
            if is_call:
                calls.append(found)
            else:
                moved |= words
                yield found
    for within, words, frames in calls:
        yield within, words - moved, frames


def _of_flange(table: PoseTable, text: str, places: Sequence[int]) -> PoseTable:
    """The flange's poses, of robtargets of each move's tool in its work object, as far as the module defines both;
    `places`: where each begins. Raises DocumentError where poses of several frames cannot be distinguished."""
    known, moves, of_words = frames_of_rapid(text), [*moves_of_rapid(text)], dict[str, set[Frames]]()
    spelt = {name.lower(): name for *_, frames in moves for name in frames}
    for within, words, (tool, base) in moves:
        for word in (*words, *(f"@{at}" for at in places[bisect(places, within[0]) : bisect(places, within[-1])])):
            of_words.setdefault(word, set()).add((tool.lower(), base.lower()))
    every = {*chain(*of_words.values())}
    names = [label.partition("{")[0].lower() for label in table.labels]  # a number of a target within its move
    taken = [of_words.get(f"@{at}" if name.isdigit() else name, every) for at, name in zip(places, names, strict=True)]
    used = {*chain(*taken)}
    lacking = [frames for frames in used if not {*frames} <= known.keys()]
    mixed = [at for at, frames in enumerate(taken) if len(frames) > 1 or (lacking and len(used) > 1)]
    if mixed:
        of = " and of ".join(f"{spelt[tool]} in {spelt[base]}" for tool, base in sorted(used))
        fix = "give targets of tool0 in wobj0; or one move to each, and the data of its tool and work object"
        place = f"robtarget {table.labels[mixed[0]]}"
        raise refusal(table.origin, place, f"one of several that are of {of}", fix, "rapid")
    if not used - {("tool0", "wobj0")}:
        return table
    tools, bases = np.swapaxes([[known.get(name, np.eye(4)) for name in frames] for (frames,) in taken], 0, 1)
    poses = bases @ transform_from_quaternion(table.lengths, table.numbers) @ inverse(tools)
    data = [spelt[name] for name in sorted({*chain(*used)} & (known.keys() - {"tool0", "wobj0"}))]
    note = f"the flange's poses are those of the program and of its data {', '.join(data)}"
    left = [PosesOf(*("" if name in known else spelt[name] for name in frames)) for frames in lacking]
    return replace(
        table, lengths=poses[:, :3, 3], numbers=quaternion_from_rotation(poses[:, :3, :3]),
        notes=(*table.notes, *[note] * bool(data)), poses_of=left[0] if left else None,
    )  # fmt: skip

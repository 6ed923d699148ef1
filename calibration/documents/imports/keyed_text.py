"""Poses that name each number: KUKA's {X 1, Y 2, ... A 4}, Fanuc's X = 1 mm ... R = 6 deg, UR's p[...], pendants."""

import re

import numpy as np

from calibration.documents.imports.number_tables import table_of_columns
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.refusal import decode, refusal
from calibration.documents.imports.sides import WORDS
from calibration.kinematics.conventions import CONVENTIONS
from calibration.transforms import Array

_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_UR = re.compile(rf"(?:(\w+)\s*=\s*)?p\s*\[\s*({_NUMBER}(?:\s*,\s*{_NUMBER}){{5}})\s*\]")
_MOVE = re.compile(r"\b(?:movej|movel|movep|movec|servoj|get_inverse_kin)\s*\(", re.IGNORECASE)
_SET_TOOL = re.compile(rf"\bset_tcp\s*\(\s*(?:(\w+)|p\s*\[\s*({_NUMBER}(?:\s*,\s*{_NUMBER}){{5}})\s*\])")
_OFFSET = re.compile(r"\b(pose_trans|pose_add|interpolate_pose)\s*\(")
_LIST = re.compile(rf"\b([A-Za-z]\w{{0,13}})\s*[=:]?\s*[\[(]\s*({_NUMBER}(?:[\s,;]+{_NUMBER}){{2,15}})\s*[\])]")
_COMMA_NUMBER = r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?"
_PAIR = re.compile(
    rf"\b([A-Za-z][A-Za-z0-9_]{{0,15}})\s*[=:\s]\s*({_COMMA_NUMBER}|{_NUMBER})\s*(mm|m|deg|°|rad)?"
    r"(?=[\s;}\]]|,(?!\d)|$)"
)

KEYS = tuple(tuple(keys.split()) for keys in WORDS["poses"])
"""The numbers of a pose, in the order in which they are written."""


def read_keyed_text(content: bytes, origin: str) -> PoseTable:
    """The poses of a text that names each number. Raises DocumentError."""
    text = decode(content, origin)
    if _UR.search(text):
        return _universal_robots(origin, text)
    text = _LIST.sub(_as_pairs, text)
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
            return table_of_columns(origin, names, [list(row) for row in rows])
    for keys, counts in uneven.items():
        counted = ", ".join(f"{count} {key}" for key, count in zip(keys, counts, strict=True))
        fix = "give every pose all numbers, and remove tools and bases"
        raise refusal(origin, "text", f"not as many of every number: {counted}", fix)
    raise refusal(
        origin, "text", "no poses in it", "give X, Y, Z with A, B, C, with W, P, R or with q1 to q4, or a table"
    )


def _as_pairs(listed: re.Match[str]) -> str:
    """`Q=[1, 0, 0, 0]` as Q1=1 Q2=0 Q3=0 Q4=0, and `rvec: [...]` as rvec_1=... of lists with longer names."""
    key = listed[1] if len(listed[1]) == 1 else f"{listed[1]}_"
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
        found = []
        for move in _MOVE.finditer(text):
            literal = _UR.match(text, move.end()) or re.compile(r"\s*(\w+)").match(text, move.end())
            if literal is None:
                continue
            match = named.get(literal[1]) if literal.re is not _UR else literal
            if match is not None:
                found.append((match[1] or "", match[2]))
    else:
        found = [(match[1] or "", match[2]) for match in _UR.finditer(text) if tool is None or match[1] != tool[1]]
        found = [one for one in found if tool is None or one[1] != tool[2]]
    if not found:
        raise refusal(origin, "text", "no pose p[...] to which the program moves", "write them, or a list of p[...]")
    rows: Array = np.array([[float(number) for number in numbers.split(",")] for _, numbers in found])
    labels = [name or str(at + 1) for at, (name, _) in enumerate(found)]
    labels = labels if len(set(labels)) == len(labels) else [str(at + 1) for at in range(len(labels))]
    notes: tuple[str, ...] = ()
    if tool is not None:
        known = named.get(tool[1] or "")
        numbers = tool[2] or (known[2] if known else "not read as numbers")
        notes = (
            f"the program sets the tool {tool[1] or ''} p[{numbers}] (m, rad): the poses are that tool's; the camera's"
            " pose is found relative to it",
        )
    return PoseTable(
        origin, tuple(labels), rows[:, :3], rows[:, 3:], "angles", "p[x, y, z, rx, ry, rz] of URScript",
        CONVENTIONS["rotation-vector"], unit="m", notes=notes,
    ).checked()  # fmt: skip

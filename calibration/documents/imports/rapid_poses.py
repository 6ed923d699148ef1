"""Poses in RAPID: `robtarget` and `pose` data, alone or in a module.

Only numbers are read. A value with an expression is refused by its name: without it, every later pose would stand
beside another picture.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from calibration.documents.imports.number_tables import table_of_joints
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.refusal import decode, refusal
from calibration.kinematics.conventions import CONVENTIONS

_NUMBER = re.compile(r"\s*[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?\s*")
_CELL = r"[^][,;]*"
_POSE = re.compile(rf"\[\s*\[({_CELL}(?:,{_CELL}){{2}})\]\s*,\s*\[({_CELL}(?:,{_CELL}){{3}})\]")
_EXTAX = re.compile(rf"\s*,\s*\[[^][]*\]\s*,\s*\[({_CELL}(?:,{_CELL}){{5}})\]")
_JOINTS = re.compile(rf"\[\s*\[({_CELL}(?:,{_CELL}){{5}})\]\s*,\s*\[{_CELL}(?:,{_CELL}){{5}}\]\s*\]")
_DATA = re.compile(r"\b(?:CONST|PERS|VAR)\s+(\w+)\s+(\w+)\s*(?:\{([^}]*)\})?\s*:=([^;]*)", re.IGNORECASE)
_MOVE = re.compile(r"\bMove[CJL]\w*\s*(\[\s*\[[^][]*\]\s*,\s*\[[^;]*)", re.IGNORECASE)
_TARGET = re.compile(r"\b(?:CONST|PERS|VAR)\s+(?:robtarget|pose)\s+(\w+)", re.IGNORECASE)
_ASSIGNED = re.compile(r"(?<![\w.])(\w+)(?:\{[^}]*\})?(?:\.\w+)*\s*:=", re.IGNORECASE)
_COMPUTED = re.compile(r"\b(?:Offs|RelTool|CRobT|CalcRobT)\s*\(", re.IGNORECASE)
_FRAME = re.compile(r"\\\s*WObj\s*:=\s*(\w+)|,\s*(?:fine|z\d+)\s*,\s*(\w+)", re.IGNORECASE)
UNUSED_AXIS = 8.9e9
"""ABB gives 9E9 for an external axis that does not exist."""

_TYPES = frozenset(("robtarget", "pose"))


class _Data(NamedTuple):
    """One declaration with a value: where its value begins and ends."""

    kind: str
    name: str
    sizes: str | None
    begins: int
    ends: int


def read_rapid(content: bytes, origin: str) -> PoseTable:
    """The robtargets and poses of a text in RAPID, in its order. Raises DocumentError."""
    text = "\n".join(_without_comment(line) for line in decode(content, origin).splitlines())
    data = [_Data(match[1].lower(), match[2], match[3], match.start(4), match.end(4)) for match in _DATA.finditer(text)]
    found = [(match, _declared(match.start(), data)) for match in _POSE.finditer(text)]
    found = [(match, one) for match, one in found if one is None or one.kind in _TYPES]  # no tool, no work object
    _require_values(origin, text, data, [match.start() for match, _ in found])
    labels: list[str] = []
    lengths, turns, axes = [], [], []
    for match, one in found:
        name = one.name if one else ""
        count = sum(label == name or label.startswith(f"{name}{{") for label in labels)
        array = one is not None and one.sizes is not None
        labels.append((f"{name}{{{count + 1}}}" if array or count else name) or str(len(labels) + 1))
        lengths.append(_numbers(origin, labels[-1], match[1]))
        turns.append(_numbers(origin, labels[-1], match[2]))
        behind = _EXTAX.match(text, match.end() - 1) or _EXTAX.match(text, match.end())
        axes.append(_numbers(origin, labels[-1], behind[1]) if behind else [UNUSED_AXIS] * 6)
    if not labels:
        if (joints := _joint_targets(origin, text, data)) is not None:
            return joints
        named = re.search(r"\bjointtarget\b", text, re.IGNORECASE)
        what = "joint targets that are not read as numbers" if named else "no robtarget and no pose in it"
        raise refusal(origin, "text", what, "give robtargets: [[x, y, z], [q1, q2, q3, q4], ...]", "rapid")
    return PoseTable(
        origin, tuple(labels), np.array(lengths), np.array(turns), "quaternion",
        f"{len(labels)} robtargets or poses of RAPID", CONVENTIONS["quaternion-wxyz"], unit="mm",
        frame="base_T_flange", notes=_notes(text),
        external_axes=np.where(np.abs(axes) >= UNUSED_AXIS, np.nan, axes),
    ).checked()  # fmt: skip


def _joint_targets(origin: str, text: str, data: Sequence[_Data]) -> PoseTable | None:
    """The jointtargets of a text as joints; None without any."""
    found = [(match, _declared(match.start(), data)) for match in _JOINTS.finditer(text)]
    found = [(match, one) for match, one in found if one is None or one.kind == "jointtarget"]
    if not found:
        return None
    labels = [one.name if one is not None else str(at + 1) for at, (_, one) in enumerate(found)]
    joints = np.array([_numbers(origin, label, match[1]) for label, (match, _) in zip(labels, found, strict=True)])
    table = table_of_joints(origin, labels, joints, f"{len(found)} jointtargets of RAPID")
    return replace(table, convention=CONVENTIONS["joints"])


def _declared(at: int, data: Sequence[_Data]) -> _Data | None:
    """The declaration in whose value a place of the text lies."""
    return next((one for one in data if one.begins <= at < one.ends), None)


def _numbers(origin: str, label: str, cells: str) -> list[float]:
    """The numbers of a position or an orientation. Raises DocumentError for anything else, such as an expression."""
    for cell in cells.split(","):
        if not _NUMBER.fullmatch(cell):
            what = f"{cell.strip()[:40]!r} is no number"
            raise refusal(origin, f"robtarget {label}", what, "write its value, or remove it with its picture", "rapid")
    return [float(cell.strip()) for cell in cells.split(",")]


def _require_values(origin: str, text: str, data: Sequence[_Data], starts: Sequence[int]) -> None:
    """Raises DocumentError for a target whose value is not written as numbers: an expression, another target's name."""
    for one in data:
        if one.kind not in _TYPES:
            continue
        count = sum(one.begins <= start < one.ends for start in starts)
        sizes = [int(size) for size in re.findall(r"[0-9]{1,9}", one.sizes or "1")]
        if count == 0 or count != math.prod(sizes):
            value = " ".join(text[one.begins : one.ends].split())
            what = f"{value[:60]!r} is not read as " + ("numbers" if count == 0 else f"{math.prod(sizes)} targets")
            fix = "write its value in numbers, or remove it with its picture"
            raise refusal(origin, f"{one.kind} {one.name}", what, fix, "rapid")
    for match in _MOVE.finditer(text):
        if match.start(1) not in starts:
            raise refusal(origin, "text", f"{match[1][:60]!r} is not read as numbers", "write numbers", "rapid")


def _without_comment(line: str) -> str:
    """The line up to a `!` that is not inside a string."""
    parts = line.split('"')
    for at in range(0, len(parts), 2):
        if "!" in parts[at]:
            return '"'.join([*parts[:at], parts[at].split("!", 1)[0]])
    return line


def _notes(text: str) -> tuple[str, ...]:
    """What the module says of tool and work object that are not tool0 and wobj0, and of poses that it computes."""
    used = {name for match in _FRAME.finditer(text) for name in match.groups() if name}
    other = sorted(name for name in used if name.lower() not in ("tool0", "wobj0"))
    notes = []
    if other:
        notes.append(
            f"the module moves with {', '.join(other)}: a robtarget is then that tool in that work object; "
            "the camera's pose is found relative to that tool"
        )
    targets = {name.lower() for name in _TARGET.findall(text)}
    code = _DATA.sub("", text)
    computed = {name for name in _ASSIGNED.findall(code) if name.lower() in targets}
    computed |= {call.rstrip("( \t") for call in _COMPUTED.findall(code)}
    if computed:
        notes.append(f"the program computes poses ({', '.join(sorted(computed))}): only written numbers are taken")
    return tuple(notes)

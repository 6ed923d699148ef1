"""Poses in RAPID: `robtarget` and `pose` data, alone or in a module."""

import re

import numpy as np

from calibration.documents.imports.conventions import CONVENTIONS
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.refusal import decode, refusal

_N = r"\s*[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?\s*"
_POSE = re.compile(rf"\[\s*\[({_N},{_N},{_N})\]\s*,\s*\[({_N},{_N},{_N},{_N})\]")
_DATA = re.compile(r"\b(?:CONST|PERS|VAR)\s+(\w+)\s+(\w+)\s*(\{[^}]*\})?\s*:=", re.IGNORECASE)
_FRAME = re.compile(r"\\\s*WObj\s*:=\s*(\w+)|,\s*(?:fine|z\d+)\s*,\s*(\w+)", re.IGNORECASE)
_TYPES = frozenset(("robtarget", "pose"))


def read_rapid(content: bytes, origin: str) -> PoseTable:
    """The robtargets and poses of a text in RAPID, in its order. Raises DocumentError."""
    text = "\n".join(_without_comment(line) for line in decode(content, origin).splitlines())
    heads = [(match.start(), match[1].lower(), match[2], bool(match[3])) for match in _DATA.finditer(text)]
    labels: list[str] = []
    lengths, turns = [], []
    for match in _POSE.finditer(text):
        before = [head for head in heads if head[0] < match.start()]
        kind, name, array = before[-1][1:] if before else ("", "", False)
        if kind and kind not in _TYPES:
            continue  # a tool, a work object
        count = sum(label == name or label.startswith(f"{name}{{") for label in labels)
        labels.append((f"{name}{{{count + 1}}}" if array or count else name) or str(len(labels) + 1))
        lengths.append([float(number) for number in match[1].split(",")])
        turns.append([float(number) for number in match[2].split(",")])
    if not labels:
        joints = re.search(r"\bjointtarget\b", text, re.IGNORECASE)
        what = "joint targets only" if joints else "no robtarget and no pose in it"
        raise refusal(origin, "text", what, "give robtargets: [[x, y, z], [q1, q2, q3, q4], ...]", "rapid")
    return PoseTable(
        origin, tuple(labels), np.array(lengths), np.array(turns), "quaternion",
        f"{len(labels)} robtargets or poses of RAPID", CONVENTIONS["quaternion-wxyz"], unit="mm",
        frame="base_T_flange", notes=_notes(text),
    ).checked()  # fmt: skip


def _without_comment(line: str) -> str:
    """The line up to a `!` that is not inside a string."""
    parts = line.split('"')
    for at in range(0, len(parts), 2):
        if "!" in parts[at]:
            return '"'.join([*parts[:at], parts[at].split("!", 1)[0]])
    return line


def _notes(text: str) -> tuple[str, ...]:
    """What the moves of the module say of tool and work object, where these are not tool0 and wobj0."""
    used = {name for match in _FRAME.finditer(text) for name in match.groups() if name}
    other = sorted(name for name in used if name.lower() not in ("tool0", "wobj0"))
    if not other:
        return ()
    return (
        f"the module moves with {', '.join(other)}: a robtarget is then that tool in that work object; "
        "the camera's pose is found relative to that tool",
    )

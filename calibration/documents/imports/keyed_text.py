"""Poses that name each number: KUKA's {X 1, Y 2, ... A 4}, Fanuc's X = 1 mm ... R = 6 deg, UR's p[...], pendants."""

import re

import numpy as np

from calibration.documents.imports.conventions import CONVENTIONS
from calibration.documents.imports.number_tables import table_of_columns
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.refusal import decode, refusal
from calibration.transforms import Array

_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_UR = re.compile(rf"(?:(\w+)\s*=\s*)?p\s*\[\s*({_NUMBER}(?:\s*,\s*{_NUMBER}){{5}})\s*\]")
_COMMA_NUMBER = r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?"
_PAIR = re.compile(
    rf"\b([A-Za-z][A-Za-z0-9]{{0,9}})\s*[=:\s]\s*({_COMMA_NUMBER}|{_NUMBER})\s*(mm|m|deg|°|rad)?"
    r"(?=[\s;}\]]|,(?!\d)|$)"
)

KEYS = (
    ("X", "Y", "Z", "A", "B", "C"), ("X", "Y", "Z", "W", "P", "R"), ("X", "Y", "Z", "O", "A", "T"),
    ("X", "Y", "Z", "RX", "RY", "RZ"), ("X", "Y", "Z", "Q1", "Q2", "Q3", "Q4"), ("X", "Y", "Z", "EX", "EY", "EZ"),
    ("X", "Y", "Z", "QW", "QX", "QY", "QZ"),
)  # fmt: skip
"""The numbers of a pose, in the order in which they are written."""


def read_keyed_text(content: bytes, origin: str) -> PoseTable:
    """The poses of a text that names each number. Raises DocumentError."""
    text = decode(content, origin)
    if ur := _UR.findall(text):
        return _universal_robots(origin, ur)
    found: dict[str, list[float]] = {}
    units: set[str] = set()
    pairs = _PAIR.findall(text)
    if {mark for _, number, _ in pairs for mark in ",." if mark in number} == {",", "."}:
        raise refusal(origin, "text", "some numbers have a comma, others a point", "write decimals with one of them")
    for key, number, unit in pairs:
        found.setdefault(key.upper(), []).append(float(number.replace(",", ".")))
        units |= {unit} - {""}
    for keys in KEYS:
        count = len(found.get("X", []))
        if count and all(len(found.get(key, [])) == count for key in keys):
            names = [f"{key} mm" if at < 3 and "mm" in units else key for at, key in enumerate(keys)]
            rows = [[found[key][at] for key in keys] for at in range(count)]
            return table_of_columns(origin, names, rows)
    for keys in KEYS:
        counts = {key: len(found.get(key, [])) for key in keys}
        if all(counts.values()):
            what = f"not as many of every number: {', '.join(f'{count} {key}' for key, count in counts.items())}"
            raise refusal(origin, "text", what, "give every pose all numbers, and remove tools and bases")
    raise refusal(
        origin, "text", "no poses in it", "give X, Y, Z with A, B, C, with W, P, R or with q1 to q4, or a table"
    )


def _universal_robots(origin: str, found: list[tuple[str, str]]) -> PoseTable:
    rows: Array = np.array([[float(number) for number in numbers.split(",")] for _, numbers in found])
    labels = [name or str(at + 1) for at, (name, _) in enumerate(found)]
    return PoseTable(
        origin, tuple(labels), rows[:, :3], rows[:, 3:], "angles", "p[x, y, z, rx, ry, rz] of URScript",
        CONVENTIONS["rotation-vector"], unit="m",
    ).checked()  # fmt: skip

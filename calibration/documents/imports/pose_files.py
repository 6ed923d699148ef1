"""The table of file families: which reader takes a file, by its suffix and, for text, by what stands in it."""

import re
from collections.abc import Callable
from pathlib import PurePath
from typing import Any

from calibration.documents.imports.arrays import read_mat, read_npy, read_npz
from calibration.documents.imports.keyed_text import read_halcon_pose, read_keyed_text
from calibration.documents.imports.leaves import table_of_data
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.rapid_poses import read_rapid
from calibration.documents.imports.refusal import decode, refusal
from calibration.documents.imports.text_tables import read_text_table
from calibration.documents.imports.trees import read_json, read_json_lines, read_xml_tree, read_yaml
from calibration.errors import DocumentError

Reader = Callable[[bytes, str], PoseTable]


def _reader_of(read: Callable[[bytes, str], Any]) -> Reader:
    return lambda content, origin: table_of_data(read(content, origin), origin)


_json, _json_lines, _yaml = (_reader_of(one) for one in (read_json, read_json_lines, read_yaml))

_THREE_AND_FOUR = r"\[\s*\[(?:[^][,]*,){2}[^][,]*\]\s*,\s*\[(?:[^][,]*,){3}[^][,]*\]"
_RAPID = re.compile(rf"\b(robtarget|jointtarget)\b|\bMODULE\s|{_THREE_AND_FOUR}", re.IGNORECASE)
_KEYED = re.compile(
    r"\bp\s*\[|\b[xX]\s*[=:]?\s*[-+.\d]+[^;\n]*\b[yY]\s*[=:]?\s*[-+.\d]+|^\s*[xX]\s*[=:]|\][^][\n]*\w[=:] ?\["
    r"|^\w+[=:]\s*\n\[[^][]*\]\s*\n\w",
    re.MULTILINE,
)
_DOCUMENTS = re.compile(r"^[a-z_]+:[ \t]*\n(?s:.*)^---[ \t]*$", re.MULTILINE)
"""Messages of `ros2 topic echo`: YAML documents."""

_HALCON = re.compile(r"^\s*[rt]\s+[-+.\d]|ParGroup", re.MULTILINE)


def read_any_text(content: bytes, origin: str) -> PoseTable:
    """The poses of a text of any family: a table, RAPID, named numbers, HALCON, JSON. Raises DocumentError."""
    text = decode(content, origin)
    if text.lstrip()[:1] in ("{", "["):
        for reader in (_json, _json_lines):
            try:
                return reader(content, origin)
            except DocumentError:
                continue
    families = ((_RAPID, read_rapid), (_HALCON, read_halcon_pose), (_DOCUMENTS, _yaml), (_KEYED, read_keyed_text))
    reader = next((reader for pattern, reader in families if pattern.search(text)), read_text_table)
    return reader(content, origin)


FAMILIES: dict[str, Reader] = {
    **dict.fromkeys((".csv", ".tsv", ".tum"), read_text_table),
    **dict.fromkeys((".txt", ".log", ".conf", ".xf", ".mod", ".modx", ".prg", ".sys", ".dat", ".pose"), read_any_text),
    **dict.fromkeys((".src", ".ls", ".script"), read_keyed_text),
    **dict.fromkeys((".yaml", ".yml", ".samples"), _yaml),
    **dict.fromkeys((".jsonl", ".ndjson"), _json_lines),
    ".json": _json,
    ".xml": _reader_of(lambda content, origin: read_xml_tree(content, origin, "robot-poses")),
    ".npy": read_npy,
    ".npz": read_npz,
    ".mat": read_mat,
}
"""Readers by suffix."""


def read_poses(name: str, content: bytes) -> PoseTable:
    """The poses of a file. Raises DocumentError, with one problem, also for a suffix that no reader takes."""
    suffix = PurePath(name).suffix.lower()
    if suffix not in FAMILIES:
        raise refusal(name, "file", f"no poses are read from {suffix or 'a name without suffix'}", "give a CSV or JSON")
    return FAMILIES[suffix](content, name)

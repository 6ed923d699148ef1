"""The table of file families: which reader takes a file, by its suffix and, for text, by what stands in it.

Arrays of numpy and MATLAB are never unpickled; the sizes that a file states are checked before anything is unpacked.
"""

import io
import re
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import PurePath
from typing import Any

import numpy as np

from calibration.documents.imports import trees
from calibration.documents.imports.leaves import is_picture, table_beside_pictures, table_of_array, table_of_data
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.programs import lists_in_lines, read_halcon_pose, read_keyed_text, read_rapid
from calibration.documents.imports.refusal import DAMAGED, DAMAGED_ARCHIVE, MAX_UNPACKED_BYTES, decode, refusal
from calibration.documents.imports.text_tables import read_sheet, read_text_table
from calibration.errors import DocumentError
from calibration.transforms import Array

MAX_ARRAY_BYTES = 64_000_000  # bytes of an array with poses
OF_VIEW = ((3, 3), (3, 4), (4, 4), (3, 1), (1, 3))  # shapes of what one view has in a .mat file

_NUMBERS = re.compile(rb"'descr': '.?([if]|u1)")
"""In the header of an array of integers, floats or pictures; texts and dates beside it are passed over."""

FIX = "save an array n x 4 x 4, n x 7 or n x 6 of floats"


def load_npy(content: bytes, origin: str) -> Array:
    """A numeric array of at most MAX_ARRAY_BYTES, or of pictures. Raises DocumentError."""
    try:
        array = np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
    except DAMAGED as error:
        raise refusal(origin, "file", f"no array of numpy, or no numbers in it ({str(error)[:80]})", FIX) from None
    if is_picture(array):
        return array
    if array.dtype.kind not in "iuf" or array.nbytes > MAX_ARRAY_BYTES:
        raise refusal(origin, "array", f"no numbers ({array.dtype}), or more than 64 MB of them", FIX)
    return np.atleast_1d(array).astype(float)


def read_mat(content: bytes, origin: str) -> PoseTable:
    """The poses of a .mat file (version 5), whose views are the last axis, or scipy's first. Raises DocumentError."""
    import scipy.io  # an eighth of a second, and few bring such files

    try:
        found = scipy.io.loadmat(io.BytesIO(content), struct_as_record=True)
        arrays = {name: one for name, one in found.items() if isinstance(one, np.ndarray)}
        data = {name: plain for name, one in arrays.items() if (plain := _of_matlab(one)) is not None}
    except (*DAMAGED_ARCHIVE, NotImplementedError, scipy.io.matlab.MatReadError) as error:
        raise refusal(origin, "file", f"no .mat file of version 5 ({str(error)[:80]})", "save it with -v6") from None
    if sum(one.nbytes for one in arrays.values()) > MAX_ARRAY_BYTES:
        raise refusal(origin, "file", "unpacks to more than 64 MB", FIX)
    return table_of_data(data, origin)


def _of_matlab(value: Any) -> Any:
    """Arrays with the views first, cells as lists, structs as mappings or lists of them; None for anything else."""
    if not isinstance(value, np.ndarray) or value.nbytes > MAX_ARRAY_BYTES:
        return None
    if value.dtype.names:
        structs = [{name: _of_matlab(one[name]) for name in value.dtype.names} for one in value.flat]
        return structs[0] if len(structs) == 1 else structs
    if value.dtype == object:
        return [_of_matlab(one) for one in value.flat]
    views_last = value.ndim == 3 and (value.shape[:2] in OF_VIEW or value.shape[1:] not in OF_VIEW)
    return None if value.dtype.kind not in "iuf" else np.moveaxis(value, 2, 0) if views_last else value


def load_npz(content: bytes, origin: str) -> dict[str, Array]:
    """The numeric arrays and pictures of a .npz file, of at most MAX_UNPACKED_BYTES together. Raises DocumentError."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
            if sum(member.file_size for member in members) > MAX_UNPACKED_BYTES or len(members) > 100:
                raise refusal(origin, "file", "unpacks to more than 256 MB or 100 arrays", FIX)
            packed = {member.filename.removesuffix(".npy"): archive.read(member) for member in members}
            packed = {name: array for name, array in packed.items() if _NUMBERS.search(array[:128])} or packed
    except DAMAGED_ARCHIVE as error:
        raise refusal(origin, "file", f"no .npz file ({str(error)[:80]})", FIX) from None
    return {name: load_npy(array, f"{origin}: {name}") for name, array in packed.items()}


def read_npz(content: bytes, origin: str) -> PoseTable:
    """The poses of a .npz file, with its pictures. Raises DocumentError."""
    arrays = load_npz(content, origin)
    try:
        return table_beside_pictures(dict(arrays), origin)
    except DocumentError as error:
        have = ", ".join(f"{name} {array.shape}" for name, array in list(arrays.items())[:8])
        what = f"not one array of poses among {have or 'none'} ({error.problems[0].what})"
        raise refusal(origin, "arrays", what, FIX) from None


Reader = Callable[[bytes, str], PoseTable]


def _reader_of(read: Callable[[bytes, str], Any]) -> Reader:
    return lambda content, origin: table_beside_pictures(read(content, origin), origin)


_json, _json_lines, _yaml = (_reader_of(one) for one in (trees.read_json, trees.read_json_lines, trees.read_yaml))

_THREE_AND_FOUR = r"\[\s*\[(?:[^][,]*,){2}[^][,]*\]\s*,\s*\[(?:[^][,]*,){3}[^][,]*\]"
_RAPID = re.compile(rf"\b(robtarget|jointtarget)\b|\bMODULE\s|{_THREE_AND_FOUR}", re.IGNORECASE)
_NO_AXIS = re.compile(r"\]\s*,\s*\[[^][]*\b9E\+?0?9\b", re.IGNORECASE)  # at the end of a robtarget
_KEYED = re.compile(
    r"(?m)\bp\s*\[|\b[xX]\s*[=:]?\s*[-+.\d]+[^;\n]*\b[yY]\s*[=:]?\s*[-+.\d]+|^\s*[xX]\s*[=:]|\][^][\n]*\w[=:] ?\["
    r"|^- Translation: ?\[|^\w+[=:]\s*\n\[[^][]*\]\s*\n\w"
)
_DOCUMENTS = re.compile(r"\A%YAML|^[a-z_]+:[ \t]*\n(?s:.*)^---[ \t]*$", re.MULTILINE)  # OpenCV's YAML, ros2 topic echo
_HALCON = re.compile(r"^\s*[rt]\s+[-+.\d]|ParGroup", re.MULTILINE)


def read_any_text(content: bytes, origin: str) -> PoseTable:
    """The poses of a text of any family: a table, RAPID, named numbers, HALCON, JSON. Raises DocumentError."""
    text = decode(content, origin)
    if text.lstrip()[:1] in ("{", "[") and not _NO_AXIS.search(text):
        for reader in (_json, _json_lines):
            with suppress(DocumentError):
                return reader(content, origin)
    families = ((_RAPID, read_rapid), (_HALCON, read_halcon_pose), (_DOCUMENTS, _yaml), (_KEYED, read_keyed_text))
    reader = next((reader for pattern, reader in families if pattern.search(text)), read_text_table)
    try:
        return reader(content, origin)
    except DocumentError:
        if not (lists := lists_in_lines(text)):
            raise
    return table_of_data(lists, origin)


TEXTS = (".txt", ".log", ".conf", ".xf", ".mod", ".modx", ".prg", ".sys", ".dat", ".pose", ".jbi", ".pts", ".mb6")
FAMILIES: dict[str, Reader] = {
    **dict.fromkeys((".csv", ".tsv", ".tum", ".rob"), read_text_table),
    **dict.fromkeys((*TEXTS, ".va"), read_any_text),
    **dict.fromkeys((".src", ".ls", ".script", ".ini"), read_keyed_text),
    **dict.fromkeys((".yaml", ".yml", ".samples"), _yaml),
    **dict.fromkeys((".jsonl", ".ndjson"), _json_lines),
    ".json": _json,
    **dict.fromkeys((".xml", ".dtx"), _reader_of(trees.read_xml_tree)),
    ".py": _reader_of(trees.read_python),
    ".npy": lambda content, origin: table_of_array(load_npy(content, origin), origin),
    ".npz": read_npz,
    ".mat": read_mat,
    **dict.fromkeys((".pkl", ".pickle"), _reader_of(trees.read_pickle)),
    **dict.fromkeys((".xlsx", ".xlsm"), read_sheet),
}
"""Readers by suffix."""


def read_poses(name: str, content: bytes) -> PoseTable:
    """The poses of a file. Raises DocumentError, with one problem, also for a suffix that no reader takes."""
    suffix = PurePath(name).suffix.lower()
    if suffix not in FAMILIES:
        raise refusal(name, "file", f"no poses are read from {suffix or 'a name without suffix'}", "give a CSV or JSON")
    return FAMILIES[suffix](content, name)

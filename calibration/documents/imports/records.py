"""Poses in plain data of JSON or YAML: records in a list or a mapping, each naming its numbers or listing them."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from calibration.documents.imports.columns import TURN_WORDS, words_of
from calibration.documents.imports.number_tables import Cell, table_of_columns, table_of_rows
from calibration.documents.imports.pose_table import PoseTable, table_of_matrices
from calibration.documents.imports.refusal import MAX_POSES, refusal
from calibration.transforms import Array

MAX_DEPTH = 8
POSE_NUMBERS = frozenset(("x", "y", "z", "w", "qw", "qx", "qy", "qz", "rx", "ry", "rz", "a", "b", "c"))
"""Last words of the names of a pose's numbers."""

MAX_CELLS = 200
"""Numbers of one record; a pose has 16 at most, a record may have joints and measurements besides."""


def number_of(value: Any) -> float | None:
    """A number, also one written as text (YAML reads 1e-08 as text); None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        return float(value)
    except (ValueError, OverflowError):
        return None


def array_of(value: Any) -> Array | None:
    """The array of nested lists of numbers of one length each; None for anything else."""
    if not isinstance(value, list) or not value or len(value) > MAX_POSES:
        return None
    rows = []
    for item in value:
        inner: Any = array_of(item) if isinstance(item, list) else number_of(item)
        if inner is None:
            return None
        rows.append(inner)
    if len({np.shape(row) for row in rows}) != 1 or np.ndim(rows[0]) > 2:
        return None
    return np.array(rows, float)


def table_of_data(data: Any, origin: str) -> PoseTable:
    """The table of plain data. Raises DocumentError."""
    data = _opencv_matrix(data)
    if (array := array_of(data)) is not None:
        return table_of_array(array, origin)
    records, labels = _records(data, origin)
    if (whole := _arrays(records)) is not None:
        return table_of_array(whole, origin, labels)
    flat = [dict(_flatten(record, origin)) for record in records]
    names = [name for name in flat[0] if all(name in record for record in flat)]
    if not names:
        raise refusal(origin, "records", "they have no key in common", "give every pose the same keys")
    _require_the_same_numbers(flat, names, origin)
    rows = [[record[name] for name in names] for record in flat]
    table = table_of_columns(origin, names, rows)
    return table if labels is None or len(set(labels)) < len(labels) else _with_labels(table, labels)


def _require_the_same_numbers(flat: Sequence[dict[str, Cell]], names: Sequence[str], origin: str) -> None:
    """Raises DocumentError for the first record without a number of the pose that others have."""
    every = list(dict.fromkeys(name for record in flat for name in record))
    lost = [name for name in every if name not in names and sum(name in record for record in flat) >= len(flat) - 1]
    for name in lost:
        if words_of(name)[-1:] and words_of(name)[-1] in POSE_NUMBERS:
            at = next(at for at, record in enumerate(flat, 1) if name not in record)
            raise refusal(origin, f"record {at}", f"without {name}, which the others have", "complete it, or remove it")


def _with_labels(table: PoseTable, labels: list[str]) -> PoseTable:
    return PoseTable(
        table.origin, tuple(labels), table.lengths, table.numbers, table.kind, table.layout, table.convention,
        table.by_axis, table.unit, table.frame, table.images, table.times_s, table.notes,
    )  # fmt: skip


def table_of_array(array: Array, origin: str, labels: list[str] | None = None) -> PoseTable:
    """The table of an array: (n, 3 or 4, 4), (3 or 4, 4), (n, k), (k,) or a column (k, 1). Raises DocumentError."""
    if array.ndim == 2 and array.shape[1] == 1:
        array = array[:, 0]
    if array.ndim == 1 or array.shape in ((4, 4), (3, 4)):
        array = array[None]
    names = labels or [str(at + 1) for at in range(len(array))]
    if len(array) > MAX_POSES:
        raise refusal(origin, "array", f"{len(array)} poses, where {MAX_POSES} are read", "give those of the views")
    if array.ndim == 3 and array.shape[1:] in ((4, 4), (3, 4)):
        return table_of_matrices(origin, names, array, f"{array.shape[1]} x 4 matrices")
    if array.ndim != 2 or not array.size:
        shape = " x ".join(map(str, array.shape))
        raise refusal(origin, "array", f"its shape {shape} is none of poses", "give n x 4 x 4, n x 7 or n x 6")
    return table_of_rows(origin, array, names)


def _opencv_matrix(data: Any) -> Any:
    """OpenCV's and ViSP's {rows, cols, data} as a list; Zivid's {FloatMatrix: {Data: ...}} likewise."""
    if isinstance(data, dict):
        if isinstance(data.get("FloatMatrix"), dict):
            return data["FloatMatrix"].get("Data")
        plain = [value for key, value in data.items() if key not in ("rows", "cols", "dt", "__version__")]
        if {"rows", "cols", "data"} <= set(data) and isinstance(data["data"], list):
            return _shaped(data)
        if len(plain) == 1 and isinstance(plain[0], dict) and {"rows", "cols", "data"} <= set(plain[0]):
            return _shaped(plain[0])
    return data


def _shaped(matrix: dict[str, Any]) -> Any:
    rows, cols, data = number_of(matrix["rows"]), number_of(matrix["cols"]), matrix["data"]
    if rows and cols and isinstance(data, list) and len(data) == rows * cols and cols > 1:
        width = int(cols)
        return [data[at : at + width] for at in range(0, len(data), width)]
    return data


def _records(data: Any, origin: str) -> tuple[list[Any], list[str] | None]:
    """The records of the data: the list that holds most, or the values of a mapping; and the mapping's keys."""
    for _ in range(MAX_DEPTH):
        if isinstance(data, list):
            if data and all(isinstance(item, dict | list) for item in data):
                return _limited(data, origin), None
            break
        if not isinstance(data, dict) or not data:
            break
        values = list(data.values())
        if len(data) > 1 and all(isinstance(value, dict | list) for value in values) and _alike(values):
            return _limited(values, origin), [str(key) for key in data]
        lists = [value for value in values if isinstance(value, list) and value and isinstance(value[0], dict | list)]
        if (len(lists) == 1 and array_of(lists[0]) is None) or (lists and len(values) == 1):
            data = lists[0]
        elif len(values) == 1 and isinstance(values[0], dict):
            data = values[0]
        else:
            return [data], None
    what = "no list of poses, no mapping of poses and no pose"
    raise refusal(origin, "document", what, "give a list of records with x, y, z, qw, qx, qy, qz")


def _alike(values: list[Any]) -> bool:
    """Whether all values are records with a key in common that are no vectors, or arrays of one shape of a pose."""
    if all(isinstance(value, dict) for value in values):
        return bool(set.intersection(*(set(map(str, value)) for value in values))) and not any(
            set(map(str, value)) <= {"x", "y", "z", "w"} for value in values
        )
    shapes = {getattr(array_of(value), "shape", None) for value in values}
    return len(shapes) == 1 and shapes <= {(4, 4), (3, 4), (16,), (12,), (7,), (6,)}


def _limited(records: list[Any], origin: str) -> list[Any]:
    if len(records) > MAX_POSES:
        what = f"{len(records)} records, where {MAX_POSES} are read"
        raise refusal(origin, "records", what, "give those of the views")
    return records


def _arrays(records: list[Any]) -> Array | None:
    """The records as one array, where each is a list of numbers or has one entry that is a matrix."""
    plain = [_matrix_of(record) if isinstance(record, dict) else array_of(record) for record in records]
    found = [array for array in plain if array is not None]
    if len(found) < len(plain) or len({array.shape for array in found}) != 1:
        return None
    return np.array(found)


def _matrix_of(record: dict[Any, Any]) -> Array | None:
    """The only 3 x 4 or 4 x 4 matrix of a record, in nested lists or as 16 numbers in a row."""
    record = {str(key): _opencv_matrix(value) for key, value in record.items()}
    arrays = [array for array in map(array_of, record.values()) if array is not None]
    found = [array for array in arrays if array.shape in ((4, 4), (3, 4), (16,))]
    return found[0] if len(found) == 1 else None


def _flatten(record: Any, origin: str, name: str = "", depth: int = 0) -> Iterator[tuple[str, Cell]]:
    """(dotted name, number or text) of each leaf of a record."""
    if depth > MAX_DEPTH:
        raise refusal(origin, name or "record", "it nests too deep", "write plain records")
    record = _opencv_matrix(record)
    if isinstance(record, dict | list):
        grid = array_of(record)
        if grid is not None and grid.shape == (3, 3) and name.rsplit(".", 1)[-1].lower() in TURN_WORDS:
            record = {f"r{row}{column}": grid[row, column] for row in range(3) for column in range(3)}
        elif grid is not None and grid.size <= MAX_CELLS:
            record = grid.ravel().tolist()
        pairs = record.items() if isinstance(record, dict) else enumerate(record)
        if len(record) > MAX_CELLS:
            return
        for key, value in pairs:
            yield from _flatten(value, origin, f"{name}.{key}" if name else str(key), depth + 1)
    elif record is not None:
        number = number_of(record)
        yield name, number if number is not None else str(record)

"""CSV, TSV and TXT with poses: any separator, with or without a header, decimal commas, comments, 4 x 4 blocks."""

import re
from dataclasses import replace

import numpy as np

from calibration.documents.imports.number_tables import Cell, table_of_columns, table_of_rows
from calibration.documents.imports.pose_table import PoseTable, table_of_matrices
from calibration.documents.imports.refusal import decode, refusal
from calibration.documents.imports.sides import relation_of
from calibration.documents.imports.text_cells import are_names_of_columns, rows_of
from calibration.transforms import Array

_NESTED = re.compile(r"\[\s*\[|\[[^][]*\d\s*[;\n]\s*[-+.\d][^][]*\]")
_BRACKETS = re.compile(r"\[([^][]*)\]")
_LABELLED = re.compile(r"\s*([A-Za-z_][^][]*?)?\s*[:=,;]?\s*\[([^][]*)\]\s*[,;]?\s*")


MIN_DIGITS = 6
"""Digits of a line of numbers: those of a pose's at least."""


def read_text_table(content: bytes, origin: str) -> PoseTable:
    """The poses of a text of rows. Raises DocumentError."""
    found = rows_of(_without_brackets(decode(content, origin)))
    cells, names = found.cells, found.names
    if not cells:
        raise refusal(origin, "rows", "no poses in it", "give one row for each view")
    if names is not None:
        wrong = next((at for at, row in enumerate(cells) if len(row) != len(names)), None)
        if wrong is not None:
            what = f"{len(cells[wrong])} cells, where the header has {len(names)}"
            fix = "give every row the cells of the header"
            if found.decimal_commas:
                what, fix = f"{what}: decimal commas between commas", "write decimal points, or separate by semicolons"
            raise refusal(origin, f"row {wrong + 1}", what, fix)
        return table_of_columns(origin, names, cells)
    return _without_names(origin, cells)


def _without_brackets(text: str) -> list[str]:
    """The lines of a text; of numbers in brackets, as Python, numpy and MATLAB print them, one line for each row."""
    if not _NESTED.search(text):
        lines = ((_LABELLED.fullmatch(line), line) for line in text.splitlines())
        return [line if found is None else _join(found[1], found[2]) for found, line in lines]
    within = _BRACKETS.findall(text)
    outside = re.sub(r"\[[^][]*\]|[][]", "", text).splitlines()
    if len(rows := [line for line in outside if len(re.findall(r"\d", line)) >= MIN_DIGITS]) > len(within):
        return rows  # a result below a table
    if re.search(r"\[\s*\[", text):  # rows have brackets of their own: a line break within one is only a wrapped line
        return [" ".join(row.split()) for row in within if row.strip()]
    return [row.strip() for matrix in within for row in re.split(r"[;\n]", matrix) if row.strip()]


def _join(label: str | None, numbers: str) -> str:
    separator = "," if "," in numbers else " "
    return f"{label.replace(separator, '_')}{separator}{numbers}" if label else numbers


def read_named_columns(content: bytes, origin: str, wanted: list[str]) -> Array:
    """The numbers (n, k) of the columns with the wanted names. Raises DocumentError."""
    found = rows_of(decode(content, origin).splitlines())
    cells, names = found.cells, found.names
    missing = [name for name in wanted if name not in (names or [])]
    if names is None or missing or not cells:
        raise refusal(
            origin, "header", f"no columns {', '.join(missing or wanted)}", "correct the names", "dataset_spec"
        )
    places = [names.index(name) for name in wanted]
    if any(len(row) < len(names) or isinstance(row[place], str) for row in cells for place in places):
        raise refusal(origin, "rows", "a cell is missing or no number", "correct the file", "dataset_spec")
    return np.array([[row[place] for place in places] for row in cells], float)


def _without_names(origin: str, cells: list[list[Cell]]) -> PoseTable:
    labels: list[str] | None = None
    meshes = [row for row in cells if len(row) > 2 and isinstance(row[0], str) and isinstance(row[1], str)]
    if meshes and len({row[0] for row in meshes}) == 1 and {len(row) for row in meshes} == {9}:
        names = ["cloud", "x", "y", "z", "qx", "qy", "qz", "qw"]  # a .conf of Stanford's scans
        return table_of_columns(origin, names, [row[1:] for row in meshes])
    if all(isinstance(row[0], str) and len(row) > 1 for row in cells):
        labels, cells = [str(row[0]) for row in cells], [row[1:] for row in cells]
        if are_names_of_columns(labels) and len({len(row) for row in cells}) == 1:
            return table_of_columns(origin, labels, [list(column) for column in zip(*cells, strict=True)])
        if len(set(labels)) < len(labels):
            if (both := _by_labels(origin, labels, cells)) is not None:
                return both
            labels = None
    wrong = next(((at, cell) for at, row in enumerate(cells) for cell in row if isinstance(cell, str)), None)
    if wrong is not None:
        what = f"{wrong[1][:40]!r} is no number"
        raise refusal(origin, f"row {wrong[0] + 1}", what, "correct it, or give a header that names the columns")
    numbers = [[float(cell) for cell in row] for row in cells]
    above = [row for row in numbers[::5] if len(row) < 4]
    if len(numbers) % 5 == 0 and len(above) == len(numbers) // 5 > 0:  # Open3D's .log: a line of counts, then 4 x 4
        numbers = [row for at, row in enumerate(numbers) if at % 5]
    count = int(numbers[0][0]) if len(numbers[0]) == 1 and len(numbers) > 1 and len(numbers[1]) > 1 else None
    widths = {len(row) for row in (numbers[1:] if count is not None else numbers)}
    if count is not None:
        numbers = numbers[1:]
    if widths == {4} and len(numbers) % 4 == 0 and not labels:
        table = _blocks(origin, np.array(numbers).reshape(-1, 4, 4))
        if count is not None and count != len(table):
            what = f"the first line says {count} poses, and {len(table)} follow"
            raise refusal(origin, "row 1", what, "complete the file")
        return table
    if widths == {1} and len(numbers) in (6, 7, 12, 16):
        return table_of_rows(origin, np.array(numbers).reshape(1, -1), layout=f"{len(numbers)} numbers, one a line")
    if len(widths) > 1:
        first = next(at for at, row in enumerate(numbers) if len(row) != len(numbers[0]))
        what = f"{len(numbers[first])} numbers, where row 1 has {len(numbers[0])}"
        raise refusal(origin, f"row {first + 1}", what, "give every row as many")
    table = table_of_rows(origin, np.array(numbers), labels)
    of_files = labels is not None and all("." in label for label in labels)
    return replace(table, images=tuple(labels or ())) if of_files else table


def _by_labels(origin: str, labels: list[str], cells: list[list[Cell]]) -> PoseTable | None:
    """The robot's and the camera's poses of rows that are called by their side, such as `hand` and `eye`."""
    said = [relation_of(label) for label in labels]
    rows = {side: [row for row, one in zip(cells, said, strict=True) if one is not None and one.side == side]
            for side in ("robot", "camera")}  # fmt: skip
    if not len(rows["robot"]) == len(rows["camera"]) == len(cells) / 2:
        return None
    robot, camera = (_without_names(origin, one) for one in rows.values())
    return replace(robot, side="robot", camera=replace(camera, side="camera"))


def _blocks(origin: str, matrices: Array) -> PoseTable:
    labels = [str(at + 1) for at in range(len(matrices))]
    return table_of_matrices(origin, labels, matrices, "4 x 4 matrices in rows of four")

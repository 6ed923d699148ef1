"""CSV, TSV and TXT with poses: any separator, quotes, decimal commas, thousands, comments, titles above a header, with
or without one, 4 x 4 blocks."""

import csv
import io
import re
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from xml.etree.ElementTree import Element

import numpy as np

from calibration.documents.imports.leaves import MAX_CELLS, table_of_data
from calibration.documents.imports.number_tables import ANGLES, UNITS, Cell, table_of_columns, table_of_rows, words_of
from calibration.documents.imports.pairing import natural
from calibration.documents.imports.pose_table import PoseTable, table_of_matrices
from calibration.documents.imports.refusal import DAMAGED_ARCHIVE, MAX_POSES, MAX_TEXT_BYTES, decode, refusal
from calibration.documents.imports.trees import read_xml

_NESTED = re.compile(r"\[\s*\[|\[[^][]*\d\s*[;\n]\s*[-+.\d][^][]*\]")
_LISTS = re.compile(r'\A[^][\n]*[,;\t][^][\n]*\n(?:[^][\n]*[,;\t])?"?[\[(][-+.\d\[(\s]*\d[^"]*[\])]"?[,;\t\n]')
_BRACKETS = re.compile(r"\[([^][]*)\]")
_LABELLED = re.compile(r"\s*([A-Za-z_][^][(){}]*?)?\s*[:=,;]?\s*[\[({]([^][(){}]*)[\])}]\s*[,;]?\s*")

MIN_DIGITS, MIN_SHARE, MAX_LOOKED_AT, MAX_BEGUN = 6, 2 / 3, 20, 2000
"""Digits of a line of a pose's numbers; share of the last lines (so many are looked at) in which a separator stands:
titles above the table have other ones; and characters in which a header and a first row with a list stand."""

COMMENT = re.compile(r"^\s*(#|%|//|!|;\s*#)")
_TRAILING_COMMENT = re.compile(r"(?<=[\d\"'\])])[,;]?\s+(#|%|//|!).*$")
_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eEdD][-+]?\d+)?")
_COMMA_NUMBER = re.compile(r"[-+]?\d+(,\d+)?([eE][-+]?\d+)?")
_GERMAN_THOUSANDS = re.compile(r"[-+]?\d{1,3}(\.\d{3})+,\d+")
_ENGLISH_THOUSANDS = re.compile(r"[-+]?\d{1,3}(,\d{3})+\.\d+")
_COMMA_GROUPS = re.compile(r"[-+]?[1-9]\d{0,2}(,\d{3})+")
_POINT_GROUPS = re.compile(r"[-+]?[1-9]\d{0,2}(\.\d{3})+")
_SHARED = "xl/sharedStrings.xml"
_SHEET = re.compile(rf"{_SHARED}|xl/worksheets/sheet\d+\.xml")
_STATED = re.compile(r"sep=(.)", re.IGNORECASE)
_SEPARATORS = (";", "\t", "|", ",")
_NOT_FINITE = ("nan", "inf", "-inf", "+inf")
_EMPTY_UNITS = ("", "-", "1", "none")


def read_text_table(content: bytes, origin: str) -> PoseTable:
    """The poses of a text of rows. Raises DocumentError."""
    text = decode(content, origin)
    if _LISTS.search(text[:MAX_BEGUN]):  # lists in cells, as pandas writes them
        records = csv.DictReader(io.StringIO(text), delimiter=_separator(text.splitlines()[:1]) or ",", restval="")
        return table_of_data([{name or "index": cell for name, cell in row.items()} for row in records], origin)
    found = rows_of(_without_brackets(text))
    cells, names = found.cells, found.names
    if not cells:
        raise refusal(origin, "rows", "no poses in it", "give one row for each picture")
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


def read_sheet(content: bytes, origin: str) -> PoseTable:
    """The poses of the first sheet of an .xlsx file. Raises DocumentError."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = sorted(filter(_SHEET.fullmatch, archive.namelist()), key=natural)
            names = names[: 1 + (_SHARED in names)]
            if sum(archive.getinfo(name).file_size for name in names) > MAX_TEXT_BYTES:
                raise refusal(origin, "sheet", "unpacks to more than 32 MB", "give the poses of the pictures only")
            *shared, sheet = (read_xml(decode(archive.read(name), origin), origin, "robot-poses") for name in names)
        texts = [_text_of(one) for root in shared for one in root]
        rows = [
            {cell.get("r", "").rstrip("0123456789"): _text_of(cell, texts) for cell in row.iterfind("{*}c")}
            for row in [*sheet.iterfind(".//{*}row")][: MAX_POSES + 100]
        ]
    except DAMAGED_ARCHIVE as error:
        raise refusal(origin, "file", f"no .xlsx file ({str(error)[:80]})", "save the sheet as CSV") from None
    columns = sorted({name for row in rows for name in row}, key=lambda name: (len(name), name))[:MAX_CELLS]
    return read_text_table("\n".join("\t".join(row.get(name, "") for name in columns) for row in rows).encode(), origin)


def _text_of(cell: Element, shared: Sequence[str] = ()) -> str:
    """What a cell or a shared text says, without the readings of Japanese words."""
    paths = ("{*}v", "{*}t", "{*}r/{*}t", "{*}is/{*}t", "{*}is/{*}r/{*}t")
    said = " ".join("".join(one.text or "" for path in paths for one in cell.iterfind(path)).split())
    return shared[int(said)] if cell.get("t") == "s" else said


def _without_brackets(text: str) -> list[str]:
    """The lines of a text; of numbers in brackets, as Python, numpy and MATLAB print them, one line for each row."""
    if not _NESTED.search(text):
        rows = []
        for line in text.splitlines():
            label, numbers = found.groups() if (found := _LABELLED.fullmatch(line)) else (None, line)
            by = "," if "," in numbers else " "
            rows.append(f"{label.replace(by, '_')}{by}{numbers}" if label else numbers)
        return rows
    within = _BRACKETS.findall(text)
    outside = re.sub(r"\[[^][]*\]|[][]", "", text).splitlines()
    if len(rows := [line for line in outside if len(re.findall(r"\d", line)) >= MIN_DIGITS]) > len(within):
        return rows  # a result below a table
    if re.search(r"\[\s*\[", text):  # rows have brackets of their own: a line break within one is only a wrapped line
        return [" ".join(row.split()) for row in within if row.strip()]
    return [row.strip() for matrix in within for row in re.split(r"[;\n]", matrix) if row.strip()]


def _without_names(origin: str, cells: list[list[Cell]]) -> PoseTable:
    labels: list[str] | None = None
    meshes = [row for row in cells if len(row) > 2 and isinstance(row[0], str) and isinstance(row[1], str)]
    if meshes and len({row[0] for row in meshes}) == 1 and {len(row) for row in meshes} == {9}:
        names = ["cloud", "x", "y", "z", "qx", "qy", "qz", "qw"]  # a .conf of Stanford's scans
        return table_of_columns(origin, names, [row[1:] for row in meshes])
    if all(isinstance(row[0], str) and len(row) > 1 for row in cells):
        labels, cells = [str(row[0]) for row in cells], [row[1:] for row in cells]
        last = {word for label in labels for word in words_of(label)[-1:]}
        if {"x", "y", "z"} <= last and len({*map(len, cells)}) == 1:
            return table_of_columns(origin, labels, [list(column) for column in zip(*cells, strict=True)])
        labels = labels if len(set(labels)) == len(labels) else None
    wrong = next(((at, cell) for at, row in enumerate(cells) for cell in row if isinstance(cell, str)), None)
    if wrong is not None:
        what = f"{wrong[1][:40]!r} is no number"
        raise refusal(origin, f"row {wrong[0] + 1}", what, "correct it, or give a header that names the columns")
    numbers = [[float(cell) for cell in row] for row in cells]
    above = [row for row in numbers[::5] if len(row) < 4]
    if len(numbers) % 5 == 0 and len(above) == len(numbers) // 5 > 0:  # Open3D's .log: a line of counts, then 4 x 4
        numbers = [row for at, row in enumerate(numbers) if at % 5]
    counted = len(numbers[0]) == 1 and len(numbers) > 1 and len(numbers[1]) > 1
    count, numbers = (int(numbers[0][0]), numbers[1:]) if counted else (None, numbers)
    widths = {len(row) for row in numbers}
    height = 4 if len(numbers) % 3 or any(row[-1] in (0, 1) for row in numbers) else 3
    if widths == {4} and len(numbers) % height == 0 and not labels:
        matrices = np.array(numbers).reshape(-1, height, 4)
        table = table_of_matrices(origin, (), matrices, f"{height} x 4 matrices in rows of four")
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


@dataclass(frozen=True)
class TextRows:
    """The cells of the rows, the names of the columns where a row of them or a comment says them, and whether the rows
    look like numbers with decimal commas that are separated by commas."""

    cells: list[list[Cell]]
    names: list[str] | None
    decimal_commas: bool = False


def rows_of(lines: Sequence[str]) -> TextRows:
    """The rows of lines with and without comments; no rows where there are none."""
    comments = [line.lstrip("#%/! \t") for line in lines if COMMENT.match(line)]
    rows = [_TRAILING_COMMENT.sub("", line) for line in lines if line.strip() and not COMMENT.match(line)]
    stated = _STATED.fullmatch(rows[0].strip()) if rows else None
    rows = rows[1:] if stated else rows
    separator = stated[1] if stated else _separator(rows)
    texts = [row for row in (_split(line, separator) for line in rows) if any(row)]
    style = _Decimals.guess(texts)
    above = next((at for at, row in enumerate(texts) if any(style.is_number(cell) for cell in row)), 0)
    names = _names(texts[:above], len(texts[above]) if texts else 0, at_blanks=separator is None)
    texts = texts[above:]
    if names is None and comments and texts:
        said = [cell for cell in _split(comments[-1], separator) if cell]
        names = said if len(said) == len(texts[0]) and not any(style.is_number(cell) for cell in said) else None
    if names is None and texts:
        # Without the lines between matrices in rows of four, such as `Pose 3:`, and above sections, such as `[robot]`.
        whole = [row for row in texts if all(map(style.is_number, row)) and len(row) == len(texts[-1])]
        silent = sum(not any(map(style.is_number, row)) for row in texts)
        are_titles = len(whole) >= 4 * silent and (len(texts[-1]) > 4 or len(whole) % 4 == 0)
        texts = whole if are_titles and len(whole) + silent == len(texts) else texts
    elif names is not None:
        numbers = {place for row in texts for place, cell in enumerate(row) if style.is_number(cell)}
        remarks = max(numbers, default=-1) + 1
        texts = [_fit_width(row, len(names), remarks) for row in texts if row[: len(names)] != names]
    doubled = names is not None and bool(texts) and len(texts[0]) >= 2 * len(names) - 2 and separator == ","
    return TextRows([[style.value(cell) for cell in row] for row in texts], names, doubled)


def _separator(lines: Sequence[str]) -> str | None:
    """The character between cells; None for blanks."""
    last = lines[-MAX_LOOKED_AT:]
    cells = [line.split() for line in last[-3:]]
    numbers = [[cell for cell in row if _COMMA_NUMBER.fullmatch(cell)] for row in cells]
    if all(len(own) >= max(3, len(row) - 1) and "," in "".join(own) for own, row in zip(numbers, cells, strict=True)):
        return None  # blanks between three numbers or more, of which one has a decimal comma
    if len({line.count("\t") for line in lines}) > 1 == len({len(line.split()) for line in lines}):
        return None  # tabs and blanks, but as many cells
    return next((one for one in _SEPARATORS if sum(one in line for line in last) >= MIN_SHARE * len(last)), None)


def _split(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return [_bare(cell) for cell in line.split()]
    quoted = csv.reader([line], delimiter=separator, skipinitialspace=True)
    cells = [_bare(cell) for cell in (next(quoted) if '"' in line else line.split(separator))]
    return cells[:-1] if len(cells) > 1 and cells[-1] == "" else cells


def _bare(cell: str) -> str:
    bare = cell.strip().strip("\"'[]()").strip()
    return bare + "".join(end for begin, end in ("[]", "()") if begin in bare and end not in bare)  # x [mm]


@dataclass(frozen=True)
class _Decimals:
    """How numbers are written: with decimal commas, and what stands between thousands ("" for nothing)."""

    comma: bool
    thousands: str

    @classmethod
    def guess(cls, rows: Sequence[Sequence[str]]) -> "_Decimals":
        cells = [cell for row in rows for cell in row if "," in cell]
        if any(_GERMAN_THOUSANDS.fullmatch(cell) for cell in cells):
            return cls(comma=True, thousands=".")
        if any(_ENGLISH_THOUSANDS.fullmatch(cell) for cell in cells):
            return cls(comma=False, thousands=",")
        commas = [cell for cell in cells if _COMMA_NUMBER.fullmatch(cell)]
        points = [cell for row in rows for cell in row if "." in cell and _NUMBER.fullmatch(cell)]
        if commas and points:  # one of the marks may stand between thousands, without decimals behind
            of_commas = all(_COMMA_GROUPS.fullmatch(cell) for cell in commas)
            of_points = all(_POINT_GROUPS.fullmatch(cell) for cell in points)
            if of_commas != of_points:
                return cls(comma=of_points, thousands="," if of_commas else ".")
        return cls(comma=bool(commas), thousands="")

    def plain(self, cell: str) -> str:
        cell = cell.replace(self.thousands, "") if self.thousands else cell
        return cell.replace(",", ".") if self.comma else cell

    def is_number(self, cell: str) -> bool:
        return bool(_NUMBER.fullmatch(self.plain(cell))) or cell.lower() in _NOT_FINITE

    def value(self, cell: str) -> Cell:
        if _NUMBER.fullmatch(plain := self.plain(cell)):
            return float(plain.replace("d", "e").replace("D", "e"))
        return float("nan") if cell.lower() in _NOT_FINITE else cell


def _names(above: list[list[str]], width: int, *, at_blanks: bool) -> list[str] | None:
    """The names of the columns among the rows without numbers above a table of `width` columns.

    They are the last row that is as wide as the table; one of units below it is joined to them. A narrower row counts
    where there is none, so that it is refused; of words between blanks only when it lacks one, since others are titles.
    """
    least = max(2, width - 1) if at_blanks else 2
    named = [row for row in above if not _are_units(row)]
    header = next((row for row in reversed(named) if len(row) >= max(2, width)), None)
    header = header or next((row for row in reversed(named) if len(row) >= least), None)
    if header is None:
        return None
    if len({*header}) < len(header):  # a row above says whose they are: Robot, , , , , , Camera
        groups, side = next((row for row in named if row is not header and any(row)), []), ""
        sides = [side := cell or side for cell in [*groups, *[""] * (len(header) - len(groups))]]
        header = [f"{side} {name}".strip() for side, name in zip(sides, header, strict=False)]
    units = next((row for row in reversed(above) if _are_units(row)), [])
    both = zip(header, [*units, *[""] * len(header)], strict=False)
    return [f"{name} [{unit}]" if unit.lower() not in _EMPTY_UNITS else name for name, unit in both]


def _are_units(row: Sequence[str]) -> bool:
    known = UNITS.keys() | ANGLES.keys() | {*_EMPTY_UNITS}
    return all(cell.lower() in known for cell in row) and any(cell.lower() not in _EMPTY_UNITS for cell in row)


def _fit_width(row: list[str], width: int, remarks: int) -> list[str]:
    """The row with as many cells as names: without empty ones behind, or with missing remarks (from that column on)."""
    if row[width:] and not any(row[width:]):
        return row[:width]
    return [*row, *[""] * (width - len(row))] if len(row) >= remarks or row[-1] == "" else row

"""Lines of a text to rows of cells: separators, quotes, decimal commas, thousands, comments, titles above a header."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass

from calibration.documents.imports.columns import ANGLES, UNITS, words_of
from calibration.documents.imports.number_tables import Cell

COMMENT = re.compile(r"^\s*(#|%|//|!|;\s*#)")
_TRAILING_COMMENT = re.compile(r"(?<=[\d\"'\])])[,;]?\s+(#|%|//|!).*$")
_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eEdD][-+]?\d+)?")
_COMMA_NUMBER = re.compile(r"[-+]?\d+(,\d+)?([eE][-+]?\d+)?")
_GERMAN_THOUSANDS = re.compile(r"[-+]?\d{1,3}(\.\d{3})+,\d+")
_ENGLISH_THOUSANDS = re.compile(r"[-+]?\d{1,3}(,\d{3})+\.\d+")
_COMMA_GROUPS = re.compile(r"[-+]?[1-9]\d{0,2}(,\d{3})+")
_POINT_GROUPS = re.compile(r"[-+]?[1-9]\d{0,2}(\.\d{3})+")
_STATED = re.compile(r"sep=(.)", re.IGNORECASE)
_SEPARATORS = (";", "\t", "|", ",")
_NOT_FINITE = ("nan", "inf", "-inf", "+inf")
_EMPTY_UNITS = ("", "-", "1", "none")

MIN_SHARE = 2 / 3
"""Share of the last lines in which a separator stands: titles above the table have other ones."""

MAX_LOOKED_AT = 20
"""Lines by which the separator is chosen."""


@dataclass(frozen=True)
class TextRows:
    """The cells of the rows, and the names of the columns where a row of them or a comment says them.

    decimal_commas : whether the rows look like numbers with decimal commas that are separated by commas.
    """

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
    style = _Decimals.of(texts, separator)
    above = next((at for at, row in enumerate(texts) if any(style.is_number(cell) for cell in row)), 0)
    names = _names(texts[:above], len(texts[above]) if texts else 0, at_blanks=separator is None)
    texts = texts[above:]
    if names is None and comments and texts:
        said = [cell for cell in _split(comments[-1], separator) if cell]
        names = said if len(said) == len(texts[0]) and not any(style.is_number(cell) for cell in said) else None
    if names is None:
        texts = _without_titles(texts, style)
    else:
        numbers = {place for row in texts for place, cell in enumerate(row) if style.is_number(cell)}
        remarks = max(numbers, default=-1) + 1
        texts = [_fit_width(row, len(names), remarks) for row in texts if row[: len(names)] != names]
    doubled = names is not None and bool(texts) and len(texts[0]) >= 2 * len(names) - 2 and separator == ","
    return TextRows([[style.value(cell) for cell in row] for row in texts], names, doubled)


def _separator(lines: Sequence[str]) -> str | None:
    """The character between cells; None for blanks."""
    last = lines[-MAX_LOOKED_AT:]
    if all(_are_comma_numbers(line) for line in last[-3:]):
        return None
    return next((one for one in _SEPARATORS if sum(one in line for line in last) >= MIN_SHARE * len(last)), None)


def _are_comma_numbers(line: str) -> bool:
    """Whether blanks separate at least three numbers, of which one has a decimal comma."""
    cells = line.split()
    numbers = [cell for cell in cells if _COMMA_NUMBER.fullmatch(cell)]
    return len(numbers) >= max(3, len(cells) - 1) and any("," in cell for cell in numbers)


def _split(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return [_bare(cell) for cell in line.split()]
    cells = (
        next(csv.reader([line], delimiter=separator, skipinitialspace=True)) if '"' in line else line.split(separator)
    )
    cells = [_bare(cell) for cell in cells]
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
    def of(cls, rows: Sequence[Sequence[str]], separator: str | None) -> "_Decimals":
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
    units = next((row for row in reversed(above) if _are_units(row)), [])
    both = zip(header, [*units, *[""] * len(header)], strict=False)
    return [f"{name} [{unit}]" if unit.lower() not in _EMPTY_UNITS else name for name, unit in both]


def _are_units(row: list[str]) -> bool:
    known = UNITS.keys() | ANGLES.keys() | {*_EMPTY_UNITS}
    return all(cell.lower() in known for cell in row) and any(cell.lower() not in _EMPTY_UNITS for cell in row)


def _fit_width(row: list[str], width: int, remarks: int) -> list[str]:
    """The row with as many cells as there are names: without empty ones behind, or with those of missing remarks.

    From column `remarks` on no row has a number.
    """
    if row[width:] and not any(row[width:]):
        return row[:width]
    return [*row, *[""] * (width - len(row))] if len(row) >= remarks else row


def _without_titles(rows: list[list[str]], style: _Decimals) -> list[list[str]]:
    """Without the lines between matrices in rows of four, such as `Pose 3:`."""
    are_numbers = [len(row) == 4 and all(style.is_number(cell) for cell in row) for row in rows]
    matrix = [row for row, of_numbers in zip(rows, are_numbers, strict=True) if of_numbers]
    others = [row for row, of_numbers in zip(rows, are_numbers, strict=True) if not of_numbers]
    titles = (
        len(matrix) % 4 == 0 and 4 * len(others) <= len(matrix) and not any(style.is_number(row[0]) for row in others)
    )
    return matrix if titles else rows


def are_names_of_columns(cells: Sequence[str]) -> bool:
    """Whether cells name columns rather than poses: x, y, z among them."""
    last = {words[-1] for cell in cells if (words := words_of(cell))}
    return {"x", "y", "z"} <= last

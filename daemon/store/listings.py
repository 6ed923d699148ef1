"""Rows as records, and pages of them for lists: heavy documents are passed on as stored, and not parsed.

Read over a connection of its own, so that a long list keeps no run waiting for the store.
"""

import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from typing import Any, Generic, TypeVar
from urllib.parse import urlencode

import msgspec
from pydantic import TypeAdapter

from calibration.documents.calibration import AccuracyDocument
from daemon.errors import CursorUnknown
from daemon.model.records import (
    AppliedCalibration,
    CalibrationOrigin,
    Planning,
    RunRecord,
    ScanRecord,
    ScanViewDocument,
)
from daemon.store.damaged_rows import DamagedRow, parse_each
from daemon.store.database import Database

CONDITIONS: dict[str, str] = {
    "kind": "kind = ?",
    "state": "state = ?",
    "since": "created_at >= ?",
    "until": "created_at < ?",
    "accepted": "accepted = ?",
    "name": "instr(lower(name), lower(?)) > 0",
}
"""Of queries, by the name of the parameter. Times are compared as text: stored ones end in Z, given ones do not."""


@dataclass(frozen=True)
class PageFilters:
    """Filters by their names in CONDITIONS; those that are None are not given."""

    filters: Mapping[str, str | bool | None] = field(default_factory=dict)

    @property
    def given(self) -> dict[str, str | bool]:
        """Those that are given; SQLite holds a truth value as 0 or 1."""
        return {name: value for name, value in self.filters.items() if value is not None}

    @property
    def conditions(self) -> list[str]:
        """SQL, with a place for each of `values`."""
        return [CONDITIONS[name] for name in self.given]

    @property
    def values(self) -> list[str | int]:
        """The values of `conditions`, in the same order."""
        return list(self.given.values())

    @property
    def query(self) -> str:
        """The same as part of a URL's query, for the link to the next page: "&kind=verify", or empty."""
        words = {name: str(value).lower() if isinstance(value, bool) else value for name, value in self.given.items()}
        return f"&{urlencode(words)}" if words else ""


NO_FILTERS = PageFilters()


Record = TypeVar("Record")


class Table(Generic[Record]):
    """The rows of one table as frozen dataclasses.

    `compound`: fields that are stored as JSON; `beside`: columns that are not fields, given to `insert` and not read.
    """

    def __init__(
        self, name: str, record: type[Record], compound: Sequence[str] = (), beside: Sequence[str] = ()
    ) -> None:
        self._names = [one.name for one in fields(record)]  # type: ignore[arg-type]
        self._compound, self._adapter = compound, TypeAdapter(record)
        self._json: TypeAdapter[Any] = TypeAdapter(Any)
        columns = [*beside, *self._names]
        marks = ", ".join(f":{column}" for column in columns)
        self.select = f"SELECT {', '.join(self._names)} FROM {name}"
        self._update = f"UPDATE {name} SET {', '.join(f'{column} = :{column}' for column in columns)} WHERE id = :id"
        self._insert = f"INSERT INTO {name} ({', '.join(columns)}) VALUES ({marks})"

    def insert(self, db: sqlite3.Connection, record: Record, **beside: Any) -> None:
        """Insert the record's row; `beside`: also in the place of a field."""
        db.execute(self._insert, self._row(record) | beside)

    def update(self, db: sqlite3.Connection, record: Record) -> bool:
        """Whether there was a row with the record's `id`; it is the record's now."""
        return bool(db.execute(self._update, self._row(record)).rowcount)

    def _row(self, record: Record) -> dict[str, Any]:
        row = {name: getattr(record, name) for name in self._names}
        for name in self._compound:
            row[name] = None if row[name] is None else self._json.dump_json(row[name]).decode()
        return row

    def record(self, row: Sequence[Any], outlined: Mapping[str, type] = {}) -> Record:
        """The record of a row of `select`. Raises ValueError for one that is not what was stored.

        `outlined`: types of compound fields that are made of their outlines, unvalidated: what is within objects and
        lists is not parsed.
        """
        values = dict(zip(self._names, row, strict=True))
        for name in self._compound:
            if values[name] is not None:
                kind, stored = outlined.get(name), values[name]
                values[name] = self._json.validate_json(stored) if kind is None else kind(**_outline(stored))
        return self._adapter.validate_python(values)


_PARTS = msgspec.json.Decoder(dict[str, msgspec.Raw])


def _outline(stored: str) -> dict[str, Any]:
    """A JSON object, with msgspec.Raw in the place of objects and lists. Raises ValueError."""
    parts = _PARTS.decode(stored)
    return {key: part if memoryview(part)[0] in b"{[" else msgspec.json.decode(part) for key, part in parts.items()}


ACCURACY = "CASE WHEN json_valid(document) THEN json_extract(document, '$.accuracy') END"
"""Of a row of calibrations, as JSON."""

_LISTED = """(SELECT rowid, *, CASE WHEN json_valid(document) THEN CASE json_type(document, '$.verdict')
    WHEN 'object' THEN coalesce(json_extract(document, '$.accuracy'), '{}') END END AS accuracy FROM calibrations)"""
APPLIED = Table("applied", AppliedCalibration)
RUNS = Table("runs", RunRecord, compound=("cause", "request", "result", "planning"))
SCANS = Table("scans", ScanRecord)
SCAN_VIEWS = Table(
    "scan_views", ScanViewDocument, compound=("base_T_flange", "joints_deg", "external_axes"), beside=("scan_id",)
)


def views_of(db: sqlite3.Connection, scan_id: str) -> list[ScanViewDocument]:
    """The views of a scan in the order of their arrival. Raises ValueError for one that is not what was stored."""
    rows = db.execute(f"{SCAN_VIEWS.select} WHERE scan_id = ? ORDER BY view", (scan_id,))
    return [SCAN_VIEWS.record(row) for row in rows]


@dataclass(frozen=True)
class CalibrationListing(CalibrationOrigin):
    """A calibration of a list. `camera`: by its name in the settings."""

    camera: str
    accuracy: AccuracyDocument


_CALIBRATIONS = Table(_LISTED, CalibrationListing, compound=("accuracy",))


@dataclass(frozen=True)
class ScanListing:
    """A scan of a list, with its views."""

    scan: ScanRecord
    views: list[ScanViewDocument]

    @property
    def id(self) -> str:
        return self.scan.id


class Listings:
    """Pages, newest first; `before` is the last id of the page before. Each raises CursorUnknown, StorageError.

    A row that is not what was stored is in its page as a DamagedRow.
    """

    def __init__(self, reader: Database) -> None:
        self._reader = reader

    async def runs(
        self, limit: int, before: str | None = None, filters: PageFilters = NO_FILTERS
    ) -> list[RunRecord | DamagedRow]:
        """Up to `limit` runs older than `before`; objects and lists within request, result and plan are msgspec.Raw."""
        parse = partial(RUNS.record, outlined={"request": dict, "result": dict, "planning": Planning})
        return await self._reader.read(
            lambda db: parse_each(parse, read_page(db, RUNS.select, "runs", limit, before, filters))
        )

    async def calibrations(
        self, limit: int, before: str | None = None, filters: PageFilters = NO_FILTERS
    ) -> list[CalibrationListing | DamagedRow]:
        """Up to `limit` calibrations older than `before`."""
        return await self._reader.read(
            lambda db: parse_each(
                _CALIBRATIONS.record, read_page(db, _CALIBRATIONS.select, "calibrations", limit, before, filters)
            )
        )

    async def scans(
        self, limit: int, before: str | None = None, filters: PageFilters = NO_FILTERS
    ) -> list[ScanListing | DamagedRow]:
        """Up to `limit` scans older than `before`, with their views."""

        def read(db: sqlite3.Connection) -> list[ScanListing | DamagedRow]:
            def listing(row: tuple[Any, ...]) -> ScanListing:
                scan = SCANS.record(row)
                return ScanListing(scan, views_of(db, scan.id))

            return parse_each(listing, read_page(db, SCANS.select, "scans", limit, before, filters))

        return await self._reader.read(read)


def read_page(
    db: sqlite3.Connection, query: str, table: str, limit: int, before: str | None, filters: PageFilters = NO_FILTERS
) -> list[Any]:
    """One page, latest insertion first: ordered by rowid and not by time, since the clock may jump back."""
    conditions, values = list(filters.conditions), list(filters.values)
    if before is not None:
        end = db.execute(f"SELECT rowid FROM {table} WHERE id = ?", (before,)).fetchone()
        if end is None:
            raise CursorUnknown(table, before)
        conditions, values = [*conditions, "rowid < ?"], [*values, end[0]]
    where = f"WHERE {' AND '.join(conditions)}" if conditions else ""
    return db.execute(f"{query} {where} ORDER BY rowid DESC LIMIT ?", (*values, limit)).fetchall()

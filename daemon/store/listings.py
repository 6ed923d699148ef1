"""Pages of runs, calibrations and scans for lists: heavy documents are passed on as stored, and not parsed.

Read over a connection of its own, so that a long list keeps no run waiting for the store.
"""

import json
import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Generic, TypeVar

from pydantic import TypeAdapter

from calibration.documents.calibration import AccuracyDocument
from daemon.errors import CursorUnknown
from daemon.model.records import CalibrationOrigin, RunRecord, ScanRecord, ScanViewDocument
from daemon.store.damaged_rows import DamagedRow, parse_each
from daemon.store.database import Database
from daemon.store.page_filters import NO_FILTERS, PageFilters

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
        self._insert = f"INSERT INTO {name} ({', '.join(columns)}) VALUES ({marks})"

    def insert(self, db: sqlite3.Connection, record: Record, **beside: Any) -> None:
        """Insert the record's row."""
        row = {name: getattr(record, name) for name in self._names}
        for name in self._compound:
            row[name] = None if row[name] is None else self._json.dump_json(row[name]).decode()
        db.execute(self._insert, row | beside)

    def record(self, row: Sequence[Any]) -> Record:
        """The record of a row of `select`. Raises ValueError for one that is not what was stored."""
        values = dict(zip(self._names, row, strict=True))
        for name in self._compound:
            values[name] = None if values[name] is None else json.loads(values[name])
        return self._adapter.validate_python(values)


_REQUEST_IS_SOUND = "CASE WHEN json_valid(request) THEN json_type(request) = 'object' ELSE 0 END"
_RESULT_IS_SOUND = (
    "CASE WHEN result IS NULL THEN 1 WHEN json_valid(result) THEN json_type(result) = 'object' ELSE 0 END"
)
_RUNS = (
    f"SELECT *, {_REQUEST_IS_SOUND} AND {_RESULT_IS_SOUND},"
    f" CASE WHEN {_REQUEST_IS_SOUND} THEN json_object('manual', json_extract(request, '$.manual')) END,"
    f" CASE WHEN {_RESULT_IS_SOUND} THEN json_object('calibration_id', json_extract(result, '$.calibration_id'),"
    " 'scan_id', json_extract(result, '$.scan_id')) END FROM runs"
)
ACCURACY = "CASE WHEN json_valid(document) THEN json_extract(document, '$.accuracy') END"
"""Of a row of calibrations, as JSON."""

_CALIBRATIONS = (
    "SELECT id, run_id, created_at, accepted, camera,"
    f" {ACCURACY},"
    " CASE WHEN json_valid(document) THEN json_type(document, '$.verdict') = 'object' ELSE 0 END FROM calibrations"
)
SCANS = Table("scans", ScanRecord)
_SCAN_VIEWS = Table(
    "scan_views", ScanViewDocument, compound=("base_T_flange", "joints_deg", "external_axes"), beside=("scan_id",)
)


def insert_view(db: sqlite3.Connection, scan_id: str, view: ScanViewDocument) -> None:
    """Insert a view of a scan."""
    _SCAN_VIEWS.insert(db, view, scan_id=scan_id)


def views_of(db: sqlite3.Connection, scan_id: str) -> list[ScanViewDocument]:
    """The views of a scan in the order of their arrival. Raises ValueError for one that is not what was stored."""
    rows = db.execute(f"{_SCAN_VIEWS.select} WHERE scan_id = ? ORDER BY view", (scan_id,))
    return [_SCAN_VIEWS.record(row) for row in rows]


@dataclass(frozen=True)
class RunListing:
    """A run of a list. `request` and `result` are JSON as stored; `run` holds of them what its links need."""

    run: RunRecord
    request: str
    result: str | None

    @property
    def id(self) -> str:
        return self.run.id

    @classmethod
    def of(cls, run: RunRecord) -> "RunListing":
        return cls(run, json.dumps(run.request), None if run.result is None else json.dumps(run.result))

    @classmethod
    def of_row(cls, row: tuple[Any, ...]) -> "RunListing":
        *columns, sound, manual, linked = row
        if not sound:
            raise ValueError("request or result is no JSON object")
        request, result = columns[8], columns[9]
        columns[8], columns[9] = manual, None
        links = {key: value for key, value in json.loads(linked).items() if value is not None}
        return cls(replace(RunRecord.of(tuple(columns)), result=links or None), request, result)


@dataclass(frozen=True)
class CalibrationListing(CalibrationOrigin):
    """A calibration of a list. `camera`: by its name in the settings."""

    camera: str
    accuracy: AccuracyDocument

    @classmethod
    def of_row(cls, row: tuple[Any, ...]) -> "CalibrationListing":
        found_id, run_id, created_at, accepted, camera, accuracy, sound = row
        if not sound:
            raise ValueError("the document is no calibration")
        return cls(
            found_id, run_id, created_at, bool(accepted), camera, AccuracyDocument.model_validate_json(accuracy or "{}")
        )


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
    ) -> list[RunListing | DamagedRow]:
        """Up to `limit` runs older than `before`."""
        return await self._reader.read(
            lambda db: parse_each(RunListing.of_row, read_page(db, _RUNS, "runs", limit, before, filters))
        )

    async def calibrations(
        self, limit: int, before: str | None = None, filters: PageFilters = NO_FILTERS
    ) -> list[CalibrationListing | DamagedRow]:
        """Up to `limit` calibrations older than `before`."""

        def read(db: sqlite3.Connection) -> list[CalibrationListing | DamagedRow]:
            rows = read_page(db, _CALIBRATIONS, "calibrations", limit, before, filters)
            return parse_each(CalibrationListing.of_row, rows)

        return await self._reader.read(read)

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
    db: sqlite3.Connection,
    query: str,
    table: str,
    limit: int,
    before: str | None,
    filters: PageFilters = NO_FILTERS,
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

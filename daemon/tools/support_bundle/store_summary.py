"""Summary of the store, read-only beside a running daemon: counts, latest runs and calibrations, no keys."""

import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from daemon.store.audit_log import check_audit_log
from daemon.store.database import DATABASE_NAME

MAX_ROWS = 50
MAX_EVENTS = 500


def summarise_store(folder: Path) -> dict[str, Any]:
    """Schema, integrity, row counts, history and calibrations. Raises sqlite3.Error."""
    with _open(folder) as db:
        return {
            "schema": db.execute("PRAGMA user_version").fetchone()[0],
            "integrity": [row[0] for row in db.execute("PRAGMA quick_check(5)")],
            "tables": [{"name": name, "rows": rows} for name, rows in _counts(db)],
            "applied": _rows(db, "SELECT calibration_id, applied_at, applied_by FROM applied ORDER BY sequence DESC"),
            "calibrations": _rows(
                db, "SELECT id, run_id, created_at, accepted FROM calibrations ORDER BY created_at DESC"
            ),
        }


def last_runs(folder: Path) -> list[dict[str, Any]]:
    """The latest 50 runs, newest first, with cause and result; without the points of verifications."""
    with _open(folder) as db:
        rows = _rows(
            db,
            "SELECT id, kind, state, station, stations, code, cause, fix, created_at, updated_at, request, result"
            " FROM runs ORDER BY created_at DESC, id DESC",
        )
    return [{**row, "request": _parse(row["request"]), "result": _shorten(_parse(row["result"]))} for row in rows]


def last_events(folder: Path) -> list[dict[str, Any]]:
    """The latest 500 events, newest first. Raises sqlite3.Error."""
    with _open(folder) as db:
        rows = _rows(db, "SELECT number, kind, data FROM events ORDER BY number DESC", MAX_EVENTS)
    return [{**row, "data": _parse(row["data"] or None)} for row in rows]


def summarise_audit(folder: Path) -> dict[str, Any]:
    """Whether the audit log is whole, and its latest 50 rows. Raises StorageError, sqlite3.Error."""
    count, flaws = check_audit_log(folder / DATABASE_NAME, [])
    with _open(folder) as db:
        rows = _rows(db, "SELECT sequence, at, actor, role, action, subject, detail FROM audit ORDER BY sequence DESC")
    latest = [{**row, "detail": _parse(row["detail"])} for row in rows]
    return {"whole": not flaws, "rows": count, "flaws": flaws[:20], "latest": latest}


def _open(folder: Path) -> closing[sqlite3.Connection]:
    """The database of a store, for reading only. Raises sqlite3.Error."""
    return closing(sqlite3.connect(f"{(folder / DATABASE_NAME).resolve().as_uri()}?mode=ro", uri=True, timeout=2))


def _counts(db: sqlite3.Connection) -> Iterator[tuple[str, int]]:
    names = [row[0] for row in db.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")]
    for name in names:
        quoted = name.replace('"', '""')
        yield name, db.execute(f'SELECT COUNT(*) FROM "{quoted}"').fetchone()[0]  # noqa: S608 - a name, quoted


def _rows(db: sqlite3.Connection, query: str, limit: int = MAX_ROWS) -> list[dict[str, Any]]:
    cursor = db.execute(f"{query} LIMIT {limit}")
    names = [column[0] for column in cursor.description]
    return [dict(zip(names, row, strict=True)) for row in cursor]


def _parse(text: str | None) -> Any:
    return None if text is None else json.loads(text)


def _shorten(result: Any) -> Any:
    if isinstance(result, dict) and isinstance(result.get("verification"), dict):
        return {**result, "verification": {**result["verification"], "points": "left out"}}
    return result

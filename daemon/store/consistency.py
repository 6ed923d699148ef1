"""Finds what is wrong with a store: damaged, cut off, rewritten, moved or replaced. Only reads."""

import os
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from daemon.access.audit_chain import AuditAnchor, AuditRow, find_flaws
from daemon.errors import StorageInconsistent
from daemon.store.anchor_file import ANCHOR_NAME, read_anchor
from daemon.store.database import DATABASE_NAME, storage_errors

NO_LIMIT_S = 1e9
ALL_ROWS = 1 << 62
ACKNOWLEDGED = "acknowledge"
"""Action of the audit row that `handeyed audit acknowledge` appends: what is wrong with rows before it is known."""

AUDIT_COLUMNS = "sequence, at, actor, role, action, subject, detail, hash"

_RESTORE = "stop the daemon, keep a copy of the folder, and restore a backup into an empty one"
_ACKNOWLEDGE = (
    "find out why ('handeyed audit verify CONFIG'; a disk that lost what it had confirmed, or somebody's hand); then"
    " restore a backup, or accept the loss: stop the daemon and run 'handeyed audit acknowledge CONFIG'"
)
_PROGRESS_STEPS = 10_000
"""SQLite's instructions between two looks at the time."""


@dataclass(frozen=True)
class StoreFault:
    """Why the store must not be written: a sentence, and what to do."""

    what: str
    fix: str


@contextmanager
def open_read_only(database: Path) -> Iterator[sqlite3.Connection]:
    """A snapshot of the database through a connection of its own, which changes nothing. Raises StorageError."""
    with storage_errors(database):
        uri = f"{database.resolve().as_uri()}?mode=ro"
        with closing(sqlite3.connect(uri, uri=True, isolation_level=None)) as connection:
            connection.execute("BEGIN")  # one snapshot for every query
            yield connection


def find_fault(database: Path, limit_s: float = NO_LIMIT_S, latest_rows: int = ALL_ROWS) -> StoreFault | None:
    """The fault of a stored database, its audit log and anchor; None when there is none, or no database yet.

    Pages that were not looked at after `limit_s`, and rows before the `latest_rows` of the audit log, are left out.
    Raises StorageError when it cannot be read.
    """
    if not database.exists():
        return _find_orphans(database.parent)
    anchor = read_anchor(database.parent)
    with open_read_only(database) as connection:
        try:
            return _find_damage(database, connection, limit_s) or find_audit_fault(
                database.parent, connection, anchor, latest_rows
            )
        except sqlite3.DatabaseError as error:
            if getattr(error, "sqlite_errorcode", 0) & 0xFF in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB):
                return StoreFault(f"{database} is damaged ({error})", _RESTORE)
            raise


def find_damage(database: Path) -> StoreFault | None:
    """What is wrong with the pages of a database. Raises StorageError."""
    with open_read_only(database) as connection:
        return _find_damage(database, connection, NO_LIMIT_S)


def _find_orphans(folder: Path) -> StoreFault | None:
    left = [name for name in (ANCHOR_NAME, "runs", "scans") if (folder / name).exists()]
    if not left:
        return None
    return StoreFault(
        f"there is no {DATABASE_NAME} in {folder}, or it is empty, though {' and '.join(left)} are there",
        "put it back; or move all of it away, and restore a backup or begin anew",
    )


def _find_damage(database: Path, connection: sqlite3.Connection, limit_s: float) -> StoreFault | None:
    ends_s = time.monotonic() + limit_s
    connection.set_progress_handler(lambda: time.monotonic() > ends_s, _PROGRESS_STEPS)
    try:
        (found,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    except sqlite3.OperationalError as error:
        if error.sqlite_errorcode != sqlite3.SQLITE_INTERRUPT:
            raise
        return None
    finally:
        connection.set_progress_handler(None, 0)
    return None if found == "ok" else StoreFault(f"{database} is damaged ({found})", _RESTORE)


def find_audit_fault(
    folder: Path, connection: sqlite3.Connection, anchor: AuditAnchor | None, latest_rows: int = ALL_ROWS
) -> StoreFault | None:
    """Compare the log with the anchor, and check its chain from the last acknowledgement on.

    The connection is in a transaction, so that every query sees the same rows; the anchor was read before it, since the
    log grows. Raises sqlite3.Error.
    """
    if connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'audit'").fetchone() is None:
        return _find_orphans(folder) if anchor or connection.execute("PRAGMA user_version").fetchone() == (0,) else None
    (acknowledged,) = connection.execute(
        "SELECT coalesce(max(sequence), 1) FROM audit WHERE action = ?", (ACKNOWLEDGED,)
    ).fetchone()
    (end,) = connection.execute("SELECT coalesce(max(sequence), 0) FROM audit").fetchone()
    first = max(acknowledged, min(end, anchor.sequence if anchor else end) - latest_rows)
    rows = [
        AuditRow(*row)
        for row in connection.execute(
            f"SELECT {AUDIT_COLUMNS} FROM audit WHERE sequence >= "
            "(SELECT coalesce(max(sequence), 0) FROM audit WHERE sequence < ?) ORDER BY sequence", (first,)
        )
    ]  # fmt: skip
    counted = connection.execute("SELECT seq FROM sqlite_sequence WHERE name = 'audit'").fetchone()
    known = rows.pop(0) if rows and rows[0].sequence < first else None
    flaws = find_flaws(rows, [] if anchor is None else [anchor], known)
    if counted is not None and counted[0] > end:
        flaws.append(f"{counted[0]} rows were written, the last one there is row {end}")
    return StoreFault(f"the audit log in {folder} is not whole: {flaws[0]}", _ACKNOWLEDGE) if flaws else None


def count_missing_files(database: Path) -> int:
    """How many files the views of scans name that are not there. Raises StorageError."""
    with open_read_only(database) as connection:
        names = connection.execute("SELECT scan_id, file FROM scan_views").fetchall()
    return sum(not (database.parent / "scans" / scan_id / file).is_file() for scan_id, file in names)


@dataclass
class WriteGuard:
    """Refuses writing to a store with a fault, or one whose folder or files are no longer what was opened.

    They are known by device and inode, so that a moved or replaced one is noticed.
    """

    folder: Path
    fault: StoreFault | None = None
    _known: dict[Path, tuple[int, int]] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        names = ("", "-wal", "-shm", ".in-use")
        for path in (self.folder, *(self.folder / f"{DATABASE_NAME}{suffix}" for suffix in names)):
            if (identity := _identity(path)) is not None:
                self._known[path] = identity

    def find_fault(self) -> StoreFault | None:
        """The fault that was found, or the first path at which there is no longer what was opened."""
        if self.fault is not None:
            return self.fault
        for path, identity in self._known.items():
            if (now := _identity(path)) != identity:
                happened = "moved or removed" if now is None else "replaced"
                return StoreFault(
                    f"{path} was {happened} while the daemon had it open",
                    "put back what was there; or stop the daemon, see to the store, and start it again",
                )
        return None

    def __call__(self) -> None:
        """Raises StorageInconsistent."""
        if (fault := self.find_fault()) is not None:
            raise StorageInconsistent(fault.what, fault.fix)


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        status = os.stat(path)  # noqa: PTH116 - four of them before and after each write
    except OSError:
        return None
    return status.st_dev, status.st_ino

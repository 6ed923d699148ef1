"""Back up the store into one tar file while the daemon runs, and restore it into an empty folder.

The copy of the database is a snapshot. Files are written before the rows that name them and never changed afterwards,
so every file that the snapshot names exists.
"""

import json
import os
import shutil
import sqlite3
import tarfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from daemon.errors import BackupUnusable, StorageError
from daemon.runtime.durable_files import fsync_folder, rename_durably
from daemon.store.audit_log import ANCHOR_NAME, check_audit_log
from daemon.store.database import DATABASE_NAME, Database, copy_database, storage_errors
from daemon.store.lock import FolderLock
from daemon.store.schema import SCHEMA_VERSION

MANIFEST = "handeyed-backup.json"
FOLDERS = ("runs", "scans")


def back_up(store: Path, database: Database, target: Path, made_at: str) -> int:
    """Write `target`, a tar file, atomically; returns the number of files in it. Raises StorageError."""
    part = target.with_name(f".{target.name}.part")
    copy = target.with_name(f".{target.name}.sqlite")
    with storage_errors(target):
        try:
            database.read_now(lambda db: copy_database(db, copy))
            with tarfile.open(part, "w") as archive:
                manifest = part.with_name(f".{target.name}.json")
                manifest.write_text(json.dumps({"made_at": made_at, "schema": SCHEMA_VERSION, "format": 1}))
                archive.add(manifest, MANIFEST)
                manifest.unlink()
                archive.add(copy, DATABASE_NAME)
                count = 1
                for file in _files(store):
                    archive.add(file, str(file.relative_to(store)), recursive=False)
                    count += 1
            rename_durably(part, target)
        finally:
            for rest in (part, copy, part.with_name(f".{target.name}.json")):
                rest.unlink(missing_ok=True)
    return count


def _files(store: Path) -> Iterator[Path]:
    """Files to back up: not temporary ones, which begin with a dot, nor merged clouds, which can be recomputed."""
    if (store / ANCHOR_NAME).exists():
        yield store / ANCHOR_NAME
    for name in FOLDERS:
        for file in sorted((store / name).glob("*/*")):
            if file.is_file() and not file.name.startswith((".", "merged-")):
                yield file


def restore(source: Path, store: Path) -> int:
    """Restore a backup into `store`, which must not hold a store yet; returns the number of files.

    Raises BackupUnusable, StorageError.
    """
    lock = FolderLock(store / f"{DATABASE_NAME}.in-use")
    try:
        if (store / DATABASE_NAME).exists():
            raise BackupUnusable(f"{store} holds a store already", "move it away first; nothing is overwritten")
        unpacked = store / ".restoring"
        with storage_errors(store):
            shutil.rmtree(unpacked, ignore_errors=True)
            unpacked.mkdir()
        try:
            count = _unpack(source, unpacked)
            _require_whole(source, unpacked)
            _move_in(unpacked, store)
        finally:
            shutil.rmtree(unpacked, ignore_errors=True)
        return count
    finally:
        lock.release()


def _unpack(source: Path, unpacked: Path) -> int:
    fix = "give a file that 'handeyed backup' made"
    try:
        with tarfile.open(source, "r:") as archive:
            names = archive.getnames()
            if MANIFEST not in names or DATABASE_NAME not in names:
                raise BackupUnusable(f"{source} is no backup of handeyed", fix)
            archive.extractall(unpacked, filter="data")
        schema = json.loads((unpacked / MANIFEST).read_text())["schema"]
    except (tarfile.TarError, ValueError, KeyError, TypeError) as error:
        raise BackupUnusable(f"{source} cannot be read ({error})", fix) from None
    except OSError as error:
        raise StorageError(f"{source}: {(error.strerror or str(error)).lower()}", fix) from None
    if schema > SCHEMA_VERSION:
        what = f"{source} was made by a newer handeyed (schema {schema}, this one knows {SCHEMA_VERSION})"
        raise BackupUnusable(what, "install that version first")
    (unpacked / MANIFEST).unlink()
    return len(names) - 1


def _require_whole(source: Path, unpacked: Path) -> None:
    database = unpacked / DATABASE_NAME
    try:
        with closing(sqlite3.connect(database)) as connection:
            (integrity,) = connection.execute("PRAGMA integrity_check").fetchone()
            files = connection.execute("SELECT 'scans/' || scan_id || '/' || file FROM scan_views").fetchall()
    except sqlite3.Error as error:
        integrity, files = str(error), []
    if integrity != "ok":
        raise BackupUnusable(f"the database in {source} is damaged ({integrity})", "use an older backup")
    missing = [file for (file,) in files if not (unpacked / file).exists()]
    if missing:
        raise BackupUnusable(f"{source} lacks {missing[0]} and {len(missing) - 1} more", "use another backup")
    if flaws := check_audit_log(database, [])[1]:
        raise BackupUnusable(f"the audit log in {source} is not whole: {flaws[0]}", "use another backup")


def _move_in(unpacked: Path, store: Path) -> None:
    """Move the files into the store, the database last, so that an interrupted restore leaves no store."""
    with storage_errors(store):
        for file in sorted(unpacked.rglob("*")):
            if file.is_file():
                with file.open("rb+") as content:
                    os.fsync(content.fileno())
        for entry in sorted(unpacked.iterdir(), key=lambda entry: entry.name == DATABASE_NAME):
            target = store / entry.name
            if target.is_dir():
                shutil.rmtree(target)
            entry.replace(target)
        fsync_folder(store)

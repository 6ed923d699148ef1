"""Backs up the store into one tar file while the daemon runs. `daemon.store.restore` reads it.

The copy of the database is a snapshot. Files are written before the rows that name them and never changed afterwards,
so every file that the snapshot names exists. The last file of a backup is its manifest, with the hash of every other:
a backup that was cut off has none.
"""

import hashlib
import io
import os
import tarfile
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO

from pydantic import Field

from calibration.documents.validation import Document
from daemon.runtime.durable_files import create_file, rename_durably
from daemon.store.anchor_file import ANCHOR_NAME
from daemon.store.database import DATABASE_NAME, SCHEMA_VERSION, Database, copy_database, storage_errors
from registration.io.regular_file import require_replaceable

MANIFEST = "handeyed-backup.json"
FORMAT = 2
"""1, before hashes were in the manifest, can be restored, too."""

FOLDERS = ("runs", "scans")


class BackupManifestDocument(Document):
    """The whole of handeyed-backup.json; `files` is not in format 1."""

    heading = "handeyed-backupjson"

    made_at: str
    """UTC, ISO 8601."""
    schema_number: int = Field(alias="schema", description="Version of the database.")
    format: int
    """Version of the backup."""
    files: dict[str, str] = Field(default_factory=dict)
    """SHA-256 of every other file in the backup, by name."""


def back_up(store: Path, database: Database, target: Path, made_at: str) -> int:
    """Write `target`, a tar file for its owner only (mode 0600), atomically; returns the number of files in it.

    Raises StorageError, also where `target` is no regular file; StorageInconsistent for a store that `restore` would
    refuse.
    """
    with storage_errors(target), tempfile.TemporaryDirectory(prefix=".handeyed-backup-", dir=target.parent) as work:
        require_replaceable(target)
        part = Path(work, "backup.tar")
        with create_file(part, 0o600, new=True) as file:
            count = write_backup(store, database, file, made_at, Path(work))
        rename_durably(part, target)
    return count


def write_backup(store: Path, database: Database, file: IO[bytes], made_at: str, folder: Path) -> int:
    """As `back_up`, into a file or pipe, from its first byte to its last; the database is copied in `folder` first.

    What `file` raises is left to the caller, who knows its name.
    """
    database.guard()
    with storage_errors(store):
        made = tempfile.TemporaryDirectory(prefix=".handeyed-backup-", dir=folder)
    with made as work:
        copy = Path(work, DATABASE_NAME)
        with storage_errors(store):
            anchor = _anchor(store)  # before the snapshot, so that the log in it contains the anchored row
            database.read_now(lambda db: copy_database(db, copy))
        with tarfile.open(fileobj=file, mode="w|") as archive:
            hashes = {DATABASE_NAME: _add_file(archive, DATABASE_NAME, copy)}
            if anchor is not None:
                hashes[ANCHOR_NAME] = _add(archive, ANCHOR_NAME, io.BytesIO(anchor), len(anchor))
            for path in _files(store):
                name = str(path.relative_to(store))
                with suppress(FileNotFoundError):  # pictures of old runs may be removed meanwhile
                    hashes[name] = _add_file(archive, name, path)
            manifest = BackupManifestDocument(made_at=made_at, schema=SCHEMA_VERSION, format=FORMAT, files=hashes)
            content = manifest.model_dump_json(by_alias=True).encode()
            _add(archive, MANIFEST, io.BytesIO(content), len(content))
    return len(hashes)


class _HashingReader(io.RawIOBase):
    """Reads a file and hashes what is read."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file, self.sha256 = file, hashlib.sha256()

    def read(self, size: int = -1) -> bytes:
        block = self._file.read(size)
        self.sha256.update(block)
        return block


def _add_file(archive: tarfile.TarFile, name: str, path: Path) -> str:
    with path.open("rb") as file:
        return _add(archive, name, file, os.fstat(file.fileno()).st_size)


def _add(archive: tarfile.TarFile, name: str, file: IO[bytes], size: int) -> str:
    """Append `size` bytes; returns their hexadecimal SHA-256."""
    member, reader = tarfile.TarInfo(name), _HashingReader(file)
    member.size, member.mode = size, 0o600
    archive.addfile(member, reader)
    return reader.sha256.hexdigest()


def _anchor(store: Path) -> bytes | None:
    try:
        return (store / ANCHOR_NAME).read_bytes()
    except FileNotFoundError:
        return None


def _files(store: Path) -> Iterator[Path]:
    """Files to back up: not temporary ones, which begin with a dot, nor merged clouds, which can be recomputed."""
    for name in FOLDERS:
        for file in sorted((store / name).glob("*/*")):
            if file.is_file() and not file.is_symlink() and not file.name.startswith((".", "merged-")):
                yield file

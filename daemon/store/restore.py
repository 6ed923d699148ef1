"""Restores a backup into an empty store folder; nothing that is there is changed, moved or removed.

The backup is unpacked and checked in `.restoring`, which nobody reads. The rename of that folder to `.restored` commits
the restore: what is in it is then moved into the store, the database last, and if that is interrupted the next one that
opens the store continues. An interruption before the rename leaves nothing but `.restoring`.
"""

import hashlib
import json
import os
import re
import shutil
import stat
import tarfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from daemon.errors import BackupUnusable, StorageError
from daemon.runtime.durable_files import create_file, make_folder
from daemon.store.backup import FOLDERS, FORMAT, MANIFEST, BackupManifestDocument
from daemon.store.consistency import NO_LIMIT_S, count_missing_files, find_fault
from daemon.store.database import DATABASE_NAME, SCHEMA_VERSION, storage_errors
from daemon.store.opening import CHECKED, LOCK_NAME, FolderLock, finish_restore
from daemon.store.retention import AGES_NAME
from registration.io.durable_file import fsync_path

UNPACKED = ".restoring"

_NAME = re.compile(
    rf"{re.escape(DATABASE_NAME)}|audit-anchor\.json|{re.escape(MANIFEST)}"
    r"|(?:runs|scans)/[A-Za-z0-9_-]+/[A-Za-z0-9_-][A-Za-z0-9._-]*"
)
"""Names of files in a backup: the database, the anchor, the manifest, and files in a run's or scan's folder."""

_HEADING = f"docs/formats.md#{BackupManifestDocument.heading}"

_MAX_MANIFEST_BYTES = 1 << 28
_BLOCK_BYTES = 1 << 20
_FIX = "give a file that 'handeyed backup' made"


@dataclass
class _Unpacked:
    """What was in a backup: the hash of each file, and the manifest."""

    hashes: dict[str, str] = field(default_factory=dict)
    manifest: bytes = b""


def restore(source: Path, store: Path) -> int:
    """Restore a backup into `store`, which must hold nothing of a store; returns the number of files.

    Raises BackupUnusable, StorageInUse, StorageError.
    """
    lock = FolderLock(store)
    try:
        finish_restore(store)
        _require_empty(store)
        unpacked = store / UNPACKED
        with storage_errors(store):
            shutil.rmtree(unpacked, ignore_errors=True)
            unpacked.mkdir(mode=0o700)
        try:
            found = _unpack(source, unpacked)
            _require_complete(source, found)
            _require_whole(source, unpacked)
            with storage_errors(store):
                for path in (unpacked, *unpacked.rglob("*")):
                    fsync_path(path)
                unpacked.rename(store / CHECKED)
                fsync_path(store)
        except BaseException:
            shutil.rmtree(unpacked, ignore_errors=True)
            raise
        finish_restore(store)
        _require_whole(source, store)
        return len(found.hashes)
    finally:
        lock.release()


def _require_empty(store: Path) -> None:
    with storage_errors(store):
        names = {entry.name for entry in store.iterdir()} - {LOCK_NAME}
    own = (DATABASE_NAME, "audit-anchor")
    there = sorted(name for name in names if name in (*FOLDERS, AGES_NAME) or name.startswith(own))
    if there:
        raise BackupUnusable(
            f"{store} holds a store already, or a part of one: {', '.join(there)}",
            "stop the daemon and move all of it away first; restore changes nothing that is there",
        )


def _unpack(source: Path, unpacked: Path) -> _Unpacked:
    """Write the files of the tar file into `unpacked`: regular ones with expected names, no more bytes than it has."""
    try:
        file = os.fdopen(os.open(source, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb")
    except OSError as error:
        raise StorageError(f"{source}: {(error.strerror or str(error)).lower()}", _FIX) from None
    with file, storage_errors(unpacked.parent):
        status, found = os.fstat(file.fileno()), _Unpacked()
        if not stat.S_ISREG(status.st_mode):
            raise BackupUnusable(f"{source} is no file", _FIX)
        try:
            with tarfile.open(fileobj=file, mode="r:") as archive:
                for member in archive:
                    _require_regular(source, member, status.st_size, found)
                    content = archive.extractfile(member)
                    assert content is not None  # of a regular file
                    if member.name == MANIFEST:
                        found.manifest = content.read(_MAX_MANIFEST_BYTES)
                    else:
                        found.hashes[member.name] = _write(unpacked / member.name, content)
        except (tarfile.TarError, ValueError, EOFError, RecursionError, OverflowError) as error:
            raise BackupUnusable(f"{source} cannot be read ({error})", _FIX) from None
    return found


def _require_regular(source: Path, member: tarfile.TarInfo, size: int, found: _Unpacked) -> None:
    regular = member.type in (tarfile.REGTYPE, tarfile.AREGTYPE) and not member.issparse()
    if not regular or not _NAME.fullmatch(member.name):
        raise BackupUnusable(f"{source} is no backup of handeyed: it holds {member.name[:80]!r}", _FIX)
    if member.size < 0 or member.offset_data + member.size > size:
        raise BackupUnusable(f"{source} cannot be read ({member.name} is cut off)", _FIX)
    if member.name in found.hashes or (member.name == MANIFEST and found.manifest):
        raise BackupUnusable(f"{source} cannot be read ({member.name} is in it twice)", _FIX)


def _write(target: Path, content: IO[bytes]) -> str:
    """Write a new file; returns its hexadecimal SHA-256."""
    make_folder(target.parent)
    sha256 = hashlib.sha256()
    with create_file(target, new=True) as file:
        while block := content.read(_BLOCK_BYTES):
            file.write(block)
            sha256.update(block)
    return sha256.hexdigest()


def _require_complete(source: Path, found: _Unpacked) -> None:
    """Compare the manifest with the files that were in the backup."""
    if not found.manifest or DATABASE_NAME not in found.hashes:
        raise BackupUnusable(f"{source} is no backup of handeyed, or its end is missing", _FIX)
    try:
        manifest: dict[str, Any] = json.loads(found.manifest)
        schema, version = int(manifest["schema"]), int(manifest["format"])
        hashes = dict(manifest["files"]) if version > 1 else found.hashes
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise BackupUnusable(f"{source} cannot be read ({MANIFEST}: {error})", f"{_FIX} ({_HEADING})") from None
    if schema > SCHEMA_VERSION or version > FORMAT:
        what = f"{source} was made by a newer handeyed (schema {schema}, this one knows {SCHEMA_VERSION})"
        raise BackupUnusable(what, "install that version first")
    wrong = sorted(name for name in {*hashes, *found.hashes} if hashes.get(name) != found.hashes.get(name))
    if wrong:
        raise BackupUnusable(
            f"{source} is damaged: {wrong[0]} and {len(wrong) - 1} more are not as they were backed up",
            "use another backup",
        )


def _require_whole(source: Path, folder: Path) -> None:
    """Check database, audit log and the files of scans in `folder`."""
    database = folder / DATABASE_NAME
    if (fault := find_fault(database, NO_LIMIT_S)) is not None:
        raise BackupUnusable(f"what is in {source} is damaged: {fault.what}", "use another backup")
    if missing := count_missing_files(database):
        raise BackupUnusable(f"{source} lacks {missing} files of scans", "use another backup")

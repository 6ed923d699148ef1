"""Open the store for a command, whether a daemon is running or not."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from daemon.errors import StorageError, StorageInUse
from daemon.store.database import DATABASE_NAME, Database
from daemon.store.lock import FolderLock


@contextmanager
def open_offline(folder: Path) -> Iterator[Database]:
    """The database of the store in `folder`; it is not migrated while a daemon uses it.

    Raises StorageError, also when the folder belongs to another user: files written here would be closed to the daemon.
    """
    existing = next(place for place in (folder, *folder.parents) if place.exists())
    owner = existing.stat().st_uid
    if owner != os.geteuid():
        raise StorageError(
            f"{existing} belongs to another user (number {owner})", "run the command as that user: sudo -u handeyed ..."
        )
    lock: FolderLock | None = None
    with suppress(StorageInUse):
        lock = FolderLock(folder / f"{DATABASE_NAME}.in-use")
    try:
        database = Database(folder / DATABASE_NAME, migrate=lock is not None)
        try:
            yield database
        finally:
            database.close_now()
    finally:
        if lock is not None:
            lock.release()

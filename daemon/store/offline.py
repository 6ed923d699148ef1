"""Open the store for a command, whether a daemon is running or not."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from daemon.errors import StorageError, StorageInUse
from daemon.store.consistency import OpenFiles
from daemon.store.database import DATABASE_NAME, Database
from daemon.store.lock import FolderLock
from daemon.store.opening import LockedStore, WriteGuard


@contextmanager
def open_offline(folder: Path) -> Iterator[Database]:
    """The database of the store in `folder`; it is not migrated while a daemon uses it.

    Raises StorageError, also when the folder belongs to another user: files written here would be closed to the daemon.
    """
    require_owner(folder)
    try:
        opened = LockedStore(folder)
    except StorageInUse:
        database = Database(folder / DATABASE_NAME, migrate=False)
        database.guard = WriteGuard(OpenFiles(folder))
        try:
            yield database
        finally:
            database.close_now()
        return
    try:
        yield opened.database
    finally:
        opened.close()


@contextmanager
def open_despite_faults(folder: Path) -> Iterator[Database]:
    """The database of a store that no daemon uses, unchecked. Raises StorageError, StorageInUse."""
    require_owner(folder)
    lock = FolderLock(folder)
    try:
        database = Database(folder / DATABASE_NAME)
        try:
            yield database
        finally:
            database.close_now()
    finally:
        lock.release()


def require_owner(folder: Path) -> None:
    """Raises StorageError when the folder, or where it would be made, belongs to another user."""
    existing = next(place for place in (folder, *folder.parents) if place.exists())
    owner = existing.stat().st_uid
    if owner != os.geteuid():
        raise StorageError(
            f"{existing} belongs to another user (number {owner})", "run the command as that user: sudo -u handeyed ..."
        )

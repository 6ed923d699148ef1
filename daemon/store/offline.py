"""The store as a command visits it: beside a daemon that runs, or alone."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from daemon.errors import StorageError, StorageInUse
from daemon.store.database import DATABASE_NAME, Database
from daemon.store.lock import FolderHold


@contextmanager
def visiting(folder: Path) -> Iterator[Database]:
    """The database of the store in `folder`; while a daemon has it, it is never migrated under that daemon.

    Raises StorageError: also for another user's store, where files of ours would lock the daemon out.
    """
    existing = next(place for place in (folder, *folder.parents) if place.exists())
    owner = existing.stat().st_uid
    if owner != os.geteuid():
        raise StorageError(
            f"{existing} belongs to another user (number {owner})", "run the command as that user: sudo -u handeyed ..."
        )
    hold: FolderHold | None = None
    with suppress(StorageInUse):
        hold = FolderHold(folder / f"{DATABASE_NAME}.in-use")
    try:
        database = Database(folder / DATABASE_NAME, migrate=hold is not None)
        try:
            yield database
        finally:
            database.close_now()
    finally:
        if hold is not None:
            hold.release()

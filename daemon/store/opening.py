"""Opens a store: locked, restored to the end, checked, and guarded against writing where it should not.

The lock allows one daemon per store: a second would mark the first one's run as interrupted.
"""

import fcntl
import os
import sqlite3
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

from daemon.errors import StorageError, StorageInconsistent, StorageInUse
from daemon.runtime.durable_files import make_folder
from daemon.runtime.failpoints import NO_FAILPOINTS, Failpoints
from daemon.store.consistency import WriteGuard, find_fault
from daemon.store.database import DATABASE_NAME, Database, storage_errors
from registration.io.durable_file import fsync_path

LOCK_NAME = f"{DATABASE_NAME}.in-use"
"""In the store's folder."""


class FolderLock:
    """Locks a folder from construction to `release`; the system releases it when the process ends.

    The folder itself is locked, so that removing the lock file lets nobody in; the file shows that the store is in use.
    """

    def __init__(self, folder: Path) -> None:
        """Lock the store in `folder`, which is made if need be. Raises StorageInUse, StorageError."""
        self._held: list[int] = []
        try:
            with storage_errors(folder):
                make_folder(folder)
                self._lock(os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC))
                self._lock(os.open(folder / LOCK_NAME, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o640))
        except BaseException as error:
            self.release()
            if isinstance(error.__cause__, BlockingIOError):
                raise StorageInUse(
                    f"{folder} is in use by another handeyed",
                    "stop that one, or give this one its own [storage] folder",
                ) from None
            raise

    def _lock(self, descriptor: int) -> None:
        self._held.append(descriptor)
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def release(self) -> None:
        for descriptor in self._held:
            os.close(descriptor)
        self._held.clear()


MAX_CHECK_S = 5.0
"""How long the start looks at the pages of the database; the rest is looked at while the daemon works."""

MAX_CHECK_ROWS = 10_000
"""How many of the latest rows of the audit log the start checks."""

CHECKED = ".restored"
"""In the store's folder: a backup that `daemon.store.restore` has unpacked and checked, until it is moved in."""


def finish_restore(store: Path) -> None:
    """Move a checked backup into the store, if there is one that an interrupted `restore` left. Raises StorageError.

    The caller holds the store's lock.
    """
    checked = store / CHECKED
    if not checked.is_dir():
        return
    with storage_errors(store):
        for entry in sorted(checked.iterdir(), key=lambda entry: entry.name == DATABASE_NAME):
            target = store / entry.name
            if os.path.lexists(target):
                raise StorageError(
                    f"a restore into {store} cannot be finished: {entry.name} is there already", f"move {target} away"
                )
            if entry.name == DATABASE_NAME:
                fsync_path(store)
            entry.rename(target)
        fsync_path(store)
        checked.rmdir()


def roll_back(path: Path) -> None:
    """Undo what a power cut interrupted before the database had its write-ahead log. Raises StorageError.

    A connection that only reads cannot do this. Such a journal is there while the database is made.
    """
    if path.exists() and path.with_name(f"{path.name}-journal").exists():
        with storage_errors(path), closing(sqlite3.connect(path)) as connection:
            connection.execute("SELECT count(*) FROM sqlite_master").fetchone()


class LockedStore:
    """The lock, the database and its guard. With a fault the database is opened for reading only.

    `key_reader`, `list_reader`: connections of their own, for reading keys and lists.
    """

    def __init__(self, folder: Path, at: Failpoints = NO_FAILPOINTS) -> None:
        """Raises StorageError, StorageTooNew, StorageInUse; StorageInconsistent when there is nothing to read."""
        with ExitStack() as opened:
            opened.callback(FolderLock(folder).release)
            finish_restore(folder)
            path = folder / DATABASE_NAME
            roll_back(path)
            fault = find_fault(path, MAX_CHECK_S, MAX_CHECK_ROWS)
            if fault is not None and not path.exists():
                raise StorageInconsistent(fault.what, fault.fix)
            self.database = opened.enter_context(closing(Database(path, read_only=fault is not None, at=at)))
            self.key_reader, self.list_reader = (
                opened.enter_context(closing(Database(path, read_only=True))) for _ in range(2)
            )
            self.database.guard = self.guard = WriteGuard(folder, fault)
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Close the connections, then release the lock. The database is closed last: that empties its log."""
        self._opened.close()


@contextmanager
def open_offline(folder: Path) -> Iterator[Database]:
    """The database of the store in `folder`; it is not migrated while a daemon uses it.

    Raises StorageError, also when the folder belongs to another user: files written here would be closed to the daemon.
    """
    require_owner(folder)
    try:
        opened = LockedStore(folder)
    except StorageInUse:
        with closing(Database(folder / DATABASE_NAME, migrate=False)) as database:
            database.guard = WriteGuard(folder)
            yield database
        return
    with closing(opened):
        yield opened.database


@contextmanager
def open_despite_faults(folder: Path) -> Iterator[Database]:
    """The database of a store that no daemon uses, unchecked. Raises StorageError, StorageInUse."""
    require_owner(folder)
    lock = FolderLock(folder)
    try:
        with closing(Database(folder / DATABASE_NAME)) as database:
            yield database
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

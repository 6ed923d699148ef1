"""One SQLite connection in one thread: WAL, every commit fsynced, errors in the room's own words."""

import asyncio
import errno
import sqlite3
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from daemon.errors import StorageError, StorageFull, StorageTooNew
from daemon.runtime.durable_files import make_folder, settle_file
from daemon.runtime.failpoints import NEVER, Failpoints
from daemon.store.schema import MIGRATIONS, SCHEMA_VERSION

Answer = TypeVar("Answer")

DATABASE_NAME = "handeyed.sqlite"
"""In the store's folder."""

_FULL_ERRNOS = frozenset({errno.ENOSPC, errno.EDQUOT})
_FREE_SOME = "free some space there; what was stored before is unharmed"


@contextmanager
def storage_errors(place: Path) -> Iterator[None]:
    """Any failure of disk or database inside becomes a StorageError that names `place`."""
    try:
        yield
    except sqlite3.Error as error:
        if getattr(error, "sqlite_errorcode", 0) & 0xFF == sqlite3.SQLITE_FULL:
            raise StorageFull(f"the disk of {place} is full", _FREE_SOME) from error
        raise StorageError(f"{place}: {error}", "check the disk; what was stored before is unharmed") from error
    except OSError as error:
        if error.errno in _FULL_ERRNOS:
            raise StorageFull(f"the disk of {place} is full", _FREE_SOME) from error
        raise StorageError(
            f"{place}: {error.strerror or error}", "check that the folder is there and belongs to the daemon's user"
        ) from error


class Database:
    """The connection and its thread. Every call returns when its commit is on the disk."""

    def __init__(self, path: Path, *, migrate: bool = True, at: Failpoints = NEVER) -> None:
        """Opens or creates the database. Raises StorageError, StorageTooNew.

        `migrate` False: it is taken as it is, or refused.
        """
        self.path, self._at = path, at
        self._written: list[Callable[[], None]] = []
        self.thread = ThreadPoolExecutor(1, thread_name_prefix="store")
        try:
            self._connection = self.thread.submit(_connect, path, migrate).result()
        except BaseException:
            self.thread.shutdown()
            raise

    async def read(self, query: Callable[[sqlite3.Connection], Answer]) -> Answer:
        """`query` on the connection, in its thread."""
        return await self._in_thread(lambda: query(self._connection))

    async def write(self, change: Callable[[sqlite3.Connection], Answer]) -> Answer:
        """`change` as one transaction: all of it, or nothing."""

        def transaction() -> Answer:
            with self._connection:
                self._connection.execute("BEGIN IMMEDIATE")
                answer = change(self._connection)
                self._at.reached("before commit")
            self._at.reached("after commit")
            return answer

        answer = await self._in_thread(transaction)
        for told in self._written:
            told()
        return answer

    def when_written(self, told: Callable[[], None]) -> None:
        """Call `told` after each transaction."""
        self._written.append(told)

    async def run(self, work: Callable[[], Answer], place: Path) -> Answer:
        """Blocking work on files near the database, in the same thread, so that one order holds for both."""
        return await self._in_thread(work, place)

    async def close(self) -> None:
        await self._in_thread(self._connection.close)
        self.thread.shutdown()

    def read_now(self, query: Callable[[sqlite3.Connection], Answer]) -> Answer:
        """As `read`, for a command without an event loop."""

        def guarded() -> Answer:
            with storage_errors(self.path):
                return query(self._connection)

        return self.thread.submit(guarded).result()

    def close_now(self) -> None:
        """For a command, which has no event loop any more."""
        self.thread.submit(self._connection.close).result()
        self.thread.shutdown()

    async def _in_thread(self, work: Callable[[], Answer], place: Path | None = None) -> Answer:
        def guarded() -> Answer:
            with storage_errors(place or self.path):
                return work()

        return await asyncio.get_running_loop().run_in_executor(self.thread, guarded)


def _connect(path: Path, migrate: bool) -> sqlite3.Connection:
    with storage_errors(path):
        make_folder(path.parent)
        connection = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
        try:
            _prepare(connection, path, migrate)
        except BaseException:
            connection.close()
            raise
        return connection


def _prepare(connection: sqlite3.Connection, path: Path, migrate: bool) -> None:
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    if version > SCHEMA_VERSION:
        raise StorageTooNew(
            f"{path} was written by a newer handeyed (schema {version}, this one knows {SCHEMA_VERSION})",
            "install that version again, or restore the backup made before the update",
        )
    if version < SCHEMA_VERSION and not migrate:
        raise StorageError(
            f"{path} is in use by an older handeyed (schema {version}, this one writes {SCHEMA_VERSION})",
            "restart the daemon, so that both are of one version",
        )
    if 0 < version < SCHEMA_VERSION:
        _keep_a_copy(connection, path.with_name(f"{path.name}.schema-{version}.backup"))
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = FULL")
    connection.execute("PRAGMA foreign_keys = ON")
    for number, migration in enumerate(MIGRATIONS[version:], start=version + 1):
        connection.executescript(f"BEGIN IMMEDIATE; {migration} PRAGMA user_version = {number}; COMMIT;")


def _keep_a_copy(connection: sqlite3.Connection, copy: Path) -> None:
    """Before a migration: what the older version can still read."""
    part = copy.with_name(f".{copy.name}.part")
    part.unlink(missing_ok=True)
    copy_database(connection, part)
    settle_file(part, copy)


def copy_database(connection: sqlite3.Connection, copy: Path) -> None:
    """As it is at one moment, while others go on writing."""
    target = sqlite3.connect(copy)
    try:
        connection.backup(target)
        target.execute("PRAGMA journal_mode = DELETE")  # one file, without a log beside it
    finally:
        target.close()

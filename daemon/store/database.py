"""One SQLite connection in one thread: WAL, every commit fsynced, errors raised as StorageError."""

import asyncio
import errno
import os
import sqlite3
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeVar

from calibration.sentences.sentence import Sentence
from daemon.errors import StorageError, StorageFull, StorageInconsistent, StorageTooNew
from daemon.runtime.durable_files import make_folder, rename_durably
from daemon.runtime.failpoints import NO_FAILPOINTS, Failpoints

MIGRATIONS = tuple(file.read_text("utf-8") for file in sorted(Path(__file__).with_name("migrations").glob("*.sql")))
"""The schema, in their order. Append one, never change one that was released."""
SCHEMA_VERSION = len(MIGRATIONS)

Answer = TypeVar("Answer")

DATABASE_NAME = "handeyed.sqlite"
"""In the store's folder."""

_FULL_ERRNOS = frozenset({errno.ENOSPC, errno.EDQUOT})


@contextmanager
def storage_errors(place: Path) -> Iterator[None]:
    """Raise sqlite3.Error and OSError of the block as a StorageError naming `place`; StorageFull for a full disk."""
    try:
        yield
    except sqlite3.Error as error:
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        if code == sqlite3.SQLITE_FULL:
            raise StorageFull(Sentence("disk-is-full", folder=str(place)), Sentence("free-space")) from error
        if code in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB):
            what = Sentence("store-is-damaged", place=str(place), error=str(error))
            raise StorageInconsistent(what, Sentence("restore-into-empty")) from error
        what = Sentence("store-failed", place=str(place), error=str(error))
        raise StorageError(what, Sentence("check-disk")) from error
    except OSError as error:
        if error.errno in _FULL_ERRNOS:
            raise StorageFull(Sentence("disk-is-full", folder=str(place)), Sentence("free-space")) from error
        what = Sentence("store-failed", place=str(place), error=error.strerror or str(error))
        raise StorageError(what, Sentence("check-folder")) from error


class Database:
    """The connection and its thread. A write returns once its commit is on the disk.

    `guard` is called before and after each write, in the thread, and raises StorageInconsistent when nothing must be
    written: what is acknowledged was written to the store that is at `path`. `commit_callbacks` are called after each
    transaction, in the event loop.
    """

    def __init__(
        self, path: Path, *, migrate: bool = True, read_only: bool = False, at: Failpoints = NO_FAILPOINTS
    ) -> None:
        """Opens or creates the database. Raises StorageError, StorageTooNew.

        `migrate` False: raises StorageError when the schema is older than SCHEMA_VERSION.
        """
        self.path, self._at = path, at
        self.guard: Callable[[], None] = lambda: None
        self.commit_callbacks: list[Callable[[], None]] = []
        self.thread = ThreadPoolExecutor(1, thread_name_prefix="store")
        try:
            connecting = self.thread.submit(_connect, path, read_only=read_only, migrate=migrate)
            self._connection = connecting.result()
        except BaseException:
            self.thread.shutdown()
            raise

    async def read(self, query: Callable[[sqlite3.Connection], Answer]) -> Answer:
        """Run `query` in the connection's thread; returns its result. Raises StorageError."""
        return await self._in_thread(lambda: query(self._connection))

    async def write(self, change: Callable[[sqlite3.Connection], Answer]) -> Answer:
        """Run `change` as one transaction; returns its result. Raises StorageError."""
        answer = await self._in_thread(lambda: self._transaction(change))
        for callback in self.commit_callbacks:
            callback()
        return answer

    async def run(self, work: Callable[[], Answer], place: Path) -> Answer:
        """Run blocking reading of files in the connection's thread."""
        return await self._in_thread(work, place)

    async def write_files(self, work: Callable[[], Answer], place: Path) -> Answer:
        """Run blocking work on files in the connection's thread, so that files and rows are written in order."""

        def guarded() -> Answer:
            self.guard()
            answer = work()
            self.guard()
            return answer

        return await self._in_thread(guarded, place)

    def read_now(self, query: Callable[[sqlite3.Connection], Answer]) -> Answer:
        """Like `read`, for commands without an event loop."""
        return self._now(lambda: query(self._connection))

    def close(self) -> None:
        """Close the connection; it waits for the thread."""
        self.thread.submit(self._connection.close).result()
        self.thread.shutdown()

    def write_now(self, change: Callable[[sqlite3.Connection], Answer]) -> Answer:
        """Like `write`, for commands without an event loop."""
        return self._now(lambda: self._transaction(change))

    def _now(self, work: Callable[[], Answer]) -> Answer:
        return self.thread.submit(_run, work, self.path).result()

    def _transaction(self, change: Callable[[sqlite3.Connection], Answer]) -> Answer:
        self.guard()
        with self._connection:
            self._connection.execute("BEGIN IMMEDIATE")
            answer = change(self._connection)
            self._at("before commit")
        self._at("after commit")
        self.guard()
        return answer

    async def _in_thread(self, work: Callable[[], Answer], place: Path | None = None) -> Answer:
        return await asyncio.get_running_loop().run_in_executor(self.thread, _run, work, place or self.path)


def _run(work: Callable[[], Answer], place: Path) -> Answer:
    with storage_errors(place):
        return work()


def _connect(path: Path, *, read_only: bool, migrate: bool) -> sqlite3.Connection:
    with storage_errors(path):
        if not read_only:
            make_folder(path.parent)
            # For owner and group; SQLite gives its other files the same mode. A file that is there is not opened:
            # closing it would release the locks of this process' other connections.
            with suppress(FileExistsError):
                os.close(os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o640))
        place = f"{path.resolve().as_uri()}?mode=ro" if read_only else path
        connection = sqlite3.connect(place, uri=read_only, check_same_thread=False, isolation_level=None)
        try:
            if not read_only:
                _prepare(connection, path, migrate)
            elif connection.execute("PRAGMA user_version").fetchone() == (0,):
                raise StorageInconsistent(f"{path} is empty, and should not be", Sentence("restore-into-empty"))
            else:
                connection.execute("PRAGMA query_only = ON")
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
        copy = path.with_name(f"{path.name}.schema-{version}.backup")  # for a return to the older version
        part = copy.with_name(f".{copy.name}.part")
        part.unlink(missing_ok=True)
        copy_database(connection, part)
        rename_durably(part, copy)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = FULL")
    connection.execute("PRAGMA foreign_keys = ON")
    for number, migration in enumerate(MIGRATIONS[version:], start=version + 1):
        connection.executescript(f"BEGIN IMMEDIATE; {migration} PRAGMA user_version = {number}; COMMIT;")


def copy_database(connection: sqlite3.Connection, copy: Path) -> None:
    """Write a snapshot of the database to `copy`; other connections may go on writing."""
    target = sqlite3.connect(copy)
    try:
        connection.backup(target)
        target.execute("PRAGMA journal_mode = DELETE")  # one file, without a log beside it
    finally:
        target.close()

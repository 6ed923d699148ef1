"""Lock that allows one daemon per store: a second would mark the first one's run as interrupted."""

import fcntl
import os
from pathlib import Path

from daemon.errors import StorageInUse
from daemon.runtime.durable_files import make_folder
from daemon.store.database import DATABASE_NAME, storage_errors

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

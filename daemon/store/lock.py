"""File lock that allows one daemon per store: a second would mark the first one's run as interrupted."""

import fcntl
import os
from pathlib import Path

from daemon.errors import StorageInUse
from daemon.runtime.durable_files import make_folder
from daemon.store.database import storage_errors


class FolderLock:
    """A lock held from construction to `release`; the system releases it when the process ends."""

    def __init__(self, place: Path) -> None:
        """Lock the file `place`. Raises StorageInUse, StorageError."""
        folder = place.parent
        with storage_errors(folder):
            make_folder(folder)
            self._file = os.open(place, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o640)
        try:
            with storage_errors(folder):
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BaseException as error:
            self.release()
            if isinstance(error.__cause__, BlockingIOError):
                raise StorageInUse(
                    f"{folder} is in use by another handeyed",
                    "stop that one, or give this one its own [storage] folder",
                ) from None
            raise

    def release(self) -> None:
        """Release the lock."""
        os.close(self._file)

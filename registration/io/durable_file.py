"""Files whose errors are CloudIOError, and new files that appear completely or not at all."""

import errno
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

from registration.errors import CloudIOError
from registration.io.regular_file import open_regular, require_replaceable

CANNOT_RESERVE = (errno.EOPNOTSUPP, errno.EINVAL, errno.ENODEV)
"""Errors of a file system, or of a length of 0, that cannot be reserved; writing continues without reservation."""


class GuardedFile:
    """A binary file whose OSErrors become CloudIOError with the cloud's name and the position."""

    def __init__(self, file: BinaryIO, name: str, path: Path) -> None:
        self.raw, self._path = file, path
        """The underlying file, for libraries that read it themselves."""
        self.name = name

    @classmethod
    def reading(cls, path: Path, name: str) -> Self:
        """Open for reading. Raises CloudIOError."""
        with _cloud_errors(name, "opened"):
            return cls(open_regular(path), name, path)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.raw.close()

    def read(self, size: int) -> bytes:
        """Read `size` bytes; fewer only at the end."""
        pieces = bytearray(size)
        return bytes(pieces[: self.readinto(memoryview(pieces))])

    def readinto(self, buffer: memoryview) -> int:
        """Fill the buffer; returns the byte count, smaller only at the end."""
        filled = 0
        with _cloud_errors(self.name, "read", self._place):
            while filled < len(buffer) and (more := self.raw.readinto(buffer[filled:])):  # type: ignore[attr-defined]
                filled += more
        return filled

    def write(self, data: bytes | memoryview) -> None:
        """Write all of `data`."""
        view = memoryview(data)
        with _cloud_errors(self.name, "written", self._place):
            while len(view):
                view = view[self.raw.write(view) :]

    def read_at(self, buffer: memoryview, position: int) -> int:
        """As `readinto`, from a position; thread-safe."""
        filled = 0
        with _cloud_errors(self.name, "read", lambda: f"byte {position}"):
            if not hasattr(os, "preadv"):  # Windows: a handle of its own has a position of its own
                with self._path.open("rb") as file:
                    file.seek(position)
                    return file.readinto(buffer)
            while filled < len(buffer) and (more := os.preadv(self.raw.fileno(), [buffer[filled:]], position + filled)):
                filled += more
        return filled

    def write_at(self, data: bytes | memoryview, position: int) -> None:
        """Write all of `data` at a position; thread-safe."""
        view, done = memoryview(data), 0
        with _cloud_errors(self.name, "written", lambda: f"byte {position}"):
            if not hasattr(os, "pwrite"):
                with self._path.open("r+b") as file:
                    file.seek(position)
                    file.write(view)
                return
            while done < len(view):
                done += os.pwrite(self.raw.fileno(), view[done:], position + done)

    def reserve(self, length: int) -> None:
        """Reserve `length` bytes: reports a full disk before the work, and halves the cost of writing."""
        if not hasattr(os, "posix_fallocate"):  # Windows, macOS
            return
        with _cloud_errors(self.name, "written", self._place):
            try:
                os.posix_fallocate(self.raw.fileno(), 0, length)
            except OSError as error:
                if error.errno not in CANNOT_RESERVE:
                    raise

    def seek(self, position: int, whence: int = 0) -> int:
        """Set the position and return it."""
        with _cloud_errors(self.name, "positioned", self._place):
            return self.raw.seek(position, whence)

    def _place(self) -> str:
        try:
            return f"byte {self.raw.tell()}"
        except OSError:
            return "file"


@contextmanager
def new_file(path: Path, *, durable: bool = True) -> Iterator[GuardedFile]:
    """A file under a temporary name beside `path`: synced and renamed at the end, removed on any error.

    Without `durable` it is renamed without waiting for the disk, as `cp` does.
    """
    part = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    with _cloud_errors(path.name, "created"):
        require_replaceable(path)
        raw = part.open("xb", buffering=0)
    try:
        with raw:
            yield GuardedFile(raw, path.name, part)
            if durable:
                with _cloud_errors(path.name, "completed"):
                    os.fsync(raw.fileno())
        with _cloud_errors(path.name, "completed"):
            part.replace(path)
            if durable:
                fsync_path(path.parent)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def _cloud_errors(name: str, verb: str, place: Callable[[], str] = lambda: "file") -> Iterator[None]:
    """Raise an OSError of the block as CloudIOError: the file `name` cannot be `verb`."""
    try:
        yield
    except OSError as error:
        what = f"it cannot be {verb} ({error.strerror})"
        raise CloudIOError(name, place(), what, "check path, rights and free space") from None


def fsync_path(path: Path) -> None:
    """Fsync a file's content, or the names in a folder, so that they survive a power cut. Raises OSError."""
    if not hasattr(os, "O_DIRECTORY"):
        return  # Windows opens no folders
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)

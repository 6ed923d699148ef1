"""Files whose errors are CloudIOError, and new files that appear completely or not at all."""

import errno
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, NoReturn, Self

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
        try:
            return cls(open_regular(path), name, path)
        except OSError as error:
            raise _error(name, "file", "opened", error) from None

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
        try:
            while filled < len(buffer) and (more := self.raw.readinto(buffer[filled:])):  # type: ignore[attr-defined]
                filled += more
        except OSError as error:
            self._fail("read", error)
        return filled

    def write(self, data: bytes | memoryview) -> None:
        """Write all of `data`."""
        view = memoryview(data)
        try:
            while len(view):
                view = view[self.raw.write(view) :]
        except OSError as error:
            self._fail("written", error)

    def read_at(self, buffer: memoryview, position: int) -> int:
        """As `readinto`, from a position; thread-safe."""
        filled = 0
        try:
            if not hasattr(os, "preadv"):  # Windows: a handle of its own has a position of its own
                with self._path.open("rb") as file:
                    file.seek(position)
                    return file.readinto(buffer)
            while filled < len(buffer) and (more := os.preadv(self.raw.fileno(), [buffer[filled:]], position + filled)):
                filled += more
        except OSError as error:
            raise _error(self.name, f"byte {position}", "read", error) from None
        return filled

    def write_at(self, data: bytes | memoryview, position: int) -> None:
        """Write all of `data` at a position; thread-safe."""
        view, done = memoryview(data), 0
        try:
            if not hasattr(os, "pwrite"):
                with self._path.open("r+b") as file:
                    file.seek(position)
                    file.write(view)
                return
            while done < len(view):
                done += os.pwrite(self.raw.fileno(), view[done:], position + done)
        except OSError as error:
            raise _error(self.name, f"byte {position}", "written", error) from None

    def reserve(self, length: int) -> None:
        """Reserve `length` bytes: reports a full disk before the work, and halves the cost of writing."""
        if not hasattr(os, "posix_fallocate"):  # Windows, macOS
            return
        try:
            os.posix_fallocate(self.raw.fileno(), 0, length)
        except OSError as error:
            if error.errno not in CANNOT_RESERVE:
                self._fail("written", error)

    def seek(self, position: int, whence: int = 0) -> int:
        """Set the position and return it."""
        try:
            return self.raw.seek(position, whence)
        except OSError as error:
            self._fail("positioned", error)

    def _fail(self, verb: str, error: OSError) -> NoReturn:
        try:
            place = f"byte {self.raw.tell()}"
        except OSError:
            place = "file"
        raise _error(self.name, place, verb, error) from None


@contextmanager
def new_file(path: Path, *, durable: bool = True) -> Iterator[GuardedFile]:
    """A file under a temporary name beside `path`: synced and renamed at the end, removed on any error.

    Without `durable` it is renamed without waiting for the disk, as `cp` does.
    """
    part = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        require_replaceable(path)
        raw = part.open("xb", buffering=0)
    except OSError as error:
        raise _error(path.name, "file", "created", error) from None
    try:
        with raw:
            yield GuardedFile(raw, path.name, part)
            if durable:
                _settle(lambda: os.fsync(raw.fileno()), path.name)
        _settle(lambda: part.replace(path), path.name)
        if durable:
            _settle(lambda: fsync_path(path.parent), path.name)
    finally:
        part.unlink(missing_ok=True)


def _settle(step: Callable[[], object], name: str) -> None:
    try:
        step()
    except OSError as error:
        raise _error(name, "file", "completed", error) from None


def fsync_path(path: Path) -> None:
    """Fsync a file's content, or the names in a folder, so that they survive a power cut. Raises OSError."""
    if not hasattr(os, "O_DIRECTORY"):
        return  # Windows opens no folders
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _error(name: str, place: str, verb: str, error: OSError) -> CloudIOError:
    return CloudIOError(name, place, f"it cannot be {verb} ({error.strerror})", "check path, rights and free space")

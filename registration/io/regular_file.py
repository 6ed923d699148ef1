"""Opens regular files only: a pipe, a device or a socket in a file's place may never answer, or never end."""

import errno
import os
import stat
from contextlib import suppress
from io import FileIO
from pathlib import Path

QUIET = ("O_NONBLOCK", "O_NOCTTY", "O_CLOEXEC", "O_BINARY")
"""Flags of open(2), each where the system has it: O_BINARY is Windows'."""


def _flags(*names: str) -> int:
    return sum(getattr(os, name, 0) for name in names)


def open_regular(path: Path, *, follow_links: bool = True) -> FileIO:
    """Open for reading, unbuffered. Raises OSError, also for what is no regular file, or a link not to be followed."""
    links = 0 if follow_links else _flags("O_NOFOLLOW")
    try:
        found = path.stat(follow_symlinks=follow_links)
    except ValueError:  # a zero byte, or a character that no name of a file has
        raise OSError(errno.EINVAL, "Not a file name", str(path)) from None
    _require_regular(path, found)  # opening alone may set a device off
    descriptor = os.open(path, os.O_RDONLY | _flags(*QUIET) | links)
    try:
        _require_regular(path, os.fstat(descriptor))
        return os.fdopen(descriptor, "rb", buffering=0)
    except BaseException:
        os.close(descriptor)
        raise


def read_regular(path: Path, max_bytes: int, *, follow_links: bool = True) -> bytes:
    """The content. Raises OSError, also (EFBIG) when it is longer than `max_bytes`."""
    with open_regular(path, follow_links=follow_links) as file:
        content = bytearray()
        while len(content) <= max_bytes and (more := file.read(min(1 << 20, max_bytes + 1 - len(content)))):
            content += more
    if len(content) > max_bytes:
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG), str(path))
    return bytes(content)


def require_replaceable(path: Path) -> None:
    """Raises OSError where a rename onto `path` would destroy more than an older file: a link, a folder, a device.

    A rename replaces the link itself, such as /dev/stdout, for everybody.
    """
    with suppress(FileNotFoundError):
        found = path.lstat()
        if not stat.S_ISREG(found.st_mode):
            kind = "link" if stat.S_ISLNK(found.st_mode) else "folder or a device"
            raise OSError(errno.EINVAL, f"it is a {kind}, not a file", str(path))


def _require_regular(path: Path, found: os.stat_result) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "Not a regular file", str(path))

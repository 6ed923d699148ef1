"""Atomic, durable writes: temporary file, fsync, rename, fsync of the folder. A crash leaves the old or new file.

registration.io.durable_file does the same for a command's clouds, with CloudIOErrors and a temporary name of each
writer's own. Here failpoints stand between the steps, and what a crash left is overwritten by the next attempt.
"""

import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from daemon.runtime.failpoints import NO_FAILPOINTS, Failpoints
from registration.io.durable_file import fsync_path
from registration.io.regular_file import require_replaceable

WriteFile = Callable[[Path, Iterable[bytes]], None]


def write_durably(path: Path, blocks: Iterable[bytes], at: Failpoints = NO_FAILPOINTS) -> None:
    """Write the joined blocks to `path` so that they survive a power cut. Raises OSError."""
    require_replaceable(path)
    make_folder(path.parent)
    temporary = path.with_name(f".{path.name}.part")
    try:
        with create_file(temporary) as file:
            at("before write")
            for block in blocks:
                file.write(block)
            file.flush()
            _fsync(file.fileno(), at)
        _rename(temporary, path, at)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise
    _fsync_names(path.parent, at)


def create_file(path: Path, mode: int = 0o640, *, new: bool = False) -> BinaryIO:
    """Open a file for writing, made with `mode`, never through a link. Raises OSError; FileExistsError with `new`."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | (os.O_EXCL if new else os.O_TRUNC)
    return os.fdopen(os.open(path, flags, mode), "wb")


def rename_durably(written: Path, final: Path, at: Failpoints = NO_FAILPOINTS) -> None:
    """Fsync the file `written`, rename it to `final` and fsync the folder. Raises OSError."""
    with written.open("rb+") as file:
        _fsync(file.fileno(), at)
    _rename(written, final, at)
    _fsync_names(final.parent, at)


def _fsync(descriptor: int, at: Failpoints) -> None:
    at("before fsync")
    os.fsync(descriptor)
    at("after fsync")


def _rename(written: Path, final: Path, at: Failpoints) -> None:
    require_replaceable(final)
    at("before rename")
    written.replace(final)
    at("after rename")


def _fsync_names(folder: Path, at: Failpoints) -> None:
    at("before fsync of the folder")
    fsync_path(folder)
    at("after fsync of the folder")


def make_folder(folder: Path, mode: int = 0o750) -> None:
    """Create the folder and its parents , and fsync each parent, so that the names survive a power cut."""
    if folder.is_dir():
        return
    make_folder(folder.parent, mode)
    folder.mkdir(mode, exist_ok=True)
    fsync_path(folder.parent)

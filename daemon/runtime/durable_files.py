"""Big files: written whole under a temporary name, fsynced, renamed, the folder fsynced. Old or new, never between."""

import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

from daemon.runtime.failpoints import NEVER, Failpoints

WriteFile = Callable[[Path, Iterable[bytes]], None]


def write_durably(path: Path, blocks: Iterable[bytes], at: Failpoints = NEVER) -> None:
    """The file at `path` holds the joined blocks after this, also after a power cut. Raises OSError."""
    make_folder(path.parent)
    temporary = path.with_name(f".{path.name}.part")
    try:
        with temporary.open("wb") as file:
            at.reached("before write")
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


def settle_file(written: Path, final: Path, at: Failpoints = NEVER) -> None:
    """A file that was written in pieces gets its name once its bytes are on the disk. Raises OSError."""
    with written.open("rb+") as file:
        _fsync(file.fileno(), at)
    _rename(written, final, at)
    _fsync_names(final.parent, at)


def _fsync(descriptor: int, at: Failpoints) -> None:
    at.reached("before fsync")
    os.fsync(descriptor)
    at.reached("after fsync")


def _rename(written: Path, final: Path, at: Failpoints) -> None:
    at.reached("before rename")
    written.replace(final)
    at.reached("after rename")


def _fsync_names(folder: Path, at: Failpoints) -> None:
    at.reached("before fsync of the folder")
    fsync_folder(folder)
    at.reached("after fsync of the folder")


def make_folder(folder: Path) -> None:
    """The folder exists and its name survives a power cut."""
    if folder.is_dir():
        return
    make_folder(folder.parent)
    folder.mkdir(exist_ok=True)
    fsync_folder(folder.parent)


def fsync_folder(folder: Path) -> None:
    """Names in `folder` survive a power cut."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)

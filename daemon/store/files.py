"""Big files: written whole under a temporary name, fsynced, renamed, the folder fsynced. Old or new, never between."""

import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

WriteFile = Callable[[Path, Iterable[bytes]], None]


def write_durably(path: Path, blocks: Iterable[bytes]) -> None:
    """The file at `path` holds the joined blocks after this, also after a power cut. Raises OSError."""
    make_folder(path.parent)
    temporary = path.with_name(f".{path.name}.part")
    try:
        with temporary.open("wb") as file:
            for block in blocks:
                file.write(block)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise
    fsync_folder(path.parent)


def settle_file(written: Path, final: Path) -> None:
    """A file that was written in pieces gets its name once its bytes are on the disk. Raises OSError."""
    with written.open("rb+") as file:
        os.fsync(file.fileno())
    written.replace(final)
    fsync_folder(final.parent)


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

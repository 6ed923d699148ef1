"""The regular files below a folder, read up to a limit; links are not followed, devices and pipes not opened."""

import os
from dataclasses import dataclass, field
from pathlib import Path

from calibration.documents.imports.pairing import natural
from calibration.documents.imports.refusal import refusal
from registration.io.regular_file import read_regular

MAX_FILES = 20_000
MAX_DEPTH = 6
MAX_FILE_BYTES = 64_000_000


@dataclass(frozen=True)
class FolderFiles:
    """The files of `folder`; `names` relative to it with slashes, in natural order; `links` were left out."""

    folder: Path
    names: tuple[str, ...] = field(default=())
    links: tuple[str, ...] = field(default=())

    @property
    def origin(self) -> str:
        return str(self.folder)

    def path(self, name: str) -> Path:
        """The file of a name of the list. Raises DocumentError for any other."""
        if name not in self.names:
            what = "not followed, it is a link" if name in self.links else "no such file in the folder"
            raise refusal(f"{self.folder}/{name}", "file", what, "put the file itself there")
        return self.folder / name

    def read(self, name: str) -> bytes:
        """The content. Raises DocumentError."""
        try:
            return read_regular(self.path(name), MAX_FILE_BYTES, follow_links=False)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise refusal(f"{self.folder}/{name}", "file", reason, "check the file and its permissions") from None


def list_files(folder: Path) -> FolderFiles:
    """The files of a folder and of the folders in it.

    Raises DocumentError when it cannot be listed or has more than MAX_FILES files.
    """
    if not folder.is_dir():
        raise refusal(str(folder), "folder", "not a folder" if folder.exists() else "not there", "check the path")
    names: list[str] = []
    links: list[str] = []
    pending = [(folder, 0)]
    while pending:
        here, depth = pending.pop()
        try:
            entries = list(os.scandir(here))
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise refusal(str(here), "folder", reason, "check its permissions") from None
        for entry in entries:
            name = Path(entry.path).relative_to(folder).as_posix()
            if entry.name.startswith("."):
                continue
            if entry.is_symlink():
                links.append(name)
            elif entry.is_dir(follow_symlinks=False) and depth < MAX_DEPTH:
                pending.append((Path(entry.path), depth + 1))
            elif entry.is_file(follow_symlinks=False):
                names.append(name)
        if len(names) > MAX_FILES:
            what = f"more than {MAX_FILES} files"
            raise refusal(str(folder), "folder", what, "name the folder of one session")
    return FolderFiles(folder, tuple(sorted(names, key=natural)), tuple(sorted(links)))

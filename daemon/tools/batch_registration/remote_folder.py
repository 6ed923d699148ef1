"""Folders by URL through fsspec: local paths, s3://, memory:// and whatever else fsspec supports.

A local folder is used in place; any other is copied to a temporary folder first, and results are copied back.
"""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from daemon.errors import DaemonError
from registration.io.durable_file import new_file
from registration.io.regular_file import read_regular


class ArchiveError(DaemonError, code="archive-error"):
    """The archive cannot be read or written, or there is no executor."""


INSTALL = "install handeyed[archive]"

MAX_DOCUMENT_BYTES = 1 << 26
"""64 MB: scan.json and manifest.json are far smaller."""

MARKS = ("ETag", "etag", "md5Hash", "LastModified", "last_modified", "mtime", "created")
"""What a listing says of a file that is another one when the file was written again; some of them, by the place."""

Listing = dict[str, dict[str, str]]
"""By folder, "" for the upper one, and name of a file: its mark; empty where the place gives none."""


def import_extra(name: str) -> Any:
    """Import a library of the extra `archive`. Raises ArchiveError when it is not installed."""
    try:
        return import_module(name)
    except ImportError:
        raise ArchiveError(f"{name} is not installed", INSTALL) from None


@dataclass(frozen=True)
class RemoteFolder:
    """A folder; `url` has no trailing slash."""

    url: str

    @classmethod
    def from_url(cls, url: str) -> "RemoteFolder":
        """A folder by path or URL; paths are made absolute for workers elsewhere. Raises ArchiveError."""
        place = cls(url.rstrip("/") or "/")
        return place if place.local is None else cls(str(place.local))

    def _system(self) -> tuple[Any, str]:
        fsspec = import_extra("fsspec")
        try:
            system, path = fsspec.core.url_to_fs(self.url)
        except (ValueError, ImportError) as error:
            raise ArchiveError(f"{self.url}: this is no place fsspec knows ({error})", f"check it; {INSTALL}") from None
        return system, path

    @property
    def local(self) -> Path | None:
        """Its path when it is on this machine, else None."""
        system, path = self._system()
        protocols = (system.protocol,) if isinstance(system.protocol, str) else system.protocol
        return Path(path) if "file" in protocols else None

    def child(self, name: str) -> "RemoteFolder":
        return RemoteFolder(f"{self.url}/{name}") if name else self

    def list_marks(self) -> Listing:
        """A mark of each file below that changes with it, by one listing. Raises ArchiveError."""
        system, path = self._system()
        listing: Listing = {}
        try:
            system.invalidate_cache()
            for place, about in system.find(path, detail=True).items():
                file = Path(place).relative_to(path)
                found = [str(about[name]) for name in ("size", *MARKS) if name in about]
                folder = "" if file.parent == Path() else file.parent.as_posix()
                listing.setdefault(folder, {})[file.name] = " ".join(found) if len(found) > 1 else ""
        except OSError as error:
            raise ArchiveError(f"{self.url}: it cannot be listed ({error})", "check address and rights") from None
        return listing

    def read(self, name: str) -> bytes | None:
        """The content of a small file; None when it does not exist. Raises OSError, ArchiveError."""
        try:
            if (folder := self.local) is not None:
                return read_regular(folder / name, MAX_DOCUMENT_BYTES)
            system, path = self._system()
            content: bytes = system.cat_file(f"{path}/{name}", end=MAX_DOCUMENT_BYTES + 1)
        except FileNotFoundError:
            return None
        if len(content) > MAX_DOCUMENT_BYTES:
            raise ArchiveError(f"{self.url}/{name}: it has more than {MAX_DOCUMENT_BYTES} bytes", "check the file")
        return content

    def size(self, name: str) -> int | None:
        """A file's size in bytes; None when it does not exist."""
        system, path = self._system()
        try:
            return int(system.info(f"{path}/{name}")["size"])
        except FileNotFoundError:
            return None

    def remove(self, name: str) -> None:
        """Delete a file if it exists."""
        system, path = self._system()
        with suppress(FileNotFoundError):
            system.rm_file(f"{path}/{name}")

    def write(self, name: str, content: bytes) -> None:
        """Write a small file atomically."""
        if (folder := self.local) is not None:
            folder.mkdir(parents=True, exist_ok=True)
            with new_file(folder / name) as file:
                file.write(content)
            return
        system, path = self._system()
        system.pipe_file(f"{path}/{name}", content)

    @contextmanager
    def fetch(self, names: list[str]) -> Iterator[Path]:
        """A folder on this machine that holds the files: this one, or a temporary copy."""
        if (folder := self.local) is not None:
            yield folder
            return
        system, path = self._system()
        with tempfile.TemporaryDirectory(prefix="handeyed-") as temporary:
            for name in names:
                system.get_file(f"{path}/{name}", f"{temporary}/{name}")
            yield Path(temporary)

    @contextmanager
    def upload_after(self) -> Iterator[Path]:
        """A local folder to write into; its files are uploaded here when the block ends without an error."""
        if (folder := self.local) is not None:
            folder.mkdir(parents=True, exist_ok=True)
            yield folder
            return
        system, path = self._system()
        with tempfile.TemporaryDirectory(prefix="handeyed-") as temporary:
            yield Path(temporary)
            system.makedirs(path, exist_ok=True)
            for file in sorted(Path(temporary).iterdir()):
                system.put_file(str(file), f"{path}/{file.name}")

"""The operator's page: static files of this folder, served by daemon/api/routes/page.py under a hash of them all."""

import gzip
import hashlib
import posixpath
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from calibration.sentences.sentence import WORDS

FOLDER = Path(__file__).parent

MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
    ".json": "application/json",
}
VERSION_MARK = "{version}"
"""Replaced in index.html by the hash, so that the files it names may be kept for ever."""
PRELOADS_MARK = "{preloads}"
"""Replaced in index.html by a link to each module of the shell: all are fetched at once, not one after another."""
SHELL = "app.js"
_IMPORT = re.compile(r"^(?:import|export) [^;]*? from '([^']+)';", re.MULTILINE)


@dataclass(frozen=True)
class PageFile:
    """One file: its bytes as they are and by gzip, and its media type."""

    content: bytes
    packed: bytes
    media_type: str


class PageFiles:
    """The files by path below FOLDER, and the daemon's sentences beside the page's words; read when first asked for."""

    @cached_property
    def _contents(self) -> dict[str, bytes]:
        paths = sorted(path for path in FOLDER.rglob("*") if path.suffix in MEDIA_TYPES)
        files = {path.relative_to(FOLDER).as_posix(): path for path in paths}
        files |= {f"words/sentences.{path.name}": path for path in sorted(WORDS.glob("*.json"))}
        return {name: path.read_bytes() for name, path in files.items()}

    @cached_property
    def version(self) -> str:
        """Hash of all names and contents: 16 hexadecimal digits."""
        together = hashlib.sha256()
        for name, content in self._contents.items():
            together.update(f"{name}\0{len(content)}\0".encode() + content)
        return together.hexdigest()[:16]

    @cached_property
    def shell(self) -> tuple[str, ...]:
        """SHELL and the modules that it imports, each after one that imports it."""
        found = [SHELL]
        for name in found:
            for path in _IMPORT.findall(self._contents[name].decode()):
                imported = posixpath.normpath(posixpath.join(posixpath.dirname(name), path))
                if imported not in found:
                    found.append(imported)
        return tuple(found)

    @cached_property
    def _files(self) -> dict[str, PageFile]:
        contents = dict(self._contents)
        links = (f'<link rel="modulepreload" href="{VERSION_MARK}/{name}">' for name in self.shell[1:])
        index = contents["index.html"].decode().replace(PRELOADS_MARK, "\n".join(links))
        contents["index.html"] = index.replace(VERSION_MARK, self.version).encode()
        return {
            name: PageFile(content, gzip.compress(content, mtime=0), MEDIA_TYPES[Path(name).suffix])
            for name, content in contents.items()
        }

    def find(self, name: str) -> PageFile | None:
        return self._files.get(name)

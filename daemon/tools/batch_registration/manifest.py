"""manifest.json: what a registered scan was made of and what came out. Written last: with it a scan is finished."""

import hashlib
from pathlib import Path
from typing import Literal

from calibration.documents.validation import Document

NAME = "manifest.json"
PIECE = 1 << 20


class WrittenDocument(Document):
    """A file and its content's hash."""

    name: str
    bytes: int
    sha256: str


class ManifestDocument(Document):
    """A finished scan. `input_sha256`: scan.json, every cloud it names, the calibration's document and the options."""

    schema_version: Literal[1] = 1
    scan: str
    calibration_id: str
    input_sha256: str
    points: int
    accepted: bool
    files: list[WrittenDocument]


def hash_of_inputs(folder: Path, names: list[str], about: bytes) -> str:
    """Names, lengths and contents, so that no two different inputs run together."""
    whole = hashlib.sha256(about)
    for name in names:
        whole.update(f"\n{name}\n{file_hash(folder / name)}".encode())
    return whole.hexdigest()


def file_hash(path: Path) -> str:
    """SHA-256, in pieces."""
    found = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(PIECE):
            found.update(piece)
    return found.hexdigest()


def written(path: Path) -> WrittenDocument:
    return WrittenDocument(name=path.name, bytes=path.stat().st_size, sha256=file_hash(path))

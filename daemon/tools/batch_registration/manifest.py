"""manifest.json: hashes of a registered scan's inputs and files. Written last, so it marks a finished scan."""

import hashlib
from pathlib import Path
from typing import Literal

from calibration.documents.validation import Document
from registration.io.regular_file import open_regular

MANIFEST_NAME = "manifest.json"
PIECE_BYTES = 1 << 20


class WrittenDocument(Document):
    """A file with its size in bytes and SHA-256."""

    name: str
    """Name of the file."""
    bytes: int
    """Its size in bytes."""
    sha256: str
    """SHA-256 of its content, hexadecimal."""


class ManifestDocument(Document):
    """A finished scan."""

    heading = "manifestjson"

    schema_version: Literal[1] = 1
    """Version of the format."""
    scan: str
    """Folder of the scan, below the archive's."""
    calibration_id: str
    """Of the calibration that was used."""
    input_sha256: str
    """SHA-256 over scan.json, the clouds that it names, the calibration and the options."""
    points: int
    """Number of points."""
    accepted: bool
    """The verdict of the scan's report."""
    files: list[WrittenDocument]
    """What was written beside it."""


def hash_of_inputs(folder: Path, names: list[str], about: bytes) -> str:
    """SHA-256 over `about` and the names and contents of the files."""
    whole = hashlib.sha256(about)
    for name in names:
        whole.update(f"\n{name}\n{file_hash(folder / name)}".encode())
    return whole.hexdigest()


def file_hash(path: Path) -> str:
    """The SHA-256 of a file's content, hexadecimal."""
    found = hashlib.sha256()
    with open_regular(path) as file:
        while piece := file.read(PIECE_BYTES):
            found.update(piece)
    return found.hexdigest()


def describe_file(path: Path) -> WrittenDocument:
    return WrittenDocument(name=path.name, bytes=path.stat().st_size, sha256=file_hash(path))

"""Receive an uploaded cloud into a file, checking it while it arrives; LAZ, which has its index last, afterwards."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from daemon.runtime.durable_files import create_file, make_folder
from daemon.runtime.workers import Workers
from daemon.store.database import storage_errors
from registration.io.reading import open_cloud
from registration.io.stream import CloudStream

LAZ = "application/vnd.laszip"
SUFFIXES = {
    "application/x-ply": ".ply",
    "application/x-pcd": ".pcd",
    "application/octet-stream": ".f32",
    LAZ: ".laz",
}
"""File suffixes by media type; octets are float32 x, y, z."""

ORIGIN = "request body"


@dataclass(frozen=True)
class Upload:
    """A complete cloud on the disk, and how many points it has, with those that are not finite."""

    file: Path
    points: int


@asynccontextmanager
async def receive_upload(
    body: AsyncIterator[bytes], folder: Path, name: str, media_type: str, unit: str, workers: Workers
) -> AsyncIterator[Upload]:
    """Yield the complete cloud in a file of `folder`, which is deleted afterwards unless it was renamed.

    Raises CloudError, StorageError.
    """
    file = folder / f".{name}.upload{SUFFIXES[media_type]}"
    try:
        await workers.run(_make_folder, folder)
        with await workers.run(_open, file) as out:
            stream = None if media_type == LAZ else CloudStream(media_type, np.eye(4), unit)
            async for chunk in body:
                await workers.run(_append, out, file, stream, chunk)
            if stream is not None:
                stream.finish()
        yield Upload(file, await workers.run(_read_through, file) if stream is None else stream.points)
    finally:
        with suppress(OSError):
            await workers.run(file.unlink, missing_ok=True)


def _make_folder(folder: Path) -> None:
    with storage_errors(folder):
        make_folder(folder)


def _open(file: Path) -> BinaryIO:
    with storage_errors(file):
        return create_file(file)


def _append(out: BinaryIO, file: Path, stream: CloudStream | None, chunk: bytes) -> None:
    if stream is not None:
        for _ in stream.parts(chunk):
            pass
    with storage_errors(file):
        out.write(chunk)


def _read_through(file: Path) -> int:
    """Check a LAZ file by reading all its blocks; returns the number of points."""
    with open_cloud(file, ORIGIN) as cloud:
        return sum(len(block) for block in cloud.blocks())

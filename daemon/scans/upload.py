"""Receive an uploaded cloud into a file, checking it while it arrives; LAZ and NPZ, whose index is last, afterwards."""

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
from registration.points.range_check import RangeCheck

LAZ = "application/vnd.laszip"
PLY = "application/x-ply"
NPZ = "application/x-npz"
WHOLE = (LAZ, NPZ)
"""Formats whose index is at the end: they cannot be streamed."""
SUFFIXES = {PLY: ".ply", "application/x-pcd": ".pcd", "application/octet-stream": ".f32", LAZ: ".laz", NPZ: ".npz"}
"""File suffixes by media type; octets are float32 x, y, z."""

ORIGIN = "request body"


@dataclass(frozen=True)
class Upload:
    """A complete cloud on the disk, and how many points it has, with those that are not finite."""

    file: Path
    points: int


@asynccontextmanager
async def receive_upload(
    body: AsyncIterator[bytes | memoryview],
    folder: Path,
    name: str,
    media_type: str,
    unit: str,
    workers: Workers,
    check: RangeCheck | None,
) -> AsyncIterator[Upload]:
    """Yield the complete cloud in a file of `folder`, which is deleted afterwards unless it was renamed.

    A cloud whose unit cannot be is refused by the `check`. Raises CloudError, ScanError, StorageError.
    """
    file = folder / f".{name}.upload{SUFFIXES[media_type]}"
    try:
        async with workers.opened(_create, file) as out:
            stream = None if media_type in WHOLE else CloudStream.of_body(media_type, np.eye(4), unit, check)
            async for chunk in body:
                await workers.run(_append, out, file, stream, chunk)
            if stream is not None:
                list(stream.last_parts())
        yield Upload(file, await workers.run(_read_through, file, check) if stream is None else stream.points)
    finally:
        with suppress(OSError):
            await workers.run(file.unlink, missing_ok=True)


def _create(file: Path) -> BinaryIO:
    with storage_errors(file):
        make_folder(file.parent)
        return create_file(file)


def _append(out: BinaryIO, file: Path, stream: CloudStream | None, chunk: bytes | memoryview) -> None:
    if stream is not None:
        list(stream.parts(chunk))
    with storage_errors(file):
        out.write(chunk)


def _read_through(file: Path, check: RangeCheck | None) -> int:
    """Check a file of WHOLE by reading all its blocks; returns the number of points."""
    points = 0
    with open_cloud(file, ORIGIN) as cloud:
        for block in cloud.blocks():
            points += len(block)
            if check is not None:
                check.look(block, cloud.layout)
    if check is not None:
        check.require(ORIGIN)
    return points

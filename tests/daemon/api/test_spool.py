"""A queue that does not wait long for its reader, and gives back every byte in order."""

import asyncio
import hashlib
import random
from pathlib import Path

import pytest

from daemon.api.streaming.spool import AwaitedSpool
from daemon.errors import StorageError


async def passed(spool: AwaitedSpool, pieces: list[bytes], reader_waits: bool) -> bytes:
    """What a reader gets while, or after, a writer puts."""

    async def write() -> None:
        for piece in pieces:
            await spool.put(piece)
        spool.end()

    async def read() -> bytes:
        content = bytearray()
        while piece := await spool.get():
            content += piece
        return bytes(content)

    writing = asyncio.create_task(write())
    if reader_waits:
        await writing
    content = await read()
    await writing
    return content


@pytest.mark.parametrize("memory_bytes", [0, 10_000, 1_000_000_000])
@pytest.mark.parametrize("reader_waits", [False, True])
async def test_every_byte_in_order(tmp_path: Path, memory_bytes: int, reader_waits: bool) -> None:
    chance = random.Random(5)
    pieces = [chance.randbytes(chance.randrange(1, 70_000)) for _ in range(300)]
    spool = AwaitedSpool(tmp_path, memory_bytes)
    content = await passed(spool, pieces, reader_waits)
    spool.close()
    assert hashlib.sha256(content).hexdigest() == hashlib.sha256(b"".join(pieces)).hexdigest()


async def test_an_empty_queue_that_ends_is_over(tmp_path: Path) -> None:
    assert await passed(AwaitedSpool(tmp_path), [], reader_waits=False) == b""


async def test_an_empty_piece_is_not_the_end(tmp_path: Path) -> None:
    assert await passed(AwaitedSpool(tmp_path), [b"", b"one", b"", b"two"], reader_waits=True) == b"onetwo"


async def test_a_reader_that_is_only_behind_costs_no_file(tmp_path: Path) -> None:
    spool = AwaitedSpool(tmp_path / "where no file can be made", memory_bytes=10)
    assert await passed(spool, [b"123456"] * 100, reader_waits=False) == b"123456" * 100


async def test_a_folder_that_is_not_there_is_a_storage_error(tmp_path: Path) -> None:
    spool = AwaitedSpool(tmp_path / "gone", memory_bytes=10)
    with pytest.raises(StorageError):
        await spool.put(b"more than ten bytes")

"""Worker threads: what one of them opens is closed, whenever its caller leaves."""

import asyncio
import threading
from pathlib import Path
from typing import BinaryIO

import pytest

from daemon.runtime.clock import Clock
from daemon.runtime.workers import Workers
from tests.support.waiting import eventually


@pytest.mark.parametrize("leaves", ["while it is opened", "while it is used"])
async def test_a_file_is_closed_whenever_its_caller_leaves(leaves: str, tmp_path: Path) -> None:
    workers, begun, may_open, in_use = (
        Workers(Clock(), threads=1),
        threading.Event(),
        threading.Event(),
        asyncio.Event(),
    )
    files: list[BinaryIO] = []

    def open_slowly(path: Path) -> BinaryIO:
        begun.set()
        may_open.wait()
        files.append(path.open("wb"))
        return files[0]

    async def write() -> None:
        async with workers.opened(open_slowly, tmp_path / "cloud"):
            in_use.set()
            await asyncio.Event().wait()

    writing = asyncio.create_task(write())
    await eventually(begun.is_set)
    if leaves == "while it is used":
        may_open.set()
        await in_use.wait()
    writing.cancel()
    await asyncio.gather(writing, return_exceptions=True)
    may_open.set()
    await eventually(lambda: bool(files) and files[0].closed)
    workers.close()

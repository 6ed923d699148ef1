"""A daemon in a process of its own, without robot or camera: `kill -9` is allowed."""

import asyncio
import json
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import httpx

from tests.support.waiting import LIMIT_S

SETTINGS = """
[robot]
address = "tcp://127.0.0.1:9"
box_mm = [[-2000, -2000, -500], [2000, 2000, 2500]]
[camera]
address = "http://127.0.0.1:9/frame.png"
[target]
kind = "chessboard"
columns = 11
rows = 8
pitch_mm = 20.0
[server]
port = 0
[storage]
folder = "store"
reserve_mb = 0
"""


@asynccontextmanager
async def a_daemon(folder: Path) -> AsyncIterator[tuple[asyncio.subprocess.Process, httpx.AsyncClient]]:
    """A daemon process without robot or camera, ready to take clouds; killed at the end at the latest."""
    (folder / "handeyed.toml").write_text(SETTINGS)
    ready = folder / "ready.json"
    ready.unlink(missing_ok=True)
    command = [sys.executable, "-m", "daemon.cli", "serve", str(folder / "handeyed.toml"), "--ready-file", str(ready)]
    process = await asyncio.create_subprocess_exec(*command, stdout=asyncio.subprocess.DEVNULL)
    try:
        async with asyncio.timeout(LIMIT_S):
            while not (ready.exists() and ready.read_text()):
                assert process.returncode is None
                await asyncio.sleep(0.02)
        async with httpx.AsyncClient(
            base_url=json.loads(ready.read_text())["url"], verify=False, timeout=LIMIT_S
        ) as client:
            yield process, client
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()

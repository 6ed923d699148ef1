"""What a scan holds after its daemon was killed: every view that was answered, and nothing of one that was not."""

import asyncio
import json
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from urllib.parse import urlsplit

import httpx

from registration.io.reading import open_cloud
from registration.scan import read_scan
from tests.daemon.api.test_register import PLY, cloud
from tests.daemon.fakes import ply_of
from tests.daemon.scans.test_scans import POSES, names
from tests.mock_robot.running_cell import becomes

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
        async with asyncio.timeout(40):
            while not (ready.exists() and ready.read_text()):
                assert process.returncode is None
                await asyncio.sleep(0.02)
        async with httpx.AsyncClient(base_url=json.loads(ready.read_text())["url"], timeout=30) as client:
            yield process, client
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()


async def test_a_finished_upload_survives_a_kill_and_an_interrupted_one_leaves_no_trace(tmp_path: Path) -> None:
    whole, torn = ply_of(cloud(2000)), ply_of(cloud(300_000))
    async with a_daemon(tmp_path) as (process, client):
        scan = (await client.post("/scans", json={"name": "door"})).json()
        link = scan["links"]["views"]
        answer = await client.post(link, params={"pose": POSES[0]}, content=whole, headers=PLY)
        assert answer.status_code == 201, answer.text
        host = urlsplit(str(client.base_url))
        _, writer = await asyncio.open_connection(host.hostname, host.port)
        head = f"POST {link}?pose={POSES[1]} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/x-ply\r\n"
        writer.write(f"{head}Content-Length: {len(torn)}\r\n\r\n".encode() + torn[: len(torn) // 2])
        folder = tmp_path / "store" / "scans" / scan["id"]
        await becomes(lambda: any(file.stat().st_size > 100_000 for file in folder.glob(".*.upload*")))
        process.send_signal(signal.SIGKILL)
        await process.wait()
        writer.close()

    async with a_daemon(tmp_path) as (_, client):
        seen = (await client.get(scan["links"]["self"])).json()
        assert [view["file"] for view in seen["views"]] == ["view_000.ply"]
        assert (folder / "view_000.ply").read_bytes() == whole
        assert sorted(names(folder)) == ["scan.json", "view_000.ply"]
        answer = await client.post(link, params={"pose": POSES[1]}, content=torn, headers=PLY)
        assert answer.json()["file"] == "view_001.ply"
        assert len(read_scan(folder)) == 2
        with open_cloud(folder / "view_001.ply") as source:
            assert source.count == 300_000

"""What a scan holds after its daemon was killed: every view that was answered, and nothing of one that was not."""

import asyncio
import signal
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from registration.io.reading import open_cloud
from registration.scan_folder import read_scan
from tests.daemon.clouds import PLY, POSES, cloud
from tests.daemon.daemon_process import a_daemon
from tests.daemon.fakes import ply_of
from tests.daemon.scans.scan_folders import names
from tests.support.waiting import eventually

pytestmark = pytest.mark.slow


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
        await eventually(lambda: any(file.stat().st_size > 100_000 for file in folder.glob(".*.upload*")))
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

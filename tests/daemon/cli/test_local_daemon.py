"""Commands beside a daemon of this machine: over TLS they trust the settings' certificate, whatever names are in it."""

import asyncio
import os
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import pytest

from daemon.access.certificates import CERTIFICATE, PRIVATE_KEY, make_certificate
from daemon.cli.rest_client import client_of, connect
from daemon.config.settings import Settings
from handeyed import ClientError
from tests.conftest import ROOT
from tests.daemon.cell_under_test import serving, settings_for
from tests.daemon.runtime.service_manager import Manager


def over_tls(folder: Path, host: str) -> Settings:
    """The fake cell's settings with a certificate for `host`."""
    tls = folder / f"tls-{host}"
    make_certificate(tls, [host], datetime.now(UTC))
    files = {"certificate": str(tls / CERTIFICATE), "private_key": str(tls / PRIVATE_KEY)}
    return settings_for(folder / "store", server=files)


def software(settings: Settings, url: str) -> str:
    server = settings.server.model_copy(update={"port": int(url.rpartition(":")[2])})
    with client_of(settings.model_copy(update={"server": server}), 30) as daemon:
        return str(daemon.get("/health")["software"])


async def test_the_settings_certificate_is_trusted_and_no_other(tmp_path: Path) -> None:
    settings, other = over_tls(tmp_path, "cell-7"), over_tls(tmp_path, "cell-8")
    async with serving(settings) as bench:
        assert (await asyncio.to_thread(software, settings, bench.url)).startswith("handeyed ")
        with pytest.raises(ClientError, match="its certificate is not trusted"):
            await asyncio.to_thread(software, other, bench.url)


async def test_a_certificate_is_for_this_machine_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With its authority alone, as curl asks."""
    settings = over_tls(tmp_path, "cell-7")
    monkeypatch.setenv("HANDEYED_CA", str(tmp_path / "tls-cell-7" / "authority.pem"))

    def ask(url: str) -> str:
        with connect(url) as daemon:
            return str(daemon.get("/health")["status"])

    async with serving(settings) as bench:
        port = bench.url.rpartition(":")[2]
        for host in ("127.0.0.1", "localhost"):
            assert await asyncio.to_thread(ask, f"https://{host}:{port}") == "alive"


async def test_a_service_that_cannot_read_its_settings_says_why_in_its_status(tmp_path: Path) -> None:
    """It ends with status 2, which the unit does not retry."""
    settings, manager = tmp_path / "handeyed.toml", Manager(f"{tmp_path}/notify")
    settings.write_text((ROOT / "deploy" / "handeyed.example.toml").read_text().replace("speed_mm_s =", "speed_mms ="))
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "daemon.cli", "serve", str(settings), cwd=ROOT,
        env={**os.environ, "NOTIFY_SOCKET": f"{tmp_path}/notify"}, stderr=subprocess.PIPE,
    )  # fmt: skip
    _, said = await process.communicate()
    status = await manager.hears(of="STATUS=")
    manager.socket.close()
    assert process.returncode == 2
    assert "robot.speed_mms: unknown key: did you mean 'speed_mm_s'?" in status
    assert "robot.speed_mms: unknown key" in said.decode()

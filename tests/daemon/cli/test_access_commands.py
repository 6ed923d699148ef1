"""`handeyed keys`, `handeyed tls` and `handeyed audit`, as a person types them beside a running daemon."""

import asyncio
import json
import os
from pathlib import Path

import pytest

from daemon.cli.checks import check_devices
from daemon.cli.rest_client import connect
from handeyed import ClientError
from tests.daemon.access_keys import bearer
from tests.daemon.cell_under_test import serving, settings_for
from tests.daemon.cli.running import handeyed
from tests.daemon.daemon_process import SETTINGS


@pytest.fixture
def config(tmp_path: Path) -> Path:
    file = tmp_path / "handeyed.toml"
    file.write_text(SETTINGS)
    return file


def test_a_key_is_shown_once_listed_rotated_and_revoked(config: Path) -> None:
    added = handeyed("keys", "add", config, "MES", "--role", "operator", "--days", "30")
    assert added.status == 0, added.err
    key = added.out.strip()
    assert key.startswith("hek_")
    assert "shown this once" in added.err
    listed = handeyed("keys", "list", config)
    assert key not in listed.out
    assert "operator valid" in " ".join(listed.out.split())
    rotated = json.loads(handeyed("keys", "rotate", config, "MES", "--json").out)
    assert rotated["key"] != key
    assert handeyed("keys", "revoke", config, "MES").status == 0
    rows = json.loads(handeyed("keys", "list", config, "--json").out)
    assert [(row["name"], row["state"]) for row in rows] == [("MES", "revoked")] * 2
    assert not any("hash" in row for row in rows)
    gone = handeyed("keys", "revoke", config, "MES")
    assert (gone.status, "there is no valid key called 'MES'" in gone.err) == (1, True)
    whole = handeyed("audit", "verify", config)
    assert (whole.status, whole.out) == (0, "the audit log is whole: 4 rows\n")


def test_what_is_typed_wrongly_is_reported(config: Path, tmp_path: Path) -> None:
    assert "use viewer, operator, admin" in handeyed("keys", "add", config, "x", "--role", "king").err
    assert "printable" in handeyed("keys", "add", config, "a\x1b[31m").err
    handeyed("keys", "add", config, "x")
    assert "choose another name" in handeyed("keys", "add", config, "x").err
    assert "not ROW:HASH" in handeyed("audit", "verify", config, "--anchor", "7").err
    forged = handeyed("audit", "verify", config, "--anchor", f"9:{'0' * 64}")
    assert (forged.status, "its end was cut off" in forged.out) == (1, True)
    assert "unable to open" in handeyed("audit", "verify", _elsewhere(tmp_path)).err


def _elsewhere(folder: Path) -> Path:
    (folder / "elsewhere").mkdir()
    file = folder / "elsewhere" / "handeyed.toml"
    file.write_text(SETTINGS)
    return file


def test_a_store_of_another_user_is_left_alone(config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 12345)
    refused = handeyed("keys", "add", config, "x")
    assert (refused.status, "sudo -u handeyed" in refused.err) == (1, True)


def test_a_certificate_is_made_and_the_settings_are_reported(tmp_path: Path) -> None:
    made = handeyed("tls", "init", "--host", "cell-7", "--host", "10.0.0.7", "--out", tmp_path / "tls")
    assert made.status == 0, made.err
    assert f'certificate = "{tmp_path}/tls/certificate.pem"' in made.out
    assert sorted(file.name for file in (tmp_path / "tls").iterdir()) == [
        "authority.pem", "certificate.pem", "private_key.pem"
    ]  # fmt: skip
    again = handeyed("tls", "init", "--out", tmp_path / "tls")
    assert (again.status, "is there already" in again.err) == (1, True)


@pytest.mark.slow
async def test_a_running_daemon_knows_a_key_at_once(config: Path, tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path / "store")) as bench:
        assert (await bench.client.get("/runs")).status_code == 200
        key = (await asyncio.to_thread(handeyed, "keys", "add", config, "Ann", "--role", "viewer")).out.strip()
        assert (await bench.client.get("/runs")).status_code == 401
        assert (await bench.client.get("/runs", headers=bearer(key))).status_code == 200
        await asyncio.to_thread(handeyed, "keys", "revoke", config, "Ann")
        assert (await bench.client.get("/runs", headers=bearer(key))).status_code == 401


async def test_commands_ask_with_the_key_of_the_environment(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with serving(settings_for(tmp_path / "store")) as bench:
        key = (await asyncio.to_thread(handeyed, "keys", "add", config, "Ann")).out.strip()
        with pytest.raises(ClientError, match="this needs a key"):
            await asyncio.to_thread(asks, bench.url)
        monkeypatch.setenv("HANDEYED_KEY", key)
        assert await asyncio.to_thread(asks, bench.url) == {"runs": [], "next": None, "damaged": []}
        monkeypatch.setenv("HANDEYED_CA", str(config))
        with pytest.raises(ClientError, match=r"authority\.pem"):
            await asyncio.to_thread(asks, bench.url)


def asks(url: str) -> object:
    with connect(url) as daemon:
        return daemon.get("/runs")


async def test_check_leaves_the_devices_to_a_running_daemon_though_it_has_no_key_for_it(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with serving(settings_for(tmp_path / "store")) as bench:
        key = (await asyncio.to_thread(handeyed, "keys", "add", config, "Ann", "--role", "viewer")).out.strip()
        port = bench.url.rpartition(":")[2]
        settings = settings_for(tmp_path / "store", server={"port": int(port)})
        without = await asyncio.to_thread(asyncio.run, check_devices(settings))
        assert [(row.name, row.ok) for row in without] == [("daemon", True), ("cell", False)]
        assert "HANDEYED_KEY" in without[1].fix
        monkeypatch.setenv("HANDEYED_KEY", key)
        rows = await asyncio.to_thread(asyncio.run, check_devices(settings))
        assert all(row.ok for row in rows), rows

"""`handeyed keys`, `handeyed tls` and `handeyed audit`, as a person types them beside a running daemon."""

import asyncio
import json
import os
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from daemon.cli.checks import check_devices
from daemon.cli.errors import CommandError
from daemon.cli.main import app
from daemon.cli.rest_client import DaemonClient
from tests.daemon.access.test_access import bearer
from tests.daemon.cell_under_test import serving, settings_for
from tests.daemon.scans.test_scans_killed import SETTINGS


def handeyed(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def config(tmp_path: Path) -> Path:
    file = tmp_path / "handeyed.toml"
    file.write_text(SETTINGS)
    return file


def test_a_key_is_shown_once_listed_rotated_and_revoked(config: Path) -> None:
    added = handeyed("keys", "add", config, "MES", "--role", "operator", "--days", 30)
    assert added.exit_code == 0, added.output
    key = added.stdout.strip()
    assert key.startswith("hek_")
    assert "shown this once" in added.stderr
    listed = handeyed("keys", "list", config)
    assert key not in listed.stdout
    assert "operator valid" in " ".join(listed.stdout.split())
    rotated = json.loads(handeyed("keys", "rotate", config, "MES", "--json").stdout)
    assert rotated["key"] != key
    assert handeyed("keys", "revoke", config, "MES").exit_code == 0
    rows = json.loads(handeyed("keys", "list", config, "--json").stdout)
    assert [(row["name"], row["state"]) for row in rows] == [("MES", "revoked")] * 2
    assert not any("hash" in row for row in rows)
    gone = handeyed("keys", "revoke", config, "MES")
    assert (gone.exit_code, "there is no valid key called 'MES'" in gone.stderr) == (1, True)
    whole = handeyed("audit", "verify", config)
    assert (whole.exit_code, whole.stdout) == (0, "the audit log is whole: 4 rows\n")


def test_what_is_typed_wrongly_is_told(config: Path, tmp_path: Path) -> None:
    assert "use viewer, operator, admin" in handeyed("keys", "add", config, "x", "--role", "king").stderr
    assert "printable" in handeyed("keys", "add", config, "a\x1b[31m").stderr
    handeyed("keys", "add", config, "x")
    assert "choose another name" in handeyed("keys", "add", config, "x").stderr
    assert "not ROW:HASH" in handeyed("audit", "verify", config, "--anchor", "7").stderr
    forged = handeyed("audit", "verify", config, "--anchor", f"9:{'0' * 64}")
    assert (forged.exit_code, "its end was cut off" in forged.stdout) == (1, True)
    assert "unable to open" in handeyed("audit", "verify", _elsewhere(tmp_path)).stderr


def _elsewhere(folder: Path) -> Path:
    (folder / "elsewhere").mkdir()
    file = folder / "elsewhere" / "handeyed.toml"
    file.write_text(SETTINGS)
    return file


def test_a_store_of_another_user_is_left_alone(config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 12345)
    refused = handeyed("keys", "add", config, "x")
    assert (refused.exit_code, "sudo -u handeyed" in refused.stderr) == (1, True)


def test_a_certificate_is_made_and_the_settings_are_told(tmp_path: Path) -> None:
    made = handeyed("tls", "init", "--host", "cell-7", "--host", "10.0.0.7", "--out", tmp_path / "tls")
    assert made.exit_code == 0, made.output
    assert f'certificate = "{tmp_path}/tls/certificate.pem"' in made.stdout
    assert sorted(file.name for file in (tmp_path / "tls").iterdir()) == [
        "authority.pem", "certificate.pem", "private_key.pem"
    ]  # fmt: skip
    again = handeyed("tls", "init", "--out", tmp_path / "tls")
    assert (again.exit_code, "is there already" in again.stderr) == (1, True)


async def test_a_running_daemon_knows_a_key_at_once(config: Path, tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path / "store")) as bench:
        assert (await bench.client.get("/runs")).status_code == 200
        key = (await asyncio.to_thread(handeyed, "keys", "add", config, "Ann", "--role", "viewer")).stdout.strip()
        assert (await bench.client.get("/runs")).status_code == 401
        assert (await bench.client.get("/runs", headers=bearer(key))).status_code == 200
        await asyncio.to_thread(handeyed, "keys", "revoke", config, "Ann")
        assert (await bench.client.get("/runs", headers=bearer(key))).status_code == 401


async def test_commands_ask_with_the_key_of_the_environment(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with serving(settings_for(tmp_path / "store")) as bench:
        key = (await asyncio.to_thread(handeyed, "keys", "add", config, "Ann")).stdout.strip()
        with pytest.raises(CommandError, match="this needs a key"):
            await asyncio.to_thread(asks, bench.url)
        monkeypatch.setenv("HANDEYED_KEY", key)
        assert await asyncio.to_thread(asks, bench.url) == {"runs": [], "next": None}
        monkeypatch.setenv("HANDEYED_CA", str(config))
        with pytest.raises(CommandError, match=r"authority\.pem"):
            await asyncio.to_thread(asks, bench.url)


def asks(url: str) -> object:
    with DaemonClient(url) as daemon:
        return daemon.get("/runs")


async def test_check_leaves_the_devices_to_a_running_daemon_though_it_has_no_key_for_it(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with serving(settings_for(tmp_path / "store")) as bench:
        key = (await asyncio.to_thread(handeyed, "keys", "add", config, "Ann", "--role", "viewer")).stdout.strip()
        port = bench.url.rpartition(":")[2]
        settings = settings_for(tmp_path / "store", server={"port": int(port)})
        without = await asyncio.to_thread(asyncio.run, check_devices(settings))
        assert [(row.name, row.ok) for row in without] == [("daemon", True), ("cell", False)]
        assert "HANDEYED_KEY" in without[1].fix
        monkeypatch.setenv("HANDEYED_KEY", key)
        assert all(row.ok for row in await asyncio.to_thread(asyncio.run, check_devices(settings)))

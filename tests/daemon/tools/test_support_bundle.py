"""A support bundle tells an engineer what is needed, and nobody a secret: secrets are planted, and looked for."""

import gzip
import io
import json
import sqlite3
import tarfile
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

import pytest
from typer.testing import CliRunner

from daemon.cli.main import app
from daemon.tools.support_bundle.bundle import gather
from daemon.tools.support_bundle.redaction import REMOVED, redact, redact_values
from tests.daemon.cell_under_test import serving, settings_for
from tests.drivers.http_devices import Answer, http_device

NOW = datetime(2026, 11, 21, 9, tzinfo=UTC)

PLANTED = {
    "camera user": "cam-admin",
    "camera password": "s3cr3t-of-the-camera",
    "query token": "query-token-4711",
    "long key": "b7e1" * 16,
    "bearer": "eyJhbGciOiJIUzI1NiJ9.payload.signature",
    "setup code": "YM9R-LA35-QWFY-ESMV",
    "webhook secret": "hook-secret-0815",
    "pem": "MIIEvQIBADANBgkq",
    "hash of a key": "9f86d081884c7d65",
    "cookie": "session-cookie-77",
    "api key": "c0ffee" * 10 + "4711",
}

SETTINGS = """
[robot]
address = "tcp://192.0.2.7:5020"
box_mm = [[-2000, -2000, -500], [2000, 2000, 2500]]
[camera]
address = "http://{camera user}:{camera password}@192.0.2.20/frame.png?token={query token}"
[target]
kind = "chessboard"
columns = 11
rows = 8
pitch_mm = 20.0
[server]
port = 1
[storage]
folder = "{{folder}}"
reserve_mb = 0
"""

LOG = """\
<6>INFO run=- request=- daemon.server: handeyed listens on http://127.0.0.1:8372
<4>WARNING the first key: 'handeyed keys add', or POST /setup with the code {setup code}
GET /ready Authorization: Bearer {bearer}
curl -H 'X-Api-Key: {long key}' http://127.0.0.1:8372/ready
camera http://{camera user}:{camera password}@192.0.2.20/frame.png: connection refused
<4>WARNING GET /hek_1a2b3c4d_{api key}/frame.png is refused: no such route
password={webhook secret} cookie: {cookie}
-----BEGIN PRIVATE KEY-----
{pem}
-----END PRIVATE KEY-----
<6>INFO run=20261121-090000-3f9a1c request=- daemon.runs.run_log: verify finished, station 3 of 3
"""


def filled(text: str) -> str:
    for name, secret in PLANTED.items():
        text = text.replace(f"{{{name}}}", secret)
    return text


def contents(archive: bytes) -> dict[str, str]:
    with tarfile.open(fileobj=io.BytesIO(archive), mode="r:gz") as files:
        return {
            member.name.removeprefix("handeyed-support/"): (files.extractfile(member) or io.BytesIO()).read().decode()
            for member in files.getmembers()
        }


async def a_cell_with_secrets(folder: Path) -> Path:
    """A store with a calibration, verifications and keys; settings and a log full of secrets."""
    store = folder / "store"
    async with serving(settings_for(store, calibration={"policy": "auto"})) as bench:
        await bench.run_over((await bench.client.post("/calibrate")).headers["location"])
        await bench.verify()
    with closing(sqlite3.connect(store / "handeyed.sqlite")) as db, db:
        row = ("k", "mes", "operator", PLANTED["hash of a key"], "2026-11-21")
        db.execute("INSERT INTO access_keys (id, name, role, hash, created_at) VALUES (?, ?, ?, ?, ?)", row)
    config = folder / "handeyed.toml"
    config.write_text(filled(SETTINGS).replace("{{folder}}", str(store)).replace("{folder}", str(store)))
    (folder / "handeyed.log").write_text(filled(LOG))
    (folder / "webhook.secret").write_text(PLANTED["webhook secret"])
    named_by_a_key = store / "runs" / f"z-hek_1a2b3c4d_{PLANTED['api key']}"
    named_by_a_key.mkdir()
    (named_by_a_key / "session.json").write_text(json.dumps({f"hek_1a2b3c4d_{PLANTED['api key']}": 1}))
    return config


async def test_no_planted_secret_leaves_the_cell(tmp_path: Path) -> None:
    config = await a_cell_with_secrets(tmp_path)
    target = tmp_path / "bundle.tar.gz"
    bundle = gather(config, NOW, tmp_path / "handeyed.log")
    assert bundle.write(target, NOW) == target.stat().st_size
    found = contents(target.read_bytes())
    for file, text in found.items():
        for name, secret in PLANTED.items():
            assert secret not in file + text, f"{name} is in {file}"


async def test_what_an_engineer_needs_is_inside(tmp_path: Path) -> None:
    config = await a_cell_with_secrets(tmp_path)
    found = gather(config, NOW, tmp_path / "handeyed.log").files
    settings = json.loads(found["settings.json"])
    assert settings["robot"]["address"] == "tcp://192.0.2.7:5020"
    assert settings["camera"]["address"].startswith(f"http://{REMOVED}@192.0.2.20/frame.png")
    assert "numpy" in json.loads(found["machine.json"])["packages"]
    store = json.loads(found["store.json"])
    rows = {table["name"]: table["rows"] for table in store["tables"]}
    assert (rows["runs"], rows["access_keys"]) == (2, 1)
    assert store["integrity"] == ["ok"]
    runs = json.loads(found["runs.json"])
    assert [run["kind"] for run in runs] == ["verify", "calibration"]
    assert runs[0]["result"]["verification"]["points"] == "left out"
    assert runs[1]["id"] == store["applied"][0]["calibration_id"]
    assert json.loads(found[f"sessions/{runs[0]['id']}.json"])["views"]
    assert "verify finished, station 3 of 3" in found["log.txt"]
    assert "no answer" in found["daemon-health.txt"]


@pytest.mark.slow
def test_another_program_at_the_daemons_port_does_not_fill_the_bundle(tmp_path: Path) -> None:
    bomb = gzip.compress(bytes(60_000_000))
    with http_device(Answer(bomb, headers={"Content-Encoding": "gzip"})) as device:
        device.answers["/metrics"] = Answer(b"x" * 6_000_000)
        config = tmp_path / "handeyed.toml"
        config.write_text(filled(SETTINGS).replace("{{folder}}", "store").replace("port = 1", f"port = {device.port}"))
        found = gather(config, NOW).files
    assert len(found["daemon-health.txt"]) <= 2 * len(bomb)
    assert found["daemon-metrics.txt"] == f"200\n{REMOVED}"


def test_settings_that_cannot_be_loaded_are_no_reason_to_stop(tmp_path: Path) -> None:
    config = tmp_path / "broken.toml"
    config.write_text('[robot]\naddress = "tcp://r:1"\npassword = "s3cr3t-of-the-camera"\n')
    found = gather(config, NOW).files
    assert "camera: missing: add it" in found["settings-problems.txt"]
    assert json.loads(found["settings.json"])["robot"] == {"address": "tcp://r:1", "password": REMOVED}
    config.write_bytes(b"\xff not TOML")
    assert "could not be gathered" in gather(config, NOW).files["settings.json"]
    assert "could not be gathered" in gather(tmp_path / "none.toml", NOW).files["settings.json"]


def test_the_command(tmp_path: Path) -> None:
    config, target = tmp_path / "handeyed.toml", tmp_path / "out.tar.gz"
    config.write_text(filled(SETTINGS).replace("{{folder}}", str(tmp_path / "none")).replace("{folder}", "store"))
    done = CliRunner().invoke(app, ["support-bundle", str(config), "--out", str(target), "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.output)
    assert set(told["contents"]) == set(contents(target.read_bytes()))
    nowhere = CliRunner().invoke(app, ["support-bundle", str(config), "--out", "/proc/nowhere/out.tar.gz"])
    assert nowhere.exit_code == 1
    assert "/proc/nowhere" in nowhere.output


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    "word", ["x", "a-", "secret", "http://", "-----BEGIN ", "+", "AAAA-", "bearer ", "://", "hek_"]
)
def test_a_hostile_log_takes_no_quadratic_time(word: str) -> None:
    redact(word * (300_000 // len(word)))


@pytest.mark.parametrize(
    "kept",
    [
        "run 20261121-090000-3f9a1c: finished",
        "tcp://192.168.125.1:5020 refused",
        "/var/lib/handeyed/runs/20261121-090000-3f9a1c/a-very-long-name-of-a-file-that-is-no-secret.png",
        "2026-11-21T09:00:00.000Z INFO run=- daemon.runs.supervisor: ready",
        "the key of a viewer is asked for",
        "handeyed_http_requests_total{method=\"GET\",status=\"200\"} 12",
    ],
)  # fmt: skip
def test_what_is_no_secret_is_kept(kept: str) -> None:
    assert redact(kept) == kept


def test_secret_keys_are_known_by_name_wherever_they_stand() -> None:
    given = {"a": [{"api_key": "1", "private_key": "2", "keyboard": "3", "secret_file": "4", "monkey": "5"}]}
    assert redact_values(given) == {
        "a": [{"api_key": REMOVED, "private_key": REMOVED, "keyboard": "3", "secret_file": REMOVED, "monkey": "5"}]
    }

"""A support bundle tells an engineer what is needed, and nobody a secret: secrets are planted, and looked for."""

import gzip
import io
import json
import logging
import re
import sqlite3
import tarfile
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from daemon.cli.main import app
from daemon.errors import StorageError
from daemon.tools.support_bundle.bundle import PIECE, REMOVED, gather, redact, redact_lines, redact_values
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.drivers.http_devices import Answer, http_device
from tests.support.waiting import LIMIT_S

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
    return {name: content.decode() for name, content in contents_of(archive).items()}


def contents_of(archive: bytes) -> dict[str, bytes]:
    with tarfile.open(fileobj=io.BytesIO(archive), mode="r:gz") as files:
        return {
            member.name.removeprefix("handeyed-support/"): (files.extractfile(member) or io.BytesIO()).read()
            for member in files.getmembers()
        }


async def a_cell_with_secrets(folder: Path) -> Path:
    """A store with a calibration, verifications and keys; settings and a log full of secrets."""
    store = folder / "store"
    async with serving(settings_for(store, calibration={"policy": "auto", "tolerance_mm": 20.0})) as bench:
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
    bundle = gather(config, tmp_path / "handeyed.log")
    assert bundle.write(target, NOW) == target.stat().st_size
    found = contents(target.read_bytes())
    for file, text in found.items():
        for name, secret in PLANTED.items():
            assert secret not in file + text, f"{name} is in {file}"


async def test_what_an_engineer_needs_is_inside(tmp_path: Path) -> None:
    config = await a_cell_with_secrets(tmp_path)
    found = gather(config, tmp_path / "handeyed.log").files
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


async def test_the_daemon_makes_one_itself_of_what_it_has_loaded_and_logged(tmp_path: Path) -> None:
    camera = {"address": filled("http://{camera user}:{camera password}@192.0.2.20/frame.png?token={query token}")}
    async with serving(settings_for(tmp_path, camera=camera)) as bench:
        logging.getLogger("daemon.test").warning(filled("Authorization: Bearer {bearer}; code {setup code}; hello"))
        answer = await bench.client.post("/support-bundle")
    found = contents(answer.content)
    assert answer.headers["content-type"] == "application/gzip"
    assert re.fullmatch(
        r'attachment; filename="handeyed-support-[0-9-]{15}\.tar\.gz"', answer.headers["content-disposition"]
    )
    with closing(sqlite3.connect(tmp_path / "handeyed.sqlite")) as db:
        assert ("POST", "/support-bundle") in db.execute("SELECT action, subject FROM audit").fetchall()
    settings = json.loads(found["settings.json"])
    assert settings["target"]["columns"] == 11
    assert settings["drift"]["learn"] == 5, "also what the file does not name"
    assert json.loads(found["daemon-health.txt"])["status"] == "alive"
    assert json.loads(found["daemon-ready-camera.txt"])["register"]["ready"] is False
    assert "handeyed_run_in_progress 0" in found["daemon-metrics.txt"]
    assert '"name": "robot"' in found["daemon-devices.txt"]
    assert found["log-since-start.txt"].endswith("; hello")
    assert json.loads(found["audit.json"])["whole"] is True
    for file, text in found.items():
        for name, secret in PLANTED.items():
            assert secret not in file + text, f"{name} is in {file}"


async def test_pictures_are_in_it_only_when_asked_for(bench: Bench) -> None:
    run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
    await bench.application.events.flush()
    without = contents_of((await bench.client.post("/support-bundle")).content)
    found = contents_of((await bench.client.post("/support-bundle", json={"pictures": True})).content)
    assert set(found) - set(without) == {f"pictures/{run['id']}/view_{k:03d}.png" for k in range(run["station"])}
    assert found[f"pictures/{run['id']}/view_000.png"].startswith(b"\x89PNG")
    assert "No pictures" in without["README.txt"].decode()
    events = json.loads(without["events.json"])
    assert {"run", "calibration"} <= {event["kind"] for event in events}
    assert events[0]["number"] > events[-1]["number"]


async def test_what_the_daemon_cannot_answer_is_replaced_by_the_reason(bench: Bench) -> None:
    async def unreadable(_camera: str) -> Any:
        raise StorageError("the disk does not answer", "look at its cable")

    bench.application.store.current = unreadable  # type: ignore[method-assign]
    found = contents((await bench.client.post("/support-bundle")).content)
    assert found["daemon-ready-camera.txt"] == found["daemon-metrics.txt"]
    assert "the disk does not answer" in found["daemon-metrics.txt"]
    assert json.loads(found["daemon-health.txt"])["status"] == "alive"


@pytest.mark.slow
def test_another_program_at_the_daemons_port_does_not_fill_the_bundle(tmp_path: Path) -> None:
    bomb = gzip.compress(bytes(60_000_000))
    with http_device(Answer(bomb, headers={"Content-Encoding": "gzip"})) as device:
        device.answers["/metrics"] = Answer(b"x" * 6_000_000)
        config = tmp_path / "handeyed.toml"
        config.write_text(filled(SETTINGS).replace("{{folder}}", "store").replace("port = 1", f"port = {device.port}"))
        found = gather(config).files
    assert len(found["daemon-health.txt"]) <= 2 * len(bomb)
    assert found["daemon-metrics.txt"] == f"200\n{REMOVED}"


def test_settings_that_cannot_be_loaded_are_no_reason_to_stop(tmp_path: Path) -> None:
    config = tmp_path / "broken.toml"
    config.write_text('[robot]\naddress = "tcp://r:1"\npassword = "s3cr3t-of-the-camera"\n')
    found = gather(config).files
    assert "camera: missing: add it" in found["settings-problems.txt"]
    assert json.loads(found["settings.json"])["robot"] == {"address": "tcp://r:1", "password": REMOVED}
    (tmp_path / "conf.d").mkdir()
    (tmp_path / "conf.d" / "plant.toml").write_text('[robot]\naddress = "tcp://s:1"\npassword = "other-secret"\n')
    assert json.loads(gather(config).files["settings.json"])["robot"] == {"address": "tcp://s:1", "password": REMOVED}
    (tmp_path / "conf.d" / "plant.toml").unlink()
    config.write_bytes(b"\xff not TOML")
    assert "could not be gathered" in gather(config).files["settings.json"]
    assert "could not be gathered" in gather(tmp_path / "none.toml").files["settings.json"]


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


def test_a_long_log_is_redacted_in_pieces_of_whole_lines_and_a_key_over_many_lines_as_a_whole() -> None:
    filling = "a line of the log\n" * (PIECE // 20)
    key = "-----BEGIN PRIVATE KEY-----\n" + "MII/EvQ/IBADANBgkq\n" * 9000 + "-----END PRIVATE KEY-----\n"
    line = "Authorization: Bearer abcdef"
    shown = redact_lines(f"{filling}{key}{filling}{line}\n{filling}")
    assert shown == f"{filling}{REMOVED}\n{filling}{redact(line)}\n{filling}"


def test_secret_keys_are_known_by_name_wherever_they_stand() -> None:
    given = {"a": [{"api_key": "1", "private_key": "2", "keyboard": "3", "secret_file": "4", "monkey": "5"}]}
    assert redact_values(given) == {
        "a": [{"api_key": REMOVED, "private_key": REMOVED, "keyboard": "3", "secret_file": REMOVED, "monkey": "5"}]
    }

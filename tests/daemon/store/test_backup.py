"""A backup taken in the middle of work, put back on an empty machine, gives the same answers."""

import asyncio
import json
import os
import sqlite3
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from calibration.sentences.sentence import AS_WRITTEN
from daemon.access.roles import Role
from daemon.model.records import CauseDocument, RunRecord
from daemon.model.run_states import RunState
from daemon.runs.supervisor import abort_cause
from daemon.store.database import DATABASE_NAME, MIGRATIONS
from daemon.store.store import Store
from tests.daemon.access_keys import TEST, bearer
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.cli.running import handeyed
from tests.daemon.clouds import PLY, POSES, cloud
from tests.daemon.fakes import ply_of
from tests.daemon.store.backups import config_in, fill_store, names_of_scans


async def answers(bench: Bench, key: str) -> dict[str, Any]:
    """What a client sees of the past."""
    headers, found = bearer(key), {}
    links = ["/runs", "/calibrations", "/calibrations/current", "/scans", "/drift", "/audit"]
    for link in links:
        found[link] = (await bench.client.get(link, headers=headers)).raise_for_status().json()
    for calibration in found["/calibrations"]["calibrations"]:
        link = f"/calibrations/{calibration['id']}"
        found[link] = (await bench.client.get(link, headers=headers)).raise_for_status().json()
    for run in found["/runs"]["runs"]:
        links = [run["links"]["self"], *(link for name, link in run["links"].items() if name.startswith("frame"))]
        for link in links:
            found[link] = (await bench.client.get(link, headers=headers)).content
    for scan in found["/scans"]["scans"]:
        link = f"/scans/{scan['id']}/cloud"
        found[link] = (await bench.client.get(link, headers=headers)).content
    return found


@pytest.mark.slow
async def test_a_restored_store_gives_the_same_answers(tmp_path: Path) -> None:
    here, there, file = config_in(tmp_path / "here"), config_in(tmp_path / "there"), tmp_path / "all.tar"
    async with serving(
        settings_for(tmp_path / "here" / "store", calibration={"policy": "auto", "tolerance_mm": 20.0})
    ) as bench:
        key, _ = await bench.application.key_service.add("Ann", Role.ADMIN, TEST)
        headers = bearer(key)
        run = (await bench.client.post("/calibrate?wait=200", headers=headers)).json()
        assert run["result"]["applied"]
        verified = (await bench.client.post("/verify?wait=200", headers=headers)).json()
        assert verified["state"] == "finished"
        scan = (await bench.client.post("/scans", headers=headers)).json()
        link, sent = scan["links"]["views"], {**headers, **PLY}
        await bench.client.post(link, params={"pose": POSES[0]}, content=ply_of(cloud(100)), headers=sent)
        done = await asyncio.to_thread(handeyed, "backup", here, "--out", file)
        assert done.status == 0, done.err
        before = await answers(bench, key)
        assert len(before["/drift"]["points"]) == 1
    assert leftovers(tmp_path) == []
    put_back = await asyncio.to_thread(handeyed, "restore", file, there)
    assert put_back.status == 0, put_back.err
    assert "valid, also if it was revoked since: the admin key" in put_back.err
    assert file.stat().st_mode & 0o777 == 0o600
    async with serving(settings_for(tmp_path / "there" / "store")) as bench:
        assert await answers(bench, key) == before
    again = await asyncio.to_thread(handeyed, "restore", file, there)
    assert (again.status, "holds a store already" in again.err) == (1, True)
    assert (await asyncio.to_thread(handeyed, "audit", "verify", there)).status == 0


def leftovers(folder: Path) -> list[str]:
    return [file.name for file in folder.iterdir() if file.name.startswith(".")]


async def test_a_migration_leaves_a_copy_that_the_older_version_can_read(tmp_path: Path) -> None:
    old = sqlite3.connect(tmp_path / DATABASE_NAME)
    for number, migration in enumerate(MIGRATIONS[:3], start=1):
        old.executescript(f"BEGIN; {migration} PRAGMA user_version = {number}; COMMIT;")
    old.execute("INSERT INTO scans VALUES ('s', '2026-11-21T09:00:00.000Z', 'door', 0)")
    old.commit()
    old.close()
    store = Store(tmp_path)
    assert (await store.scan("s")).name == "door"
    await store.close()
    copy = sqlite3.connect(tmp_path / f"{DATABASE_NAME}.schema-3.backup")
    assert copy.execute("PRAGMA user_version").fetchone() == (3,)
    assert copy.execute("SELECT name FROM scans").fetchall() == [("door",)]
    copy.close()


async def test_the_cause_of_an_older_run_is_kept_as_it_was_written(tmp_path: Path) -> None:
    """Schema 17 stores what a cause is made of; of an older one only its text is known."""
    old = sqlite3.connect(tmp_path / DATABASE_NAME)
    for number, migration in enumerate(MIGRATIONS[:16], start=1):
        old.executescript(f"BEGIN; {migration} PRAGMA user_version = {number}; COMMIT;")
    row = "1, 3, ?, ?, ?, '2026-11-21T09:00:00.000Z', '2026-11-21T09:00:01.000Z', '{}', NULL, NULL, 'Ann', 'operator'"
    for run_id, state, *cause in (
        ("lost", "failed", "link-lost", 'lost at "2"', "look"),
        ("well", "finished", *3 * [None]),
    ):
        old.execute(f"INSERT INTO runs VALUES (?, 'calibration', ?, {row})", (run_id, state, *cause))
    old.commit()
    old.close()
    store = Store(tmp_path)
    lost, well = await store.run("lost"), await store.run("well")
    assert lost.cause == CauseDocument.because("link-lost", 'lost at "2"', "look")
    assert {made.id for made in lost.cause.details.values()} == {AS_WRITTEN}
    assert (well.cause, well.started_by, well.station) == (None, "Ann", 1)
    await store.save_run(replace(well, state=RunState.ABORTED, cause=abort_cause("Ann", well)))
    (listed, _) = await store.listings.runs(2)
    assert isinstance(listed, RunRecord)
    assert listed.cause == abort_cause("Ann", well)
    await store.close()
    told = sqlite3.connect(tmp_path / DATABASE_NAME)
    (data,) = told.execute("SELECT data FROM outbox WHERE topic = 'run.ended'").fetchone()
    told.close()
    ended = json.loads(data)
    assert (ended["code"], ended["cause"], ended["fix"]) == (
        "aborted", "aborted by Ann after picture 1 of 3", "start it again when the cell is ready"
    )  # fmt: skip
    assert ended["details"]["what"]["params"]["progress"] == {"id": "after-picture", "params": {"picture": 1, "of": 3}}


@pytest.mark.parametrize("fresh", [True, False])
async def test_without_a_migration_there_is_no_copy(tmp_path: Path, fresh: bool) -> None:
    for _ in range(1 if fresh else 2):
        await Store(tmp_path).close()
    assert not backups_in(tmp_path)


def backups_in(folder: Path) -> list[Path]:
    return list(folder.glob("*.backup"))


async def test_a_backup_streams_to_standard_output(tmp_path: Path) -> None:
    here, there = config_in(tmp_path / "here"), config_in(tmp_path / "there")
    await fill_store(tmp_path / "here" / "store")
    command = [sys.executable, "-m", "daemon.cli", "backup", str(here), "--out", "-"]
    done = await asyncio.to_thread(subprocess.run, command, capture_output=True, check=True)
    (tmp_path / "piped.tar").write_bytes(done.stdout)
    put_back = await asyncio.to_thread(handeyed, "restore", tmp_path / "piped.tar", there)
    assert put_back.status == 0, put_back.err
    assert await names_of_scans(tmp_path / "there" / "store") == ["door"]
    assert leftovers(tmp_path) == []


@pytest.mark.parametrize("kind", ["a link", "a pipe", "a folder"])
async def test_a_backup_replaces_nothing_but_a_file(tmp_path: Path, kind: str) -> None:
    """`--out /dev/stdout`, by root, once replaced the device by the backup."""
    here, target = config_in(tmp_path / "here"), tmp_path / "all.tar"
    await fill_store(tmp_path / "here" / "store")
    (tmp_path / "file").write_bytes(b"before")
    {"a link": lambda: target.symlink_to("file"), "a pipe": lambda: os.mkfifo(target), "a folder": target.mkdir}[kind]()
    before = target.lstat()
    refused = await asyncio.to_thread(handeyed, "backup", here, "--out", target)
    assert refused.status != 0
    assert "all.tar" in refused.err
    assert (target.lstat().st_ino, target.lstat().st_mode) == (before.st_ino, before.st_mode)
    assert (tmp_path / "file").read_bytes() == b"before"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
async def test_what_a_stream_goes_into_is_full_and_not_the_store(tmp_path: Path) -> None:
    here = config_in(tmp_path / "here")
    await fill_store(tmp_path / "here" / "store")
    command = [sys.executable, "-m", "daemon.cli", "backup", str(here), "--out", "-"]
    full = os.open("/dev/full", os.O_WRONLY)
    done = await asyncio.to_thread(subprocess.run, command, stdout=full, stderr=subprocess.PIPE, check=False)
    os.close(full)
    told = done.stderr.decode()
    assert done.returncode != 0
    assert "standard output" in told and str(tmp_path) not in told and "Traceback" not in told, told
    assert leftovers(tmp_path) == []

"""A store that is damaged, cut off, rewritten, moved or replaced is noticed; nothing is written to it."""

import asyncio
import os
import re
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from daemon.errors import StorageInconsistent, StorageInUse
from daemon.model.records import ScanRecord
from daemon.store.anchor_file import ANCHOR_NAME, read_anchor
from daemon.store.backup import back_up
from daemon.store.consistency import find_fault
from daemon.store.database import DATABASE_NAME
from daemon.store.monitor import StoreMonitor
from daemon.store.opening import LOCK_NAME, open_offline
from daemon.store.store import Store
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.cli.running import handeyed
from tests.daemon.store.backups import AT, config_in, fill_store, names_of_scans


def cut_off(folder: Path) -> None:
    """The last rows are gone, as after a disk that lost what it had confirmed: an earlier state of the file is back."""
    with sqlite3.connect(folder / DATABASE_NAME) as db:
        db.execute("DROP TRIGGER audit_is_not_shortened")
        db.execute("DELETE FROM audit WHERE sequence > 2")
        db.execute("DELETE FROM scans WHERE rowid > 2")
        db.execute("UPDATE sqlite_sequence SET seq = 2 WHERE name = 'audit'")
    db.close()


def rewrite(folder: Path) -> None:
    with sqlite3.connect(folder / DATABASE_NAME) as db:
        db.execute("DROP TRIGGER audit_is_not_changed")
        db.execute("UPDATE audit SET actor = 'Bob' WHERE sequence = 2")
    db.close()


def damage(folder: Path) -> None:
    """A page in the middle is overwritten."""
    content = bytearray((folder / DATABASE_NAME).read_bytes())
    with sqlite3.connect(folder / DATABASE_NAME) as db:
        (page,) = db.execute("SELECT rootpage FROM sqlite_master WHERE name = 'audit'").fetchone()
        (size,) = db.execute("PRAGMA page_size").fetchone()
    db.close()
    content[(page - 1) * size : page * size] = bytes(range(256)) * (size // 256)
    (folder / DATABASE_NAME).write_bytes(content)


AT_START: dict[str, tuple[Callable[[Path], object], str]] = {
    "cut off": (cut_off, "row 4 was written"),
    "rewritten": (rewrite, "row 2"),
    "damaged": (damage, "is damaged"),
    "another anchor": (
        lambda f: (f / ANCHOR_NAME).write_text('{"sequence": 4, "hash": "0"}'),
        "differs from the anchor",
    ),
    "no anchor to be read": (lambda f: (f / ANCHOR_NAME).write_text("{"), "cannot be read|differs"),
}
SCANS = ("a", "b", "c", "d")


def stored(folder: Path) -> dict[str, bytes]:
    """The files of a store but those that SQLite makes for readers."""
    return {name: (folder / name).read_bytes() for name in (DATABASE_NAME, ANCHOR_NAME)}


@pytest.mark.parametrize("what", AT_START)
async def test_the_start_notices_refuses_runs_and_writes_nothing(tmp_path: Path, what: str) -> None:
    folder = tmp_path / "store"
    await fill_store(folder, SCANS)
    spoil, says = AT_START[what]
    spoil(folder)
    before = stored(folder)
    async with serving(settings_for(folder)) as bench:
        ready = (await bench.client.get("/ready")).json()
        assert re.search("audit log|damaged", ready["calibrate"]["reasons"][0])
        assert any("restore a backup" in warning for warning in ready["warnings"])
        for path, body in (("/calibrate", {"count": 3}), ("/scans", {}), ("/verify", {})):
            refused = await bench.client.post(path, json=body)
            assert (refused.status_code, refused.json()["code"]) == (503, "storage-inconsistent"), refused.text
        assert bench.robot.goals == []
        assert "handeyed_store_sound 0" in (await bench.client.get("/metrics")).text
        assert (await bench.client.get("/health")).status_code == 200
    assert stored(folder) == before
    assert (fault := find_fault(folder / DATABASE_NAME)) is not None
    assert re.search(says, fault.what), fault


async def test_a_sound_store_has_no_fault_and_the_anchor_follows_it(tmp_path: Path) -> None:
    await fill_store(tmp_path, SCANS)
    store = Store(tmp_path)
    assert store.fault is None
    assert await store.check() is None
    assert await store.check(whole=True) is None
    await store.save_scan(ScanRecord("x", AT, "e"))
    await store.audit.anchor()
    await store.close()
    anchor = read_anchor(tmp_path)
    assert anchor is not None
    assert anchor.sequence == 5
    assert await names_of_scans(tmp_path) == [*SCANS, "e"]


async def test_an_anchor_never_goes_back(tmp_path: Path) -> None:
    """Whoever puts another anchor or an older log there while the daemon runs is noticed, and the anchor stays."""
    await fill_store(tmp_path, SCANS)
    store = Store(tmp_path)
    (tmp_path / ANCHOR_NAME).write_text('{"sequence": 40, "hash": "00"}')
    await store.save_scan(ScanRecord("x", AT, "e"))
    with pytest.raises(StorageInconsistent, match="row 40 was written"):
        await store.audit.anchor()
    assert (await store.check()) is not None
    with pytest.raises(StorageInconsistent):
        await store.save_scan(ScanRecord("y", AT, "f"))
    await store.close()
    assert (tmp_path / ANCHOR_NAME).read_text() == '{"sequence": 40, "hash": "00"}'


def move_store(folder: Path) -> None:
    folder.rename(folder.with_name("moved"))


def copy_back(folder: Path) -> None:
    """A copy in the place of the folder."""
    move_store(folder)
    shutil.copytree(folder.with_name("moved"), folder)


def replace_database(folder: Path) -> None:
    shutil.copy(folder / DATABASE_NAME, folder / "copy")
    (folder / "copy").rename(folder / DATABASE_NAME)


WHILE_RUNNING: dict[str, tuple[Callable[[Path], object], str]] = {
    "moved": (move_store, "was moved or removed"),
    "copied": (copy_back, "was replaced"),
    "database replaced": (replace_database, "was replaced"),
    "database removed": (lambda f: (f / DATABASE_NAME).unlink(), "was moved or removed"),
    "write-ahead log removed": (lambda f: (f / f"{DATABASE_NAME}-wal").unlink(), "was moved or removed"),
    "lock removed": (lambda f: (f / LOCK_NAME).unlink(), "was moved or removed"),
}


@pytest.mark.parametrize("what", WHILE_RUNNING)
async def test_nothing_is_acknowledged_into_a_store_that_is_no_longer_there(tmp_path: Path, what: str) -> None:
    folder = tmp_path / "store"
    change, says = WHILE_RUNNING[what]
    async with serving(settings_for(folder)) as bench:
        assert (await bench.client.post("/scans")).status_code == 201
        change(folder)
        for path in ("/scans", "/calibrate"):
            refused = await bench.client.post(path)
            assert (refused.status_code, refused.json()["code"]) == (503, "storage-inconsistent"), refused.text
            assert says in refused.json()["detail"]
        ready = (await bench.client.get("/ready")).json()
        assert says in ready["calibrate"]["reasons"][0]
        for _ in range(2):
            await monitor_of(bench).check()
        assert (await kinds_published(bench)).count("store") == 1


async def kinds_published(bench: Bench) -> list[str]:
    """Of every event since the start."""
    await bench.application.events.flush()
    kinds: list[str] = []
    async for event in bench.application.events.listen(0, 0.0):
        if event is None:
            break
        kinds.append(event.kind)
    return kinds


def monitor_of(bench: Bench) -> StoreMonitor:
    (monitor,) = (each for each in bench.application.services if isinstance(each, StoreMonitor))
    return monitor


async def test_a_run_in_a_store_that_is_moved_away_ends_and_the_arm_stands(tmp_path: Path) -> None:
    folder = tmp_path / "store"
    async with serving(settings_for(folder)) as bench:

        async def move(number: int) -> None:
            if number == 1:
                move_store(folder)

        bench.robot.before_move = move
        run = (await bench.client.post("/calibrate?wait=200", json={"count": 3})).json()
        assert (run["state"], run["cause"]["code"]) == ("failed", "storage-inconsistent")


async def test_a_store_that_is_moved_back_goes_on(tmp_path: Path) -> None:
    folder = tmp_path / "store"
    async with serving(settings_for(folder)) as bench:
        move_store(folder)
        assert (await bench.client.post("/scans")).status_code == 503
        folder.with_name("moved").rename(folder)
        assert (await bench.client.post("/scans")).status_code == 201


async def test_pages_that_rot_while_the_daemon_runs_are_found(tmp_path: Path) -> None:
    await fill_store(tmp_path, SCANS)
    store = Store(tmp_path)
    await asyncio.to_thread(damage, tmp_path)
    fault = await store.check(whole=True)
    assert fault is not None
    assert "is damaged" in fault.what
    assert store.fault == fault
    await store.close()


async def test_removing_the_lock_file_lets_no_second_daemon_in(tmp_path: Path) -> None:
    first = Store(tmp_path)
    (tmp_path / LOCK_NAME).unlink()
    with pytest.raises(StorageInUse):
        Store(tmp_path)
    await first.close()


@pytest.mark.parametrize("left", [ANCHOR_NAME, "runs", "scans"])
def test_a_store_without_its_database_is_not_begun_anew(tmp_path: Path, left: str) -> None:
    (tmp_path / left).mkdir()
    with pytest.raises(StorageInconsistent, match=r"there is no handeyed\.sqlite"):
        Store(tmp_path)
    assert not (tmp_path / DATABASE_NAME).exists()


async def test_an_empty_database_beside_an_anchor_is_not_begun_anew(tmp_path: Path) -> None:
    await fill_store(tmp_path)
    (tmp_path / DATABASE_NAME).write_bytes(b"")
    with pytest.raises(StorageInconsistent, match="is empty"):
        Store(tmp_path)
    assert (tmp_path / DATABASE_NAME).stat().st_size == 0


async def test_a_backup_of_a_store_with_a_fault_is_refused(tmp_path: Path) -> None:
    await fill_store(tmp_path / "store", SCANS)
    cut_off(tmp_path / "store")
    with open_offline(tmp_path / "store") as database, pytest.raises(StorageInconsistent):
        back_up(tmp_path / "store", database, tmp_path / "all.tar", AT)
    assert os.listdir(tmp_path) == ["store"]  # noqa: PTH208


def test_an_operator_accepts_a_log_that_was_cut_off(tmp_path: Path) -> None:
    config, folder = config_in(tmp_path), tmp_path / "store"
    asyncio.run(fill_store(folder, SCANS))
    unmet = (folder / ANCHOR_NAME).read_bytes()
    cut_off(folder)
    refused = handeyed("keys", "add", config, "Ann")
    assert (refused.status, "handeyed audit acknowledge" in refused.err) == (1, True)
    done = handeyed("audit", "acknowledge", config)
    assert (done.status, "row 4 was written" in done.out) == (0, True), done.err
    assert (folder / f"{ANCHOR_NAME}.unmet").read_bytes() == unmet
    assert find_fault(folder / DATABASE_NAME) is None
    assert handeyed("keys", "add", config, "Ann").status == 0
    assert asyncio.run(names_of_scans(folder)) == ["a", "b"]
    again = handeyed("audit", "acknowledge", config)
    assert (again.status, "nothing to accept" in again.out) == (0, True)


def test_what_was_accepted_stays_in_the_log_and_what_comes_later_is_noticed(tmp_path: Path) -> None:
    config, folder = config_in(tmp_path), tmp_path / "store"
    asyncio.run(fill_store(folder, SCANS))
    rewrite(folder)
    assert handeyed("audit", "acknowledge", config).status == 0
    assert handeyed("audit", "verify", config).status == 1
    assert find_fault(folder / DATABASE_NAME) is None
    assert asyncio.run(names_of_scans(folder)) == list(SCANS)
    with sqlite3.connect(folder / DATABASE_NAME) as db:
        db.execute("UPDATE audit SET actor = 'Eve' WHERE action = 'acknowledge'")
    db.close()
    fault = find_fault(folder / DATABASE_NAME)
    assert fault is not None
    assert "row 5" in fault.what


def test_damage_is_not_accepted(tmp_path: Path) -> None:
    config = config_in(tmp_path)
    asyncio.run(fill_store(tmp_path / "store", SCANS))
    damage(tmp_path / "store")
    refused = handeyed("audit", "acknowledge", config)
    assert (refused.status, "restore a backup" in refused.err) == (1, True)


async def test_a_log_that_grows_meanwhile_is_whole(tmp_path: Path) -> None:
    """Other processes check while the daemon appends and anchors."""
    store = Store(tmp_path)
    await store.save_scan(ScanRecord("first", AT, "x"))
    checks = asyncio.gather(*(store.check(whole=True) for _ in range(20)))
    for number in range(60):
        await store.save_scan(ScanRecord(f"s{number}", AT, "x"))
        await store.audit.anchor()
    assert set(await checks) == {None}
    await store.close()

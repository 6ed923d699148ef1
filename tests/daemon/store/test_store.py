"""What survives: whole or not at all, and never lost by what fails later."""

import errno
import json
import sqlite3
from collections.abc import Iterable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from daemon.errors import NoCalibration, NotFound, StorageError, StorageFull, StorageTooNew
from daemon.model.records import AppliedCalibration, CalibrationRecord, CauseDocument, FlangePose, ScanRecord
from daemon.model.run_states import RunState
from daemon.runtime.durable_files import write_durably
from daemon.store.database import DATABASE_NAME, SCHEMA_VERSION
from daemon.store.store import Store
from tests.daemon.calibrations import a_calibration
from tests.daemon.records import AT, a_run, names_in

VERSION_1 = Path(__file__).parents[2] / "calibration" / "documents" / "calibration_version_1.json"


def record(calibration_id: str) -> CalibrationRecord:
    return CalibrationRecord(calibration_id, "r", AT, True, a_calibration(calibration_id))


async def test_what_was_stored_is_there_after_a_restart(tmp_path: Path) -> None:
    store = Store(tmp_path)
    failed = replace(
        a_run("r1", RunState.FAILED), cause=CauseDocument.because("link-lost", "lost", "look"), result={"x": 1.5}
    )
    await store.save_run(failed)
    await store.save_calibration(record("c1"))
    await store.apply(AppliedCalibration("c1", AT, "somebody"))
    await store.save_scan(ScanRecord("s1", AT, "door"))
    await store.write_file(store.run_folder("r1") / "view_000.png", [b"pic", b"ture"])
    await store.close()

    store = Store(tmp_path)
    assert await store.run("r1") == failed
    assert await store.calibration("c1") == record("c1")
    assert await store.current() == (AppliedCalibration("c1", AT, "somebody"), record("c1"))
    assert await store.scan("s1") == ScanRecord("s1", AT, "door")
    assert await store.read_file(store.run_folder("r1") / "view_000.png") == b"picture"
    await store.close()


async def test_pages_go_back_in_time_without_gap_or_repetition(tmp_path: Path) -> None:
    store = Store(tmp_path)
    for k in range(7):
        await store.save_run(replace(a_run(f"r{k}"), created_at=f"2026-11-21T09:00:0{k // 2}.000Z"))
    pages, before = [], None
    while page := await store.runs(3, before):
        pages.append([run.id for run in page])
        before = page[-1].id
    assert pages == [["r6", "r5", "r4"], ["r3", "r2", "r1"], ["r0"]]
    await store.close()


async def test_the_history_of_what_was_applied_is_kept(tmp_path: Path) -> None:
    store = Store(tmp_path)
    with pytest.raises(NoCalibration):
        await store.current()
    for name in ("c1", "c2"):
        await store.save_calibration(record(name))
    for name in ("c1", "c2", "c1", "c2"):
        await store.apply(AppliedCalibration(name, AT, "x"))
    assert [row.calibration_id for row in await store.history(10)] == ["c2", "c1", "c2", "c1"]
    assert (await store.current())[1].id == "c2"
    with pytest.raises(StorageError):
        await store.apply(AppliedCalibration("never stored", AT, "x"))
    assert (await store.current())[1].id == "c2"
    await store.close()


async def test_what_is_not_there_is_not_found(tmp_path: Path) -> None:
    store = Store(tmp_path)
    for asked in (store.run("x"), store.calibration("x"), store.scan("x"), store.read_file(tmp_path / "runs" / "x")):
        with pytest.raises(NotFound):
            await asked
    await store.close()


def test_a_newer_database_is_refused_in_words(tmp_path: Path) -> None:
    connection = sqlite3.connect(tmp_path / DATABASE_NAME)
    connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION + 1}")
    connection.close()
    with pytest.raises(StorageTooNew, match="newer handeyed"):
        Store(tmp_path)


def test_a_folder_that_cannot_be_written_is_reported(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("a file where a folder should be")
    with pytest.raises(StorageError, match="state"):
        Store(tmp_path / "state" / "deeper")


def test_a_file_that_is_no_database_is_reported(tmp_path: Path) -> None:
    (tmp_path / DATABASE_NAME).write_bytes(b"this is no database at all, though it is long enough" * 10)
    with pytest.raises(StorageError, match="not a database"):
        Store(tmp_path)


async def test_wal_and_full_sync(tmp_path: Path) -> None:
    store = Store(tmp_path)
    database = store._database
    assert await database.read(lambda db: db.execute("PRAGMA journal_mode").fetchone()) == ("wal",)
    assert await database.read(lambda db: db.execute("PRAGMA synchronous").fetchone()) == (2,)
    await store.close()


async def test_a_full_database_refuses_and_keeps_what_it_has(tmp_path: Path) -> None:
    store = Store(tmp_path)
    await store.save_run(a_run("first"))
    pages = await store._database.read(lambda db: db.execute("PRAGMA page_count").fetchone()[0])
    await store._database.read(lambda db: db.execute(f"PRAGMA max_page_count = {pages}").fetchone())
    with pytest.raises(StorageFull, match="full"):
        for k in range(1000):
            await store.save_run(replace(a_run(f"r{k}"), request={"padding": "x" * 4000}))
    assert (await store.run("first")).id == "first"
    await store.close()


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EIO])
async def test_a_disk_that_fails_leaves_the_old_file(tmp_path: Path, code: int) -> None:
    def failing(path: Path, blocks: Iterable[bytes]) -> None:
        def torn() -> Iterable[bytes]:
            yield b"half of "
            raise OSError(code, "the disk says no")

        write_durably(path, torn())

    store = Store(tmp_path, write_file=failing)
    file = tmp_path / "session.json"
    file.write_bytes(b"old")
    with pytest.raises(StorageError) as caught:
        await store.write_file(file, [b"new"])
    assert isinstance(caught.value, StorageFull) == (code != errno.EIO)
    assert caught.value.fix
    assert file.read_bytes() == b"old"
    assert names_in(tmp_path) == ["session.json"]
    await store.close()


async def test_a_view_whose_row_cannot_be_written_leaves_no_number_behind(tmp_path: Path) -> None:
    store = Store(tmp_path)
    upload = tmp_path / "upload"
    upload.write_bytes(b"cloud")
    with pytest.raises(StorageError):
        await store.add_scan_view("no such scan", upload, "mm", FlangePose(PoseDocument.of(np.eye(4))), AT, points=1)
    assert await store.scan_views("no such scan") == []
    await store.close()


async def test_a_calibration_stored_as_version_1_is_read(tmp_path: Path) -> None:
    store = Store(tmp_path)
    await store.save_calibration(record("c1"))
    await store.apply(AppliedCalibration("c1", AT, "somebody"))
    await store.close()
    written = json.loads(VERSION_1.read_bytes())
    with closing(sqlite3.connect(tmp_path / DATABASE_NAME)) as old:
        old.execute("UPDATE calibrations SET document = ?", (json.dumps(written),))
        old.commit()

    store = Store(tmp_path)
    _, found = await store.current()
    assert found.document.schema_version == 2
    assert found.document.flange_T_camera is not None
    assert list(found.document.flange_T_camera.translation_mm) == written["flange_T_camera"]["translation_mm"]
    assert (await store.listings.calibrations(1, None))[0].accuracy.expanded_mm is None, "version 1 has no points"
    await store.close()

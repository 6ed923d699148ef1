"""The audit log tells who did what, and whether somebody has been at it."""

import sqlite3
from pathlib import Path

import pytest

from daemon.access.audit_chain import AuditAnchor, AuditRow, find_flaws, hash_row
from daemon.access.roles import Role
from daemon.model.records import CalibrationRecord
from daemon.store.actor import AuditContext
from daemon.store.audit_log import check_audit_log
from daemon.store.database import DATABASE_NAME
from daemon.store.store import Store
from tests.daemon.access_keys import TEST, bearer, with_keys
from tests.daemon.calibrations import a_calibration
from tests.daemon.cell_under_test import Bench


async def a_log(folder: Path, rows: int = 6) -> list[AuditRow]:
    store = Store(folder)
    for k in range(rows):
        await store.audit.append(AuditContext("Ann", "admin"), "2026-11-21T09:00:00.000Z", "apply", f"c{k}", n=k)
    await store.audit.anchor()
    written = await store.audit.rows(100, None)
    await store.close()
    return written[::-1]


def tamper(folder: Path, *statements: str) -> None:
    """As somebody with the file and no scruples."""
    with sqlite3.connect(folder / DATABASE_NAME) as db:
        for trigger in ("audit_is_not_changed", "audit_is_not_shortened"):
            db.execute(f"DROP TRIGGER {trigger}")
        for statement in statements:
            db.execute(statement)
    db.close()


async def test_a_log_nobody_touched_is_whole(tmp_path: Path) -> None:
    await a_log(tmp_path)
    assert check_audit_log(tmp_path / DATABASE_NAME, []) == (6, [])


COLUMNS = ["at", "actor", "role", "action", "subject", "detail", "hash"]
TAMPERED = [
    *[f"UPDATE audit SET {column} = {column} || ' ' WHERE sequence = 3" for column in COLUMNS],
    "UPDATE audit SET sequence = 99 WHERE sequence = 3",
    "UPDATE audit SET actor = '' WHERE sequence = 6",
    "DELETE FROM audit WHERE sequence = 1",
    "DELETE FROM audit WHERE sequence = 3",
    "DELETE FROM audit WHERE sequence = 6",
    "DELETE FROM audit WHERE sequence > 2",
    "DELETE FROM audit",
    "UPDATE audit SET sequence = CASE sequence WHEN 2 THEN -3 WHEN 3 THEN -2 ELSE sequence END",
]


@pytest.mark.parametrize("statement", TAMPERED)
async def test_whatever_is_done_to_a_row_is_found(tmp_path: Path, statement: str) -> None:
    await a_log(tmp_path)
    tamper(tmp_path, statement, "UPDATE audit SET sequence = -sequence WHERE sequence < 0")
    rows, found = check_audit_log(tmp_path / DATABASE_NAME, [])
    assert found, (rows, statement)


async def test_a_log_rewritten_with_right_hashes_is_found_by_its_anchor(tmp_path: Path) -> None:
    """Somebody clever recomputes the chain, and the counter of rows."""
    rows = await a_log(tmp_path)
    before, statements = "0" * 64, ["DELETE FROM audit"]
    for row in rows[:4]:
        changed = AuditRow(row.sequence, row.at, "Eve", row.role, row.action, row.subject, row.detail)
        before = hash_row(changed, before)
        values = (*list(vars(changed).values())[:-1], before)
        statements.append(f"INSERT INTO audit VALUES ({', '.join(repr(value) for value in values)})")
    tamper(tmp_path, *statements, "UPDATE sqlite_sequence SET seq = 4 WHERE name = 'audit'")
    _, found = check_audit_log(tmp_path / DATABASE_NAME, [])
    assert found == ["the log ends with row 4, but row 6 was written: its end was cut off"]
    (tmp_path / "audit-anchor.json").unlink()
    assert check_audit_log(tmp_path / DATABASE_NAME, [])[1] == []  # without any anchor such a lie is consistent …
    written_down = AuditAnchor(rows[1].sequence, rows[1].hash)
    assert check_audit_log(tmp_path / DATABASE_NAME, [written_down])[1]  # … so write one down elsewhere


async def test_a_garbled_anchor_is_reported(tmp_path: Path) -> None:
    await a_log(tmp_path)
    (tmp_path / "audit-anchor.json").write_text("{")
    assert check_audit_log(tmp_path / DATABASE_NAME, [])[1]


def test_rows_that_look_alike_when_joined_have_hashes_of_their_own() -> None:
    one = AuditRow(1, "t", "ab", "c", "a", "s", "{}")
    other = AuditRow(1, "t", "a", "bc", "a", "s", "{}")
    assert hash_row(one, "0") != hash_row(other, "0")
    assert find_flaws([]) == []


async def test_the_database_itself_refuses_to_forget(tmp_path: Path) -> None:
    await a_log(tmp_path)
    db = sqlite3.connect(tmp_path / DATABASE_NAME)
    for statement in ("UPDATE audit SET actor = 'Eve'", "DELETE FROM audit"):
        with pytest.raises(sqlite3.IntegrityError, match="append-only"):
            db.execute(statement)
    db.close()


async def test_what_was_done_is_reported_with_who_did_it(tmp_path: Path) -> None:
    async with with_keys(tmp_path) as (bench, keys):
        document = a_calibration("good")
        record = CalibrationRecord("good", None, document.created_at, True, document)
        await bench.application.store.save_calibration(record)
        mes = bearer(keys["operator"])
        run = (await bench.client.post("/calibrate?wait=200", headers=mes)).json()
        await bench.client.post("/calibrations/good/apply", headers=mes)
        await bench.client.post("/scans", headers=mes, json={"name": "door"})
        await bench.client.post("/calibrate", headers=mes, json={"count": 1})  # refused: nothing was done
        await bench.client.get("/runs", headers=mes)
        rows = (await bench.client.get("/audit?limit=3", headers=bearer(keys["admin"]))).json()["rows"]
        assert [(row["actor"], row["role"], row["action"]) for row in rows] == [
            ("operator", "operator", "scan"), ("operator", "operator", "apply"), ("operator", "operator", "run")
        ]  # fmt: skip
        assert rows[2]["subject"] == run["id"]
        assert rows[1]["detail"] == {"by": "operator", "calibration": "good"}
    assert check_audit_log(tmp_path / DATABASE_NAME, [])[1] == []


async def test_the_log_is_read_in_pages(bench: Bench) -> None:
    for k in range(5):
        await bench.application.key_service.add(f"k{k}", Role.ADMIN, TEST)
    key, _ = await bench.application.key_service.add("Ann", Role.ADMIN, TEST)
    pages, link = [], "/audit?limit=4"
    while link:
        page = (await bench.client.get(link, headers=bearer(key))).json()
        pages.append([row["sequence"] for row in page["rows"]])
        link = page["next"]
    assert pages == [[6, 5, 4, 3], [2, 1]]

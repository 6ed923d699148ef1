"""A row of the store that is not what was stored: refused by its id and told in its list; all others are read."""

import sqlite3
from pathlib import Path
from typing import Any

import pytest

from daemon.model.records import AppliedCalibration, CalibrationRecord
from daemon.store.database import DATABASE_NAME
from daemon.store.documents import DocumentRecord
from tests.daemon.calibrations import a_calibration, an_arm, apply_calibration
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.clouds import OCTETS, POSE, cloud
from tests.daemon.damage import A_LIST, DOCUMENTS, NO_TEXT, NOT_JSON, damage
from tests.daemon.records import an_acceptance

COLUMNS: list[tuple[str, str, list[Any]]] = [
    ("acceptances", "acceptances.document", DOCUMENTS),
    ("calibrations", "calibrations.document", DOCUMENTS),
    ("runs", "runs.state", ["gone", NO_TEXT]),
    ("runs", "runs.request", [NOT_JSON, A_LIST, NO_TEXT]),
    ("runs", "runs.result", [NOT_JSON, A_LIST, NO_TEXT]),
    ("runs", "runs.planning", [NOT_JSON, A_LIST, NO_TEXT]),
    ("scans", "scan_views.base_T_flange", DOCUMENTS),
    ("scans", "scan_views.joints_deg", [NOT_JSON, NO_TEXT]),
    ("scans", "scan_views.external_axes", [NOT_JSON, NO_TEXT]),
]
CASES = [(noun, column, value) for noun, column, values in COLUMNS for value in values]


async def two_of_each(bench: Bench) -> dict[str, tuple[str, str]]:
    """Ids of two rows of each list."""
    store, ids = bench.application.store, {}
    await apply_calibration(bench)
    at = a_calibration("x").created_at
    for name in ("cal-2", "cal-3"):
        await store.save_calibration(CalibrationRecord(name, None, at, True, a_calibration(name)))
    ids["calibrations"] = ("cal-2", "cal-3")
    ids["acceptances"] = ("acceptances-0", "acceptances-1")
    for name in ids["acceptances"]:
        await store.acceptances.save(DocumentRecord(name, "scan", at, "Ann", an_acceptance("scan").model_dump_json()))
    await bench.verify()
    await bench.verify()
    newer, older = (await bench.client.get("/runs")).json()["runs"]
    ids["runs"] = (older["id"], newer["id"])  # the newest one is known without the store
    scans = [(await bench.client.post("/scans", json={"name": "door"})).json() for _ in range(2)]
    for scan in scans:
        content = cloud(10).astype("<f4").tobytes()
        sent = await bench.client.post(scan["links"]["views"], params={"pose": POSE}, content=content, headers=OCTETS)
        assert sent.status_code == 201, sent.text
    ids["scans"] = (scans[0]["id"], scans[1]["id"])
    return ids


@pytest.mark.slow
async def test_a_damaged_row_is_told_and_the_others_are_read(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        ids = await two_of_each(bench)
        for noun, column, value in CASES:
            bad, good = ids[noun]
            before, place = damage(tmp_path, column, bad, value), (column, value)
            listed = await bench.client.get(f"/{noun}")
            one, other = await bench.client.get(f"/{noun}/{bad}"), await bench.client.get(f"/{noun}/{good}")
            others = [await bench.client.get(path) for path in ("/drift", "/calibrate", "/ready", "/metrics")]
            damage(tmp_path, column, bad, before)
            assert listed.status_code == 200, (*place, listed.text)
            assert listed.json()["damaged"] == [bad], place
            assert good in [row["id"] for row in listed.json()[noun]], place
            assert (one.status_code, one.json()["code"]) == (503, "storage-inconsistent"), (*place, one.text)
            assert bad in one.json()["detail"], place
            assert other.status_code == 200, (*place, other.text)
            assert [answer.status_code for answer in others] == [200] * 4, (*place, [a.text for a in others])


async def test_a_damaged_arm_is_refused(bench: Bench, tmp_path: Path) -> None:
    store = bench.application.store
    record = CalibrationRecord("cal-4", None, a_calibration("x").created_at, True, a_calibration("cal-4"))
    await store.save_calibration(record, an_arm())
    await store.apply(AppliedCalibration("cal-4", record.created_at, "Ann"))
    with sqlite3.connect(tmp_path / DATABASE_NAME) as database:
        database.execute("UPDATE arms SET document = '{}'")
    refused = await bench.client.get("/calibrations/cal-4/arm")
    assert refused.json()["code"] == "storage-inconsistent", refused.text


@pytest.mark.parametrize("state", ["gone", "moving"])
async def test_the_daemon_starts_on_a_store_with_a_damaged_run(tmp_path: Path, state: str) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        await apply_calibration(bench)
        await bench.verify()
        (run,) = (await bench.client.get("/runs")).json()["runs"]
    damage(tmp_path, "runs.state", run["id"], state)
    damage(tmp_path, "runs.request", run["id"], NOT_JSON)
    async with serving(settings_for(tmp_path)) as bench:
        assert (await bench.client.get("/runs")).json()["damaged"] == [run["id"]]
        await bench.verify()

"""Long lists: the same documents as one by one, read beside the store's thread and built beside the event loop."""

import asyncio
import json
import struct
import threading
from dataclasses import replace
from typing import Any

import pytest

from daemon.api import dependencies
from daemon.model.records import CalibrationRecord, CauseDocument, Planning, RunRecord
from daemon.model.run_states import RunState
from tests.daemon.calibrations import a_calibration
from tests.daemon.cell_under_test import Bench
from tests.daemon.records import a_run

VERIFICATION = {"points": [{"id": k, "base_mm": [[k / 7, 0.1, 1e-7]] * 3} for k in range(88)]}

RUNS = [
    replace(
        a_run("failed", RunState.FAILED),
        cause=CauseDocument.because("c", 'what "x"', "fix ä"),
        planning=Planning(1.5, None, 3),
    ),
    replace(a_run("calibration", RunState.FINISHED), result={"calibration_id": "c1", "accepted": True}),
    replace(a_run("manual"), request={"manual": True}),
    replace(a_run("verify", RunState.FINISHED), kind="verify",
            result={"calibration_id": "c1", "verification": VERIFICATION}),
    replace(a_run("scan", RunState.FINISHED), kind="scan", result={"scan_id": "s1"}),
]  # fmt: skip


async def save(bench: Bench, *runs: RunRecord) -> None:
    for run in runs:
        await bench.application.store.save_run(run)


async def test_a_listed_run_is_the_run(bench: Bench) -> None:
    await save(bench, *RUNS)
    listed = {run["id"]: run for run in (await bench.client.get("/runs")).json()["runs"]}
    assert len(listed) == len(RUNS)
    for run in RUNS:
        if run.id != "calibration":  # a single one is answered with its calibration, which is not stored here
            assert listed[run.id] == (await bench.client.get(f"/runs/{run.id}")).json()
    assert listed["calibration"]["links"]["calibration"] == "/calibrations/c1"
    assert "finish" in listed["manual"]["links"]


async def test_a_run_that_could_not_be_stored_is_listed_as_it_is(bench: Bench) -> None:
    await save(bench, a_run("r"))
    bench.application.supervisor._unsaved["r"] = replace(a_run("r"), state=RunState.FAILED, result={"x": [1]})
    (listed,) = (await bench.client.get("/runs")).json()["runs"]
    assert (listed["state"], listed["result"]) == ("failed", {"x": [1]})


async def test_a_listed_scan_is_the_scan(bench: Bench) -> None:
    location = (await bench.client.post("/scans", json={"name": 'door "4711" ä'})).headers["location"]
    octets = {"content-type": "application/octet-stream"}
    for k in range(3):
        pose = {"pose": f"900.5,0,{k},1,0,0,0"}
        sent = await bench.client.post(
            f"{location}/views", params=pose, headers=octets, content=struct.pack("<3f", 0, 0, 500)
        )
        assert sent.status_code == 201, sent.text
    assert (await bench.client.get("/scans")).json()["scans"] == [(await bench.client.get(location)).json()]


async def test_a_listed_calibration_has_its_uncertainty(bench: Bench) -> None:
    for name, solved in (("solved", True), ("not", False)):
        document = a_calibration(name, accepted=solved, solved=solved)
        record = CalibrationRecord(name, None, document.created_at, solved, document)
        await bench.application.store.save_calibration(record)
        listed = (await bench.client.get("/calibrations?limit=1")).json()["calibrations"][0]
        assert (listed["id"], listed["accepted"], listed["current"]) == (name, solved, False)
        assert listed["expanded_mm"] == document.accuracy.expanded_mm


@pytest.mark.parametrize("path", ["/runs", "/scans"])
async def test_a_list_does_not_wait_for_the_stores_thread(bench: Bench, path: str) -> None:
    held, busy = threading.Event(), bench.application.store._database
    blocking = asyncio.create_task(busy.read(lambda db: held.wait(30)))
    try:
        answer = await bench.client.get(path, params={"limit": 500})
    finally:
        held.set()
        await blocking
    assert answer.status_code == 200
    assert json.loads(answer.content)["next"] is None


async def test_a_page_is_built_in_a_thread(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    threads: list[Any] = []
    build = dependencies.page_json
    monkeypatch.setattr(
        dependencies, "page_json", lambda *page: threads.append(threading.current_thread()) or build(*page)
    )
    await save(bench, *RUNS)
    assert (await bench.client.get("/runs")).status_code == 200
    assert len(threads) == 1
    assert threading.main_thread() not in threads

"""How long one turn of the event loop takes is measured, and no answer takes it for long."""

import asyncio
import json
import sqlite3
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.pose import PoseDocument
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import ArmErrorModel
from daemon.runtime.loop_monitor import PERIOD_S, WINDOW_S, EventLoopMonitor, Stall
from daemon.store.database import DATABASE_NAME
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.clouds import OCTETS, POSE, cloud
from tests.daemon.records import a_touch_test, an_acceptance
from tests.daemon.rig_files import a_rig
from tests.daemon.scans.scan_folders import a_scan
from tests.support.waiting import LIMIT_S, eventually

MAX_STALL_S = 0.1
"""Processor time of one turn. Answers are meant to stay below 20 ms; this leaves room for a slow machine."""

OPENAPI = json.loads((Path(__file__).parents[3] / "docs" / "openapi.json").read_text(encoding="utf-8"))
STREAMS = ("/events", "/live", "/camera/stream")
SWEEPS = ("/sweeps/{sweep_id}", "/sweeps/{sweep_id}/points")
"""Of a line profiler: one small document, and a stream."""
ROWS = 500


class FakeClocks:
    wall_s = processor_s = 0.0

    def monitor(self) -> EventLoopMonitor:
        return EventLoopMonitor(lambda: self.wall_s, lambda: self.processor_s, period_s=0.001)


async def measured_after(clocks: FakeClocks, monitor: EventLoopMonitor, wall_s: float, processor_s: float) -> Stall:
    """What is measured when the clocks have gone on by so much until the timer's turn."""
    clocks.wall_s += wall_s
    clocks.processor_s += processor_s
    await asyncio.sleep(0.01)
    return monitor.longest()


async def test_the_longest_turn_is_reported_for_a_minute_or_two() -> None:
    clocks = FakeClocks()
    monitor = clocks.monitor()
    await monitor.start()
    try:
        assert await measured_after(clocks, monitor, 0.501, 0.3) == Stall(0.5, 0.3)
        assert await measured_after(clocks, monitor, 0.101, 0.1) == Stall(0.5, 0.3)
        assert (await measured_after(clocks, monitor, WINDOW_S + 1, 0.0)).processor_s == 0.3
        assert (await measured_after(clocks, monitor, WINDOW_S + 1, 0.0)).processor_s == 0.0
    finally:
        await monitor.stop()


async def test_a_busy_machine_is_no_stall_of_the_processor() -> None:
    clocks = FakeClocks()
    monitor = clocks.monitor()
    await monitor.start()
    stall = await measured_after(clocks, monitor, 3.001, 0.002)
    await monitor.stop()
    assert stall == Stall(3.0, 0.002)


async def test_a_turn_that_computes_is_measured(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        bench.application.loop_monitor.reset()
        await asyncio.sleep(PERIOD_S)
        until_s = time.thread_time() + 0.3
        while time.thread_time() < until_s:
            pass
        await eventually(lambda: bench.application.loop_monitor.longest().processor_s > 0.25)
        page = (await bench.client.get("/metrics")).text
    shown = next(line for line in page.splitlines() if line.startswith('handeyed_event_loop_stall_seconds{clock="proc'))
    assert float(shown.split()[1]) > 0.25


@pytest.mark.slow
@pytest.mark.usefixtures("heap_of_a_new_process", "computed_each_time")
async def test_no_answer_keeps_the_loop(tmp_path: Path) -> None:
    """Every GET route, each with the largest answer there is, of a store with hundreds of rows in each table."""
    async with serving(settings_for(tmp_path)) as bench:
        known = await filled(bench, tmp_path)

        async def stall_of(path: str) -> float:
            if path == "/support-bundle":
                return await longest_of_a_bundle(bench)
            ids = known | ({"run_id": known["verification_id"]} if path == "/runs/{run_id}/report" else {})
            return await longest_while(bench, path, path.format(**ids))

        stalls = {"/support-bundle": await stall_of("/support-bundle")}
        for path in [*OPENAPI["paths"], "/openapi.json"]:
            if path not in (*STREAMS, *SWEEPS) and "get" in OPENAPI["paths"].get(path, {"get": {}}):
                stalls[path] = await stall_of(path)
        for path in [path for path, stall_s in stalls.items() if stall_s > MAX_STALL_S]:  # by the answer, or by chance?
            stalls[path] = min([await stall_of(path) for _ in range(3)])
    for path, stall_s in sorted(stalls.items(), key=lambda item: -item[1])[:5]:
        print(f"{1000 * stall_s:5.1f} ms  {path}")
    assert {path: stall_s for path, stall_s in stalls.items() if stall_s > MAX_STALL_S} == {}


async def longest_while(bench: Bench, path: str, url: str) -> float:
    """Processor time in seconds of the longest turn while this is answered."""
    monitor = bench.application.loop_monitor
    await bench.client.get(url)  # what is computed once is not counted
    monitor.reset()
    parameters = OPENAPI["paths"].get(path, {}).get("get", {}).get("parameters", [])
    query: dict[str, Any] = {"limit": ROWS} if any(one["name"] == "limit" for one in parameters) else {}
    if path.endswith("/compare"):
        query = {"with": "copy-0"}
    if path == "/setup/target.pdf":
        query = {"target": "charuco:12x9:20:15:DICT_5X5_100"}
    if path.endswith("/surface"):
        query = {"view": 0, "voxel_mm": 1.0}
    answer = await bench.client.get(url, params=query)
    refused = (422,) if path.endswith("/arm/field") else ()  # the views of the stored calibration hold no joints
    assert answer.status_code in (200, 503, *refused), answer.text
    await asyncio.sleep(2 * PERIOD_S)
    return monitor.longest().processor_s


async def longest_of_a_bundle(bench: Bench) -> float:
    """Processor time in seconds of the longest turn while a support bundle with pictures is made."""
    bench.application.loop_monitor.reset()
    answer = await bench.client.post("/support-bundle", json={"pictures": True})
    assert answer.status_code == 200, answer.text
    await asyncio.sleep(2 * PERIOD_S)
    return bench.application.loop_monitor.longest().processor_s


async def filled(bench: Bench, folder: Path) -> dict[str, str]:
    """Fill the store with copies of one calibration, verification and scan; returns the ids by their name in a path."""
    run: dict[str, Any] = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
    assert run["state"] == "finished", run
    await apply_calibration(bench)
    await bench.verify()
    scan = await a_scan(bench)
    content = cloud(20_000).astype("<f4").tobytes()
    await bench.client.post(scan["links"]["views"], params={"pose": POSE}, content=content, headers=OCTETS)
    verification = (await bench.client.get("/runs")).json()["runs"][0]["id"]
    calibration = (await bench.client.get("/calibrations")).json()["calibrations"][0]["id"]
    with sqlite3.connect(folder / DATABASE_NAME) as database:
        for table, source in (("runs", verification), ("calibrations", calibration), ("scans", scan["id"])):
            names = ", ".join(row[1] for row in database.execute(f"PRAGMA table_info({table})") if row[1] != "id")
            copy = f"INSERT INTO {table} (id, {names}) SELECT ?, {names} FROM {table} WHERE id = ?"
            database.executemany(copy, [(f"copy-{k}", source) for k in range(ROWS)])
        accepted = an_acceptance(scan["id"]).model_dump_json()
        rows = [(f"copy-{k}", scan["id"], run["created_at"], "local", accepted) for k in range(ROWS)]
        database.executemany("INSERT INTO acceptances VALUES (?, ?, ?, ?, ?)", rows)
        rows = [(f"copy-{k}", "cal-1", run["created_at"], "local", a_touch_test()) for k in range(ROWS)]
        database.executemany("INSERT INTO touch_tests VALUES (?, ?, ?, ?, ?)", rows)
        rows = [(f"copy-{k}", "eye-in-hand", run["created_at"], "local", json.dumps(a_rig())) for k in range(ROWS)]
        database.executemany("INSERT INTO rigs VALUES (?, ?, ?, ?, ?)", rows)
        database.execute("INSERT INTO arms VALUES (?, ?)", (calibration, the_errors_of_an_arm()))
    return {
        "touch_id": "copy-0", "rig_id": "copy-0",
        "run_id": run["id"], "verification_id": verification, "k": "0", "scan_id": scan["id"],
        "calibration_id": calibration, "acceptance_id": "copy-0", "export_format": "rapid", "code": "link-lost",
    }  # fmt: skip


def the_errors_of_an_arm() -> str:
    """All of them, none large."""
    arm = ArmErrorModel(find_arm("IRB 1600-6/1.45"))
    size = 6 + len(arm)
    errors = [
        {"name": one.name, "group": one.group, "axis": one.axis, "unit": one.unit, "value": 0.1, "sigma": 0.1}
        for one in arm.parameters
    ]
    identified = {
        "arm": arm.arm.identifier, "created_at": "2026-01-01T00:00:00Z", "software": "handeyed", "setup": "eye-in-hand",
        "taken_up": True, "log_evidence": 10.0, "mount_T_camera": PoseDocument.of(np.eye(4)).model_dump(),
        "parameters": errors, "covariance": np.eye(size).tolist(), "scatter_mm": 0.05, "scatter_deg": 0.005,
        "ladder": [{"up_to": None, "probability": 0.0, "log_evidence": 0.0, "hold_out_mm": 0.3}] * 5, "views": 12,
        "places": 1, "lowest_joints_deg": [-90.0] * 6, "highest_joints_deg": [90.0] * 6,
    }  # fmt: skip
    return ArmErrorsDocument.model_validate(identified).model_dump_json()

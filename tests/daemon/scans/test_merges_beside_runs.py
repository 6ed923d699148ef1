"""Merges and registrations that viewers ask for: one at a time, a few waiting, beside a run and the watchdog."""

import asyncio
import os
import threading
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daemon.application import MAX_JOB_S
from daemon.model.records import CalibrationRecord
from daemon.runtime.clock import Clock
from daemon.runtime.workers import MAX_WAITING, Workers
from daemon.scans import scan_service
from registration.errors import MergeStopped
from registration.fusion.concatenation import PlacedCloud, merge_clouds
from tests.daemon.api.raw_requests import RawRequest
from tests.daemon.calibrations import a_calibration
from tests.daemon.cell_under_test import Bench
from tests.daemon.fakes import ply_of
from tests.support.waiting import LIMIT_S, eventually


class HeldMerge:
    """Takes the place of merge_clouds; each merge waits until `go` is set."""

    def __init__(self) -> None:
        self.begun = 0
        self.go = threading.Event()

    def __call__(self, clouds: Any, target: Path, *_: Any) -> None:
        self.begun += 1
        self.go.wait(LIMIT_S)
        target.write_bytes(b"ply")


@pytest.fixture
async def scan(bench: Bench) -> str:
    """The path of a scan with one view, a calibration being in force."""
    document = a_calibration("c")
    store = bench.application.store
    await store.save_calibration(CalibrationRecord("c", None, document.created_at, True, document))
    assert (await bench.client.post("/calibrations/c/apply")).status_code == 200
    location: str = (await bench.client.post("/scans", json={})).headers["location"]
    cloud = ply_of(np.random.default_rng(1).normal([0, 0, 500], 50, (100, 3)))
    sent = await bench.client.post(
        f"{location}/views", params={"pose": "900,0,900,1,0,0,0"}, content=cloud,
        headers={"content-type": "application/x-ply"},
    )  # fmt: skip
    assert sent.status_code == 201, sent.text
    return location


@pytest.fixture
async def merge(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[HeldMerge]:
    held = HeldMerge()
    monkeypatch.setattr(scan_service, "merge_clouds", held)
    yield held
    held.go.set()


def merged_files(bench: Bench) -> list[Path]:
    return list(bench.application.store.folder.glob("scans/*/merged-*"))


async def test_one_merge_is_computed_some_wait_and_more_are_refused(bench: Bench, scan: str, merge: HeldMerge) -> None:
    asked = {asyncio.create_task(bench.client.get(f"{scan}/cloud")) for _ in range(MAX_WAITING + 4)}
    refused = []
    for _ in range(3):
        asked.remove(one := await first_done(asked))
        refused.append(one.result().json()["code"])
    assert refused == 3 * ["workers-busy"]
    await eventually(lambda: merge.begun == 1)
    run = await bench.client.post("/calibrate", params={"wait": LIMIT_S})
    assert run.json()["state"] == "finished"
    merge.go.set()
    assert {(await one).status_code for one in asked} == {200}
    await eventually(lambda: not merged_files(bench))


async def first_done(tasks: "set[asyncio.Task[Any]]") -> "asyncio.Task[Any]":
    done, _ = await asyncio.wait(tasks, timeout=LIMIT_S, return_when=asyncio.FIRST_COMPLETED)
    return done.pop()


async def test_a_refusal_says_when_to_ask_again(bench: Bench, scan: str, merge: HeldMerge) -> None:
    waiting = {asyncio.create_task(bench.client.get(f"{scan}/cloud")) for _ in range(MAX_WAITING + 2)}
    refused = (await first_done(waiting)).result()
    assert (refused.status_code, refused.headers["retry-after"]) == (429, "5")
    merge.go.set()
    await asyncio.gather(*waiting)


async def test_merges_nobody_waits_for_are_not_begun_and_leave_no_file(
    bench: Bench, scan: str, merge: HeldMerge
) -> None:
    asked = [await RawRequest.send(bench, f"GET {scan}/cloud") for _ in range(MAX_WAITING)]
    pool = bench.application.merge_workers
    await eventually(lambda: merge.begun == 1 and len(pool._waiting) == MAX_WAITING - 1)
    for one in asked:
        await one.hang_up()
    await eventually(lambda: not pool._waiting)
    merge.go.set()
    await eventually(lambda: not pool._began_s and not merged_files(bench))
    assert merge.begun == 1


async def test_a_merge_that_hangs_does_not_stop_the_watchdog(bench: Bench, scan: str, merge: HeldMerge) -> None:
    asked = await RawRequest.send(bench, f"GET {scan}/cloud")
    await eventually(lambda: merge.begun == 1)
    application = bench.application
    later = Clock(monotonic_s=lambda: application.clock.monotonic_s() + 2 * MAX_JOB_S)
    for pool in (application.workers, application.service_workers, application.merge_workers):
        pool._clock = later
    assert application.merge_workers.oldest_job_s() > MAX_JOB_S
    assert await application.work_is_alive()
    await asked.hang_up()


def test_a_merge_stops_between_blocks(tmp_path: Path) -> None:
    file = tmp_path / "cloud.ply"
    file.write_bytes(ply_of(np.zeros((10, 3))))
    with pytest.raises(MergeStopped):
        merge_clouds([PlacedCloud(file, "mm", np.eye(4))], tmp_path / "merged.ply", stopped=lambda: True)
    assert list(tmp_path.iterdir()) == [file]


async def test_a_job_whose_caller_has_left_is_dropped() -> None:
    workers, held, ran = Workers(Clock(), threads=1), threading.Event(), []
    first = asyncio.create_task(workers.run(held.wait, LIMIT_S))
    second = asyncio.create_task(workers.run(ran.append, "second"))
    await eventually(lambda: len(workers._began_s) == 1)
    second.cancel()
    await asyncio.gather(second, return_exceptions=True)
    held.set()
    await first
    await workers.run(ran.append, "third")
    assert ran == ["third"]
    workers.close()


async def test_a_merge_goes_behind_everything_else_of_the_daemon(bench: Bench) -> None:
    ours = os.getpriority(os.PRIO_PROCESS, 0)
    for workers, behind in ((bench.application.merge_workers, min(10, 19 - ours)), (bench.application.workers, 0)):
        assert await workers.run(os.getpriority, os.PRIO_PROCESS, 0) == ours + behind
    assert os.getpriority(os.PRIO_PROCESS, 0) == ours

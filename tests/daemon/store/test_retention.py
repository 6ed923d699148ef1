"""Pictures go when they are many or old; never those of the calibration in force, and never for a wrong clock."""

import shutil
from collections import namedtuple
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from daemon.config.settings import StorageSettings
from daemon.model.records import AppliedCalibration, CalibrationRecord, RunRecord
from daemon.model.run_states import RunState
from daemon.runtime.clock import Clock
from daemon.runtime.workers import Workers
from daemon.store.retention import Retention, runs_to_prune
from daemon.store.store import Store
from tests.daemon.calibrations import a_calibration
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.records import a_run

NOON = datetime(2026, 11, 21, 12, tzinfo=UTC)


def run_of_day(day: int, state: RunState = RunState.FINISHED) -> RunRecord:
    at = (NOON + timedelta(days=day)).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    return replace(a_run(f"day{day}", state), created_at=at)


def newest_first(*days: int) -> list[RunRecord]:
    return [run_of_day(day) for day in sorted(days, reverse=True)]


NOTHING: frozenset[str] = frozenset()


@pytest.mark.parametrize(
    ("days", "keep_runs", "keep_days", "kept", "going"),
    [
        ((), 1, 1, NOTHING, []),
        ((0,), 1, 1, NOTHING, []),
        ((0, 1, 2, 3), 2, 100, NOTHING, ["day1", "day0"]),
        ((0, 1, 2, 3), 100, 1.5, NOTHING, ["day1", "day0"]),
        ((0, 1, 2, 3), 2, 1.5, frozenset({"day0"}), ["day1"]),
        ((0, 20_000), 100, 100, NOTHING, ["day0"]),
    ],
)
def test_what_goes(
    days: tuple[int, ...], keep_runs: int, keep_days: float, kept: frozenset[str], going: list[str]
) -> None:
    assert runs_to_prune(newest_first(*days), keep_runs, keep_days, kept) == going


def test_a_clock_set_wrong_while_nothing_ran_costs_nothing_and_a_run_in_progress_is_left_alone() -> None:
    assert runs_to_prune(newest_first(0, 1), 100, 30, NOTHING) == []  # whatever today's date is
    runs = [run_of_day(3), run_of_day(2, RunState.CAPTURING), run_of_day(1)]
    assert runs_to_prune(runs, 1, 100, NOTHING) == ["day1"]


async def retention(folder: Path, **settings: float) -> tuple[Store, Retention]:
    store, clock = Store(folder), Clock()
    for day in range(5):
        run = run_of_day(day)
        await store.save_run(run)
        for name in ("view_000.png", "view_001.png", "session.json"):
            await store.write_file(store.run_folder(run.id) / name, [b"x" * 1000])
    document = a_calibration("day0")
    await store.save_calibration(CalibrationRecord("day0", "day0", document.created_at, True, document))
    await store.apply(AppliedCalibration("day0", document.created_at, "Ann"))
    return store, Retention(store, Workers(clock), clock, StorageSettings(folder=str(folder), **settings))  # type: ignore[arg-type]


async def test_pictures_go_and_everything_else_stays(tmp_path: Path) -> None:
    store, keeper = await retention(tmp_path, keep_runs=2)
    removed = await keeper.tidy()
    assert sorted({picture.parent.name for picture in removed}) == ["day1", "day2"]
    for day in range(5):
        names = sorted(file.name for file in store.run_folder(f"day{day}").iterdir())
        pictures = ["view_000.png", "view_001.png"]
        assert names == ["session.json", *([] if day in (1, 2) else pictures)]
    assert await keeper.tidy() == []
    await store.close()


async def test_a_full_disk_is_foreseen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store, keeper = await retention(tmp_path, reserve_mb=1)
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(shutil, "disk_usage", lambda place: usage(1_000_000 + 99 * 3000 + 1))
    assert keeper.warnings() == []  # nothing is known yet
    await keeper.tidy()
    assert keeper.warnings() == [
        f"the disk of {tmp_path} has room for about 99 more runs: free some, or lower keep_runs"
    ]
    monkeypatch.setattr(shutil, "disk_usage", lambda place: usage(1_000_000 + 100 * 3000))
    assert keeper.warnings() == []
    monkeypatch.setattr(shutil, "disk_usage", lambda place: usage(0))
    assert "about 0 more runs" in keeper.warnings()[0]
    await store.close()


async def test_a_picture_that_was_removed_is_reported(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, storage={"keep_runs": 1})) as bench:
        first = (await bench.client.post("/calibrate?wait=30", json={"count": 3})).json()
        await bench.client.post("/calibrate?wait=30", json={"count": 3})
        (keeper,) = (each for each in bench.application.services if isinstance(each, Retention))
        assert len(await keeper.tidy()) == 3
        gone = await bench.client.get(first["links"]["frame 0"])
        assert (gone.status_code, gone.json()["code"]) == (404, "not-found")
        assert (await bench.client.get(first["links"]["calibration"])).status_code == 200


@pytest.mark.parametrize("jump_h", [-1, 1])
async def test_a_clock_that_jumps_an_hour_in_mid_run_changes_nothing(bench: Bench, jump_h: int) -> None:
    """Runs end, lists keep their order, keys of requests are remembered, nothing is removed."""
    jumped = [timedelta()]
    bench.application.supervisor._clock = Clock(utc_now=lambda: datetime.now(UTC) + jumped[0])

    async def jump(move: int) -> None:
        jumped[0] = timedelta(hours=jump_h) if move >= 2 else timedelta()

    bench.robot.before_move = jump
    runs = [
        (await bench.client.post("/calibrate?wait=30", json={"count": 3}, headers={"idempotency-key": key})).json()
        for key in ("a", "b", "a")
    ]
    assert [run["state"] for run in runs] == ["finished"] * 3
    assert runs[0]["id"] == runs[2]["id"]
    listed = (await bench.client.get("/runs")).json()["runs"]
    assert [run["id"] for run in listed] == [runs[1]["id"], runs[0]["id"]]

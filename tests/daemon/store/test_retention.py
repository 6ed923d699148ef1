"""Pictures go when they are many or old; never those of the active calibration, and never for a wrong clock."""

import shutil
from collections import namedtuple
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daemon.config.settings import StorageSettings
from daemon.model.records import AppliedCalibration, CalibrationRecord, RunRecord
from daemon.model.run_states import RunState
from daemon.runtime.clock import Clock
from daemon.runtime.workers import Workers
from daemon.store.retention import AGES_NAME, Retention, RunAges, read_ages, runs_to_prune
from daemon.store.store import Store
from tests.daemon.calibrations import a_calibration
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.records import a_run

NOON = datetime(2026, 11, 21, 12, tzinfo=UTC)


def run_of_day(day: int, state: RunState = RunState.FINISHED) -> RunRecord:
    return replace(a_run(f"day{day}", state), created_at=at_day(day))


def at_day(day: float) -> str:
    return (NOON + timedelta(days=day)).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def newest_first(*days: int) -> list[RunRecord]:
    return [run_of_day(day) for day in sorted(days, reverse=True)]


NOTHING: frozenset[str] = frozenset()


@pytest.mark.parametrize(
    ("days", "keep_runs", "old", "kept", "going"),
    [
        ((), 1, NOTHING, NOTHING, []),
        ((0,), 1, frozenset({"day0"}), NOTHING, []),
        ((0, 1, 2, 3), 2, NOTHING, NOTHING, ["day1", "day0"]),
        ((0, 1, 2, 3), 100, frozenset({"day0", "day1"}), NOTHING, ["day1", "day0"]),
        ((0, 1, 2, 3), 2, frozenset({"day1"}), frozenset({"day0"}), ["day1"]),
        ((0, 20_000), 100, NOTHING, NOTHING, []),
    ],
)
def test_what_goes(
    days: tuple[int, ...], keep_runs: int, old: frozenset[str], kept: frozenset[str], going: list[str]
) -> None:
    assert runs_to_prune(newest_first(*days), keep_runs, old, kept) == going


def test_a_run_in_progress_is_left_alone() -> None:
    runs = [run_of_day(3), run_of_day(2, RunState.CAPTURING), run_of_day(1)]
    assert runs_to_prune(runs, 1, NOTHING, NOTHING) == ["day1"]


DAY_S = 24 * 3600.0
STEPS = st.lists(
    st.tuples(
        st.integers(0, 20 * 86400).map(float),  # whole seconds that pass: their sums are exact
        st.sampled_from(["works", "restarts", "is off", "works"]),
        st.sampled_from([0, 0, 400, -400, 20_000, -20_000]),  # days by which the clock is set wrong
        st.integers(0, 3),  # runs
    ),
    min_size=1,
    max_size=60,
)


@given(steps=STEPS, keep_s=st.integers(86400, 30 * 86400), keep_runs=st.integers(1, 20))
@settings(max_examples=300, deadline=None)
def test_nothing_goes_that_a_right_clock_would_keep(
    steps: list[tuple[float, str, int, int]], keep_s: int, keep_runs: int
) -> None:
    runs: list[RunRecord] = []
    right: dict[str, float] = {}
    ages, now_s = RunAges(), 0.0
    for passed_s, daemon, wrong_days, count in steps:
        now_s += passed_s
        for _ in range(count):
            run = replace(run_of_day(0), id=f"r{len(runs)}", created_at=at_day(now_s / DAY_S + wrong_days))
            runs.insert(0, run)
            right[run.id] = now_s
        ids = [run.id for run in runs]
        ages = ages.after(passed_s if daemon == "works" else 0.0, ids[0] if ids else None)
        old = ages.older_than(keep_s, ids)
        keep = {run for run in ids[:keep_runs] if now_s - right[run] <= keep_s}
        assert not keep & {*runs_to_prune(runs, keep_runs, old, NOTHING)}


def test_a_daemon_that_works_all_the_time_knows_ages_to_the_day() -> None:
    ages, ids = RunAges(), []
    for day in range(40):
        ids.insert(0, f"day{day}")
        ages = ages.after(DAY_S, ids[0])
    assert ages.older_than(10 * DAY_S, ids) == {f"day{day}" for day in range(29)}
    assert ages.older_than(50 * DAY_S, ids) == set()


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"worked_s": "x", "marks": 7}', b"[" * 100_000])
def test_ages_that_cannot_be_read_make_every_run_young(tmp_path: Path, content: bytes) -> None:
    (tmp_path / AGES_NAME).write_bytes(content)
    assert read_ages(tmp_path) == RunAges()


async def retention(folder: Path, **changes: float) -> tuple[Store, Retention]:
    store, clock = Store(folder), Clock()
    for day in range(5):
        run = run_of_day(day)
        await store.save_run(run)
        for name in ("view_000.png", "view_001.png", "session.json"):
            await store.write_file(store.run_folder(run.id) / name, [b"x" * 1000])
    document = a_calibration("day0")
    await store.save_calibration(CalibrationRecord("day0", "day0", document.created_at, True, document))
    await store.apply(AppliedCalibration("day0", document.created_at, "Ann"))
    return store, Retention(store, Workers(clock), clock, StorageSettings(folder=str(folder), **changes))  # type: ignore[arg-type]


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


async def test_ages_are_counted_over_restarts_and_pictures_of_old_runs_go(tmp_path: Path) -> None:
    store, keeper = await retention(tmp_path, keep_runs=100, keep_days=1)
    now_s, removed = [0.0], {}
    for start in range(3):  # the daemon works for nine hours at a time
        keeper = Retention(store, keeper.workers, Clock(monotonic_s=lambda: now_s[0]), keeper.settings)
        for hour in range(10):
            if pictures := await keeper.tidy():
                removed[start * 9 + hour] = sorted({picture.parent.name for picture in pictures})
            now_s[0] += 3600.0
        now_s[0] += 1e6
    assert removed == {25: ["day1", "day2", "day3"]}
    assert read_ages(tmp_path).worked_s == 27 * 3600
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


async def test_a_run_of_several_sensors_takes_the_room_of_all_of_them(tmp_path: Path) -> None:
    store, keeper = await retention(tmp_path)
    await keeper.tidy()
    before = store.run_bytes
    for day in range(5):
        beside = store.folder_beside(f"day{day}", "wrist")
        beside.mkdir()
        (beside / "view_000.png").write_bytes(bytes(2000))
    await keeper.tidy()
    assert store.run_bytes == before + 2000
    await store.close()


async def test_a_picture_that_was_removed_is_reported(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, storage={"keep_runs": 1})) as bench:
        first = (await bench.client.post("/calibrate?wait=200", json={"count": 3})).json()
        await bench.client.post("/calibrate?wait=200", json={"count": 3})
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
        (await bench.client.post("/calibrate?wait=200", json={"count": 3}, headers={"idempotency-key": key})).json()
        for key in ("a", "b", "a")
    ]
    assert [run["state"] for run in runs] == ["finished"] * 3
    assert runs[0]["id"] == runs[2]["id"]
    listed = (await bench.client.get("/runs")).json()["runs"]
    assert [run["id"] for run in listed] == [runs[1]["id"], runs[0]["id"]]

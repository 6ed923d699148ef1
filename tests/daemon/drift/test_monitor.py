"""The daemon watches its calibration: verifications are charted, and an alarm reaches REST, PLC and metrics."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.calibration import calibration_document
from calibration.monitoring.control_chart import ChartSample
from calibration.transforms import transform
from calibration.verdict import judge
from daemon.drift.chart import chart_of
from daemon.drift.monitor import DriftMonitor
from daemon.drift.samples import ChartEntry, VerificationHistory, belongs_to_chart
from daemon.model.records import AppliedCalibration, RunRecord
from daemon.model.run_states import RunState
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.knocked_camera import QUICK, calibrated
from tests.simulated.spoiled_sessions import solved_session
from tests.support.waiting import eventually


def watch_of(bench: Bench) -> DriftMonitor:
    return next(companion for companion in bench.application.services if isinstance(companion, DriftMonitor))


@pytest.mark.slow
async def test_the_chart_is_reported_over_rest_with_every_verification_that_is_over(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path / "other")) as bench:
        off = (await bench.client.get("/drift")).json()
        assert (off["standing"], off["calibration_id"], off["points"]) == ("off", None, [])
        assert off["robot_noise"] is None
    async with calibrated(tmp_path) as (bench, camera):
        learning = (await bench.client.get("/drift")).json()
        assert (learning["standing"], learning["verifications"], learning["limit_mm"]) == ("learning", 0, None)
        current = (await bench.client.get("/calibrations/current")).json()["calibration"]
        assert learning["robot_noise"] == current["noise"]["belief"]
        assert learning["robot_noise"]["translation_factor"] < 4.0, "the run has told something of it"
        runs = []
        for turn in range(5):
            if turn == 4:
                camera.knock = transform(np.eye(3), [0.0, 3.0, 0.0])
            run = (await bench.client.post("/verify?wait=200")).json()
            told = (await bench.client.get("/drift")).json()
            runs.append(run["id"])
            assert [point["run_id"] for point in told["points"]] == runs
        assert [point["standing"] for point in told["points"]] == ["learning"] * 2 + ["steady"] * 2 + ["drifting"]
        assert [point["limit_mm"] is None for point in told["points"]] == [True, True, False, False, False]
        last = told["points"][-1]
        assert told["shift_mm"] == last["drift_mm"] == pytest.approx(np.linalg.norm(last["average_mm"]), abs=1e-5)
        assert last["drift_mm"] > last["limit_mm"] == told["limit_mm"]
        assert np.linalg.norm(last["shift_mm"]) == pytest.approx(3.0, abs=0.2)
        assert told["standing"] == "drifting"
        assert (learning["robot_noise"]["origin"], told["robot_noise"]["origin"]) == ("usual", "learnt")
        assert told["alarm"] == (await bench.client.get("/ready")).json()["warnings"][0]
        assert told["rules"] == {"weight": 0.2, "allowed_mm": 0.0, **QUICK}
        assert [point["run_id"] for point in (await bench.client.get("/drift?limit=2")).json()["points"]] == runs[-2:]
        words = (await bench.client.get("/drift", headers={"accept": "text/plain"})).text
        assert words.startswith(
            f"drift: drifting of calibration {told['calibration_id']}, 5 verifications\nalarm: drift:"
        )
        assert "robot's noise:" in words
        assert len(words.splitlines()) == 4 + 5


@pytest.mark.slow
async def test_each_run_is_read_from_the_store_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also past a run that is in progress, or whose end could not be stored yet."""
    monkeypatch.setattr("daemon.drift.samples.PAGE_RUNS", 2)
    async with calibrated(tmp_path) as (bench, _):
        for _ in range(5):
            await bench.verify()
        newest, *older = (await bench.client.get("/runs")).json()["runs"]
        store = bench.application.store
        record = await store.run(older[2]["id"])
        await store.save_run(replace(record, state=RunState.MOVING, result=None))
        applied, current = await store.current()
        document = current.document
        fresh = VerificationHistory(store, bench.application.workers, bench.application.settings.target)
        expected = [run["id"] for run in reversed([newest, *older]) if run["kind"] == "verify"]
        assert [entry.run_id for entry in await fresh.of(applied, document)] == [
            run for run in expected if run != record.id
        ]
        assert [entry.run_id for entry in await fresh.of(applied, document)] == [
            run for run in expected if run != record.id
        ]
        await store.save_run(record)
        assert [entry.run_id for entry in await fresh.of(applied, document)] == expected
        asked: list[str | None] = []
        runs = store.runs

        async def counted(limit: int, before: str | None = None) -> list[RunRecord]:
            asked.append(before)
            return await runs(limit, before)

        monkeypatch.setattr(store, "runs", counted)
        assert [entry.run_id for entry in await fresh.of(applied, document)] == expected
        assert asked == [None]
        assert await fresh.of(replace(applied, sequence=99), document) and len(asked) > 3


@pytest.mark.slow
async def test_the_chart_survives_a_restart_and_passes_over_what_does_not_belong(tmp_path: Path) -> None:
    async with calibrated(tmp_path) as (bench, _):
        for _ in range(3):
            await bench.verify()
        run = (await bench.client.get("/runs")).json()["runs"][0]
        sent = bench.application.settings.calibration.poses[:2]
        await bench.verify(poses=[pose.model_dump(mode="json") for pose in sent])
        await eventually(lambda: watch_of(bench).report.verifications == 3)
        before = watch_of(bench).report
    async with serving(settings_for(tmp_path, drift=QUICK)) as again:
        assert watch_of(again).report == before
        assert run["kind"] == "verify"


@pytest.mark.slow
@pytest.mark.parametrize("applied_at", ["2999-01-01T00:00:00.000Z", "2001-01-01T00:00:00.000Z"])
async def test_the_chart_is_of_what_was_verified_since_it_was_applied_whatever_the_clock_said(
    tmp_path: Path, applied_at: str
) -> None:
    """The clock stood wrong when it was applied: no later start, and no earlier period of it, changes the chart."""
    async with calibrated(tmp_path) as (bench, _):
        await bench.verify()
        applied, _ = await bench.application.store.current()
        await bench.application.store.apply(applied)
        for _ in range(2):
            await bench.verify()
        await eventually(lambda: watch_of(bench).report.verifications == 2)
        wrong = f"UPDATE applied SET applied_at = '{applied_at}'"
        await bench.application.store._database.write(lambda db: db.execute(wrong))
    async with serving(settings_for(tmp_path, drift=QUICK)) as again:
        assert watch_of(again).report.verifications == 2
        assert (await watch_of(again).chart_of_earlier(applied.calibration_id)).report.verifications == 3


def verification(**changes: Any) -> RunRecord:
    made: dict[str, Any] = {
        "id": "r", "kind": "verify", "state": RunState.FINISHED, "station": 3, "stations": 3,
        "created_at": "2026-11-21T10:00:00.000Z", "updated_at": "2026-11-21T10:01:00.000Z",
        "result": {"calibration_id": "c", "verification": {"points": [{"id": 0}, {"id": 87}]}},
    }  # fmt: skip
    return RunRecord(**{**made, **changes})


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, True),
        ({"kind": "scan"}, False),
        ({"state": RunState.FAILED, "result": None}, False),
        ({"result": {"calibration_id": "other"}}, False),
        ({"request": {"poses": []}}, False),
        ({"request": {"target": {}}}, False),
        ({"result": {"calibration_id": "c", "verification": {"points": [{"id": 88}]}}}, False),
    ],
)
def test_what_belongs_to_a_chart(changes: dict[str, Any], expected: bool) -> None:
    assert (
        belongs_to_chart(verification(**changes), AppliedCalibration("c", "2026-11-21T09:00:00.000Z", "x"), 88)
        is expected
    )


@pytest.mark.parametrize(("now_c", "named"), [(47.0, True), (33.0, False), (None, False)])
def test_the_alarm_names_the_cameras_temperature_where_it_is_another(
    tmp_path: Path, now_c: float | None, named: bool
) -> None:
    centres_x_mm = [*(0.02 * (-1) ** number for number in range(8)), 3.0, 3.0, 3.0]
    entries = [
        ChartEntry(str(number), "", ChartSample(np.array([x, 0.0, 0.0]), 0.05, 3), None, 32.0)
        for number, x in enumerate(centres_x_mm)
    ]
    entries[-1] = replace(entries[-1], camera_temperature_c=now_c)
    problem, solution = solved_session()
    document = calibration_document(
        solution, judge(problem, solution), calibration_id="c", created_at="now", software="handeyed 0"
    )
    drawn = chart_of(entries, document, settings_for(tmp_path))
    assert drawn.points[-1].camera_temperature_c == now_c
    assert drawn.report.alarm is not None
    assert ("the camera has 47.0 °C, in the first quick checks it had 32.0 °C" in drawn.report.alarm) is named


@pytest.mark.parametrize(("tolerance_mm", "standing"), [(1.0, "out-of-tolerance"), (50.0, "learning")])
def test_a_verification_out_of_tolerance_alarms_and_is_not_learnt_from(
    tmp_path: Path, tolerance_mm: float, standing: str
) -> None:
    """U of 0.3, 4.9, 9.0 and 30.4 mm while the chart learns from five."""
    entries = [
        ChartEntry(str(number), "", ChartSample(np.array([x, 0.0, 0.0]), 0.05, 3), expanded_mm=U)
        for number, (x, U) in enumerate(zip((0.0, 3.0, -5.0, 9.0), (0.3, 4.9, 9.0, 30.4), strict=True))
    ]
    problem, solution = solved_session()
    document = calibration_document(
        solution, judge(problem, solution), calibration_id="c", created_at="now", software="handeyed 0"
    )
    drawn = chart_of(entries, document, settings_for(tmp_path, calibration={"tolerance_mm": tolerance_mm}))
    assert [point.standing for point in drawn.points] == ["learning"] + 3 * [standing]
    alarm = drawn.report.alarm or ""
    assert ("U is 30 mm, the tolerance 1 mm" in alarm) is (standing == "out-of-tolerance")

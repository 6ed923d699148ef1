"""In any history the arm moves only for a request in progress, of somebody entitled, with the gate seen closed."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from daemon.cell.cell import Cell
from daemon.drift import schedule
from daemon.drift.schedule import DriftSchedule
from daemon.model.records import RunRecord
from daemon.runs.supervisor import Supervisor
from drivers.interlocked_robot import InterlockedRobot
from tests.stories.motion_witness import STEPS, WatchedPlant, watched_plant
from tests.support.cases import cases
from tests.support.patience import run_patiently
from tests.support.waiting import eventually

pytestmark = pytest.mark.slow

P = WatchedPlant


async def history(steps: Sequence[Any], folder: Path) -> tuple[list[str], int]:
    """What the witness finds wrong with these steps, and the number of departures."""
    async with watched_plant(folder) as plant:
        for step in steps:
            await step(plant)
        plant.stop_flood()
        await plant.operator_aborts()
        await plant.waits_for_a_move()
        plant.cell.clear_faults()
        await eventually(lambda: not plant.cell.controller.armed and not plant.cell.moving)
        return plant.witness.wrong, plant.witness.departures


@settings(max_examples=cases(5), deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(st.sampled_from(STEPS), min_size=3, max_size=12))
def test_the_arm_moves_only_for_a_request_in_progress_of_somebody_entitled(steps: list[Any]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        wrong, _ = run_patiently(history([P.operator_starts, *steps], Path(folder)))
    assert wrong == []


async def test_a_history_without_trouble_moves_the_arm(tmp_path: Path) -> None:
    steps = (P.operator_starts, P.waits_for_a_move, P.waits_for_a_move, P.readers_hang_up, P.operator_aborts)
    wrong, departures = await history(steps, tmp_path)
    assert wrong == []
    assert departures >= 1


async def test_a_plc_that_triggers_moves_the_arm_and_its_abort_stops_it(tmp_path: Path) -> None:
    async with watched_plant(tmp_path) as plant:
        await plant.plc_triggers()
        await eventually(lambda: plant.witness.departures > 0)
        await plant.plc_aborts()
        await eventually(lambda: not plant.cell.controller.armed and not plant.cell.moving)
        assert plant.witness.wrong == []


async def test_the_schedule_moves_the_arm_after_a_finished_run_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(schedule, "RETRY_S", 0.2)  # however long the run took
    async with watched_plant(tmp_path) as plant:
        await plant.waits_for_the_schedule()
        assert plant.witness.departures == 0
        await plant.operator_starts()
        await eventually(lambda: plant.witness.scheduled > 0)
        assert plant.witness.wrong == []


async def test_a_schedule_that_asks_nobody_is_found_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(DriftSchedule, "_skip_reason", lambda self: "")
    monkeypatch.setattr(schedule, "RETRY_S", 0.2)  # however long the run took
    async with watched_plant(tmp_path) as plant:
        await plant.operator_starts()
        await plant.operator_aborts()
        await eventually(lambda: any("nobody's request" in each for each in plant.witness.wrong))


async def test_an_abort_that_stops_nothing_is_found_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def abort(self: Supervisor, run_id: str, by: str) -> RunRecord:
        return await self.run(run_id)

    steps = (P.operator_starts, P.waits_for_a_move, P.operator_aborts, P.waits_for_a_move, P.waits_for_a_move)
    monkeypatch.setattr(Supervisor, "abort", abort)
    monkeypatch.setattr(Cell, "stop_motion", lambda self: None)
    async with watched_plant(tmp_path) as plant:
        for step in steps:
            await step(plant)
        assert any("nobody's request" in each or "answered with 200" in each for each in plant.witness.wrong)
        monkeypatch.undo()


async def test_a_move_with_an_open_gate_is_found_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def allow(self: InterlockedRobot) -> None:
        await self.interlocks.readings()

    monkeypatch.setattr(InterlockedRobot, "_require_interlocks", allow)
    steps = (P.operator_starts, P.waits_for_a_move, P.gate_moves, P.waits_for_a_move, P.waits_for_a_move)
    wrong, _ = await history(steps, tmp_path)
    assert any("gate was not seen closed" in each for each in wrong)

"""Starts, repeated starts and aborts in any order: the arm moves for an operator's new ticket only."""

import asyncio
from collections.abc import Awaitable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule, run_state_machine_as_test

pytest.importorskip("asyncua", reason="asyncua is not here: pip install 'handeyed[opcua]'")

from asyncua import ua

from tests.daemon.access_keys import bearer, with_keys
from tests.daemon.cell_under_test import Bench, Parts
from tests.gateways.opcua.plant import PlantClient, plant
from tests.support.patience import run_patiently
from tests.support.waiting import LIMIT_S

KINDS = {"calibrate": "calibration", "verify": "verification"}


@pytest.mark.slow
def test_whatever_the_order_a_run_is_one_ticket_of_an_operator(tmp_path: Path) -> None:
    """One cell and one gateway for all orders; what was true of the ones before must stay true."""
    run_patiently(_in_any_order(tmp_path))


async def _in_any_order(folder: Path) -> None:
    parts, may_move = Parts(), asyncio.Event()

    async def held(_: int) -> None:
        await may_move.wait()

    parts.robot.before_move = held
    async with (
        with_keys(folder, parts) as (bench, keys),
        plant(folder, {"cell7": bench.url}, {"cell7": keys["viewer"]}) as gateway,
        gateway.client("panel", keys["viewer"]) as panel,
        gateway.client("mes", keys["operator"]) as mes,
    ):
        await mes.listen("cell7.Cell.Ready")
        await mes.waits("cell7.Cell.Ready", True)
        bench.client.headers.update(bearer(keys["operator"]))
        machine = _machine(asyncio.get_running_loop(), bench, panel, mes, may_move)
        few = settings(
            max_examples=6,
            stateful_step_count=10,
            deadline=None,
            suppress_health_check=list(HealthCheck),
            database=None,
        )
        await asyncio.to_thread(run_state_machine_as_test, machine, settings=few)


def _machine(
    loop: asyncio.AbstractEventLoop, bench: Bench, panel: PlantClient, mes: PlantClient, may_move: asyncio.Event
) -> type[RuleBasedStateMachine]:
    """The rules; they run beside the loop, in a thread."""
    started: dict[str, tuple[str, str]] = {}  # by ticket: the kind, and the run's id
    orders = [0]
    stood: dict[str, Any] = {}  # runs and moves when nothing ran

    def wait_for(request: Awaitable[Any]) -> Any:
        async def answer() -> Any:
            try:
                return await request
            except ua.UaError as error:
                return error

        return asyncio.run_coroutine_threadsafe(answer(), loop).result(LIMIT_S)

    def runs() -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = wait_for(bench.client.get("/runs", params={"limit": 100})).json()["runs"]
        return found

    async def until_nothing_runs() -> None:
        may_move.set()
        for run in (await bench.client.get("/runs")).json()["runs"]:
            if not run["over"]:
                await bench.run_over(f"/runs/{run['id']}")
        may_move.clear()

    class Orders(RuleBasedStateMachine):
        def __init__(self) -> None:
            super().__init__()
            orders[0] += 1
            wait_for(until_nothing_runs())

        @rule(kind=st.sampled_from(list(KINDS)), ticket=st.sampled_from("abc"))
        def an_operator_starts(self, kind: str, ticket: str) -> None:
            ticket = f"{orders[0]}{ticket}"
            busy = any(not run["over"] for run in runs())
            answer = wait_for(mes.call("cell7.Cell.Start", kind, ticket))
            if ticket in started:
                known, run_id = started[ticket]
                assert answer == run_id if kind == known else isinstance(answer, ua.UaError)
            elif busy:
                assert type(answer).__name__ == "BadInvalidState"
            elif not isinstance(answer, ua.UaError):
                assert answer not in {run_id for _, run_id in started.values()}
                started[ticket] = (kind, answer)
            else:
                assert kind == "verify", "a calibration may start whenever nothing runs"

        @rule(kind=st.sampled_from(list(KINDS)), ticket=st.sampled_from("abc"))
        def a_viewer_starts(self, kind: str, ticket: str) -> None:
            answer = wait_for(panel.call("cell7.Cell.Start", kind, f"{orders[0]}{ticket}"))
            assert type(answer).__name__ == "BadUserAccessDenied"

        @rule()
        def an_operator_aborts(self) -> None:
            assert wait_for(mes.call("cell7.Cell.Abort")) is None
            wait_for(until_nothing_runs())

        @rule()
        def the_arm_goes_on(self) -> None:
            wait_for(until_nothing_runs())

        @invariant()
        def the_daemon_has_these_runs_and_no_other(self) -> None:
            found = runs()
            assert {run["id"]: run["kind"] for run in found} == {
                run_id: KINDS[kind] for kind, run_id in started.values()
            }
            now = {"runs": len(found), "moves": len(bench.robot.goals)}
            if all(run["over"] for run in found):
                assert stood.get("runs", 0) < len(found) or now == (stood or {"runs": 0, "moves": 0}), (
                    "a move without a run"
                )
                stood.update(now)

    return Orders

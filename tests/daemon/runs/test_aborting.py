"""Aborting a run: the arm is stopped and disarmed before anything else, and the answer says what is confirmed."""

import asyncio
import threading
from pathlib import Path

import pytest

from daemon.access.roles import Role
from daemon.http.request_pacing import RequestPacing
from daemon.store import access_keys
from daemon.store.store import Store
from tests.daemon.access_keys import TEST, bearer
from tests.daemon.cell_under_test import Parts, serving, settings_for
from tests.daemon.fakes import Gate
from tests.support.waiting import LIMIT_S, eventually


async def test_abort_stops_and_disarms_and_nothing_moves_afterwards(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(3)
    async with serving(settings_for(tmp_path), parts) as bench:
        run = (await bench.client.post("/calibrate")).json()
        await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        stopped = await bench.client.post(f"/runs/{run['id']}/abort")
        assert stopped.json()["state"] == "aborted"
        assert stopped.json()["cause"]["what"] == "aborted by a request over REST after picture 2 of 5"
        assert (bench.robot.armed, len(bench.robot.goals)) == (False, 3)
        assert bench.robot.stops >= 1
        gate.open.set()
        again = await bench.client.post(f"/runs/{run['id']}/abort")
        assert (again.status_code, again.json()["code"]) == (409, "run-over")
        assert len(bench.robot.goals) == 3
        assert (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()["state"] == "finished"


async def test_an_abort_that_the_controller_does_not_confirm_says_so_until_it_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("daemon.cell.safe_stop.MAX_ATTEMPT_S", 0.3)
    parts = Parts()
    parts.robot.before_move = gate = Gate(2)
    parts.robot.deaf = True
    async with serving(settings_for(tmp_path), parts) as bench:
        run = (await bench.client.post("/calibrate")).json()
        await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        for _ in range(2):
            answer = await bench.client.post(f"/runs/{run['id']}/abort")
            problem = answer.json()
            assert (answer.status_code, problem["code"]) == (502, "stop-unconfirmed")
            assert (problem["stopped"], problem["disarmed"], problem["holder"]) == (
                "confirmed", "unconfirmed", run["id"],
            )  # fmt: skip
            assert "emergency stop" in problem["fix"]
        ended = (await bench.client.get(f"/runs/{run['id']}")).json()
        assert ended["state"] == "aborted"
        assert "not confirmed that motion is switched off" in ended["cause"]["what"]
        ready = (await bench.client.get("/ready")).json()
        assert "not confirmed that motion is switched off" in ready["warnings"][0]
        refused = await bench.client.post("/calibrate")
        assert (refused.status_code, refused.json()["code"]) == (503, "cell-not-ready")
        assert "handeyed_arm_stop_unconfirmed 1" in (await bench.client.get("/metrics")).text

        parts.robot.deaf = False
        await eventually(lambda: not bench.robot.armed)
        await eventually(lambda: bench.application.cell.safe_stop.unconfirmed is None)
        assert (await bench.client.post(f"/runs/{run['id']}/abort")).json()["code"] == "run-over"
        assert (await bench.client.get("/ready")).json()["warnings"] == []
        gate.open.set()
        assert (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()["state"] == "finished"


async def test_an_abort_is_answered_while_the_run_still_waits_for_a_frozen_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("daemon.cell.safe_stop.MAX_ATTEMPT_S", 0.1)
    monkeypatch.setattr("daemon.runs.supervisor.MAX_ABORT_S", 0.2)
    parts = Parts()
    parts.robot.before_move = frozen = Frozen()
    parts.robot.deaf = True
    async with serving(settings_for(tmp_path), parts) as bench:
        run = (await bench.client.post("/calibrate")).json()
        await asyncio.wait_for(frozen.reached.wait(), LIMIT_S)
        for _ in range(2):
            answer = await bench.client.post(f"/runs/{run['id']}/abort")
            assert (answer.status_code, answer.json()["code"]) == (502, "stop-unconfirmed"), answer.text
            assert bench.application.supervisor.in_progress is not None
        frozen.thawed.set()
        assert (await bench.run_over(run["links"]["self"]))["state"] == "aborted"
        parts.robot.deaf = False
        await eventually(lambda: not bench.robot.armed)


async def test_a_jog_that_outlasts_the_daemon_is_answered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daemon.server.GRACE_S", 0.1)
    parts = Parts()
    parts.robot.before_move = frozen = Frozen()
    async with serving(settings_for(tmp_path), parts) as bench:
        run = (await bench.client.post("/calibrate", json={"manual": True})).json()
        jogging = asyncio.create_task(bench.client.post(run["links"]["jog"], json={"shift_mm": [0, 0, 5]}))
        await asyncio.wait_for(frozen.reached.wait(), LIMIT_S)
        bench.server.should_exit = True
        bench.application.begin_stop("the test")
        answer = await jogging
        assert (answer.status_code, answer.json()["code"]) == (503, "stopping"), answer.text
        frozen.thawed.set()


async def test_a_jog_that_the_daemons_end_aborts_is_answered_so(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(1)
    async with serving(settings_for(tmp_path), parts) as bench:
        run = (await bench.client.post("/calibrate", json={"manual": True})).json()
        jogging = asyncio.create_task(bench.client.post(run["links"]["jog"], json={"shift_mm": [0, 0, 5]}))
        await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        bench.server.should_exit = True
        bench.application.begin_stop("the test")
        answer = await jogging
        assert (answer.status_code, answer.json()["code"]) == (409, "run-over"), answer.text
        assert not bench.robot.armed


class Frozen:
    """A move that ends neither by arriving nor by being cancelled, until the controller has thawed."""

    def __init__(self) -> None:
        self.reached, self.thawed = asyncio.Event(), asyncio.Event()

    async def __call__(self, move: int) -> None:
        self.reached.set()
        try:
            await self.thawed.wait()
        except asyncio.CancelledError:
            await self.thawed.wait()
            raise


async def test_two_who_abort_at_once_both_get_the_confirmation(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(2)
    async with serving(settings_for(tmp_path), parts) as bench:
        run = (await bench.client.post("/calibrate")).json()
        await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        answers = await asyncio.gather(*(bench.client.post(f"/runs/{run['id']}/abort") for _ in range(5)))
        assert {answer.status_code for answer in answers} <= {200, 409}
        assert answers[0].json()["state"] == "aborted"
        assert not bench.robot.armed


async def test_an_abort_does_not_wait_for_the_store(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(2)
    store, done = Store(tmp_path), threading.Event()
    async with serving(settings_for(tmp_path), parts, store) as bench:
        key, _ = await bench.application.key_service.add("an operator", Role.OPERATOR, TEST)
        bench.client.headers.update(bearer(key))
        run = (await bench.client.post("/calibrate")).json()
        await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        busy = asyncio.create_task(store._database.run(done.wait, tmp_path))
        try:
            headers = {"Idempotency-Key": "stop-it"}
            aborting = asyncio.create_task(bench.client.post(f"/runs/{run['id']}/abort", headers=headers))
            await eventually(lambda: not bench.robot.armed)
            assert not aborting.done()
        finally:
            done.set()
        assert (await aborting).json()["state"] == "aborted"
        again = await bench.client.post(f"/runs/{run['id']}/abort", headers=headers)
        assert (again.status_code, again.headers["idempotency-replayed"]) == (200, "true")
        await busy


async def test_an_abort_with_a_key_that_was_just_read_waits_for_no_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(access_keys, "RECENT_S", LIMIT_S)
    parts = Parts()
    parts.robot.before_move = gate = Gate(2)
    store, done = Store(tmp_path), threading.Event()
    async with serving(settings_for(tmp_path), parts, store) as bench:
        key, _ = await bench.application.key_service.add("an operator", Role.OPERATOR, TEST)
        bench.client.headers.update(bearer(key))
        run = (await bench.client.post("/calibrate")).json()
        await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        readers = [store._database, store._opened.key_reader]
        busy = [asyncio.create_task(one.run(done.wait, tmp_path)) for one in readers]
        try:
            aborting = asyncio.create_task(bench.client.post(f"/runs/{run['id']}/abort"))
            await eventually(lambda: not bench.robot.armed)
        finally:
            done.set()
        assert (await aborting).json()["state"] == "aborted"
        await asyncio.gather(*busy)


async def test_other_requests_are_held_while_a_run_is_aborted_and_by_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    held: list[RequestPacing] = []
    hold = RequestPacing.hold
    monkeypatch.setattr(RequestPacing, "hold", lambda pacing: (held.append(pacing), hold(pacing)))
    parts = Parts()
    parts.robot.before_move = gate = Gate(2)
    async with serving(settings_for(tmp_path), parts) as bench:
        keys = {
            role: bearer((await bench.application.key_service.add(role.word, role, TEST))[0])
            for role in (Role.VIEWER, Role.OPERATOR)
        }
        run = (await bench.client.post("/calibrate", headers=keys[Role.OPERATOR])).json()
        await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        tried = [(Role.VIEWER, run["id"], 403), (Role.OPERATOR, "another", 404), (Role.OPERATOR, run["id"], 200)]
        for role, run_id, status in tried:
            assert not held
            answer = await bench.client.post(f"/runs/{run_id}/abort", headers=keys[role])
            assert answer.status_code == status, answer.text
        (pacing,) = held
        assert not pacing.held
        again = await bench.client.post(f"/runs/{run['id']}/abort", headers=keys[Role.OPERATOR])
        assert (again.status_code, len(held)) == (409, 1)

"""A PLC's abort: it stops what runs, and while it is held nobody starts."""

import asyncio
import struct
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from calibration.transforms import Array
from daemon.runtime.event_bus import BusEvent
from protocols.modbus.mbap import Adu
from protocols.plc.codes import ControlBit, PlcVerdict, StatusBit
from tests.daemon.cell_under_test import Bench, Parts, pose_json, serving, settings_for
from tests.daemon.fakes import FakeRobot, Gate, poses_around_the_target
from tests.extensions.plc.plcs import MOVING, ladder, plc_of, value_of
from tests.support.waiting import LIMIT_S

C, S = ControlBit, StatusBit


async def test_a_command_is_aborted_and_reported(tmp_path: Path) -> None:
    parts = Parts()
    gate = parts.robot.before_move = Gate(at_move=3)
    async with serving(settings_for(tmp_path, plc=MOVING), parts) as bench, ladder(bench) as plc:
        await plc.waits(S.ONLINE)
        await plc.triggers(C.TRIGGER_CALIBRATE)
        await gate.reached.wait()
        assert await plc.waits(S.BUSY)
        await plc.sets(C.ABORT)
        image = await plc.result()
        assert (value_of(image, "verdict"), value_of(image, "result_error")) == (PlcVerdict.ABORTED, 23)
        assert value_of(image, "result_stations") == 2
        assert bench.robot.stops
        assert not bench.robot.armed


async def test_while_abort_is_held_nobody_starts(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, plc=MOVING), Parts()) as bench, ladder(bench) as plc:
        await plc.sets(C(0))
        await plc.waits(S.READY)
        await plc.sets(C.ABORT)
        await plc.waits(S.ONLINE, unwanted=S.READY)
        for path, body in (("/calibrate", {}), ("/calibrate", {"manual": True}), ("/scans", {"capture": True})):
            answer = await bench.client.post(path, json=body)
            assert (answer.status_code, answer.json()["code"]) == (503, "abort-held")
            assert answer.json()["reasons"] == ["the PLC at 127.0.0.1 holds abort"]
        assert (await bench.client.get("/ready")).json()["calibrate"]["reasons"] == ["the PLC at 127.0.0.1 holds abort"]
        await plc.sets(C.ABORT | C.TRIGGER_CALIBRATE)
        await plc.waits(S.TRIGGER_ACK | S.ERROR)
        assert value_of(await plc.image(), "error_code") == 23
        assert not bench.robot.goals
        await plc.sets(C(0))
        assert (await bench.client.post("/calibrate", params={"wait": 200})).json()["state"] == "finished"


@pytest.mark.parametrize("words", [(C.ABORT,), (C.ABORT, C(0))], ids=["held", "a pulse"])
async def test_an_abort_while_a_run_is_prepared_keeps_it_from_starting(tmp_path: Path, words: tuple[C, ...]) -> None:
    reached, answers = asyncio.Event(), asyncio.Event()

    class SlowRobot(FakeRobot):
        async def read_joints(self) -> Array:
            reached.set()
            await answers.wait()
            return await super().read_joints()

    taught = {"poses": [pose_json(pose) for pose in poses_around_the_target(3)]}
    settings = settings_for(tmp_path, plc=MOVING, robot={"model": "IRB 1600-6/1.45"}, calibration=taught)
    async with serving(settings, Parts(SlowRobot())) as bench, ladder(bench) as plc:
        starting = asyncio.create_task(bench.client.post("/calibrate"))
        await reached.wait()
        for word in words:
            await plc.sets(word)
        answers.set()
        answer = await starting
        assert (answer.status_code, answer.json()["code"]) == (503, "abort-held")
        assert not bench.robot.goals


def write_of_control(number: int, control: C) -> bytes:
    return Adu(number, 1, struct.pack(">BHH", 6, 0, int(control))).encode()


async def test_an_old_press_that_comes_again_after_newer_writes_starts_nothing_but_an_old_abort_aborts(
    tmp_path: Path,
) -> None:
    async with serving(settings_for(tmp_path, plc=MOVING)) as bench, ladder(bench) as plc:
        await plc.waits(S.ONLINE)
        reader, writer = await asyncio.open_connection("127.0.0.1", plc_of(bench).tcp.port)
        press, release = write_of_control(2, C.TRIGGER_CALIBRATE), write_of_control(3, C(0))
        acknowledge, abort = write_of_control(4, C.RESULTS_ACK), write_of_control(6, C.ABORT)

        async def sends(frame: bytes) -> None:
            writer.write(frame)
            assert await reader.readexactly(len(frame)) == frame

        await sends(write_of_control(1, C(0)))
        await sends(press)
        await sends(release)
        await plc.waits(S.RESULTS_VALID)
        await sends(acknowledge)
        await sends(write_of_control(5, C(0)))
        await plc.waits(S.READY, unwanted=S.RESULTS_VALID)
        for frame in (press, release, acknowledge, press):
            await sends(frame)
        assert not await plc.status() & (S.BUSY | S.TRIGGER_ACK)
        assert len(bench.robot.goals) == 5
        await sends(abort)
        await sends(write_of_control(7, C(0)))
        await plc.waits(S.READY)
        await sends(abort)
        assert (await bench.client.post("/calibrate")).json()["code"] == "abort-held"
        await sends(write_of_control(8, C(0)))
        await sends(write_of_control(9, C.TRIGGER_CALIBRATE))
        await plc.waits(S.RESULTS_VALID)
        assert len(bench.robot.goals) == 10
        writer.close()


async def test_an_abort_by_the_plc_is_one_row_of_the_audit_log(tmp_path: Path) -> None:
    parts = Parts()
    gate = parts.robot.before_move = Gate(at_move=2)
    async with serving(settings_for(tmp_path, plc=MOVING), parts) as bench, ladder(bench) as plc:
        run = (await bench.client.post("/calibrate")).json()
        await gate.reached.wait()
        await plc.sets(C.ABORT)
        await bench.run_over(run["links"]["self"])

        async def aborts() -> list[tuple[str, str]]:
            rows = (await bench.client.get("/audit")).json()["rows"]
            return [(row["actor"], row["subject"]) for row in rows if row["action"] == "abort"]

        async with asyncio.timeout(LIMIT_S):
            while not await aborts():  # noqa: ASYNC110 - the row appears behind HTTP
                await asyncio.sleep(0.01)
        await plc.sets(C.ABORT)
        await plc.status()
        assert await aborts() == [("the PLC at 127.0.0.1", run["id"])]


async def test_events_and_a_plc_see_that_a_stop_is_not_confirmed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("daemon.cell.safe_stop.MAX_ATTEMPT_S", 0.3)
    parts = Parts()
    parts.robot.before_move = gate = Gate(1)
    parts.robot.deaf = True
    async with serving(settings_for(tmp_path, plc=MOVING), parts) as bench, ladder(bench) as plc:
        run = (await bench.client.post("/calibrate")).json()
        await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        await plc.sets(C.ABORT)
        await plc.waits(S.STOP_UNCONFIRMED, unwanted=S.READY)
        assert (await bench.run_over(run["links"]["self"]))["state"] == "aborted"
        parts.robot.deaf = False
        await plc.sets(C(0))
        await plc.waits(S.READY, unwanted=S.STOP_UNCONFIRMED)
        await bench.application.events.flush()
        events = [event async for event in _events_so_far(bench) if event.kind == "arm"]
        assert [(event.data["stopped"], event.data["disarmed"]) for event in events] == [(True, False), (True, True)]


async def _events_so_far(bench: Bench) -> AsyncIterator[BusEvent]:
    async for event in bench.application.events.listen(0, 0.0):
        if event is None:
            return
        yield event

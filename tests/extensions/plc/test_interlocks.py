"""The cell's interlocks are preconditions of motion at every door, the PLC's too."""

from pathlib import Path
from typing import Any

from protocols.plc.codes import ControlBit, StatusBit
from tests.daemon.cell_under_test import serving, settings_for
from tests.drivers.modbus_terminal import Terminal, terminal
from tests.extensions.plc.plcs import MOVING, ladder, value_of


def settings_with(folder: Path, device: Terminal) -> Any:
    signals = [
        {"name": "gate closed", "kind": "discrete-input", "address": 0},
        {"name": "part present", "kind": "coil", "address": 3},
    ]
    interlocks = {"address": f"tcp://127.0.0.1:{device.port}", "limit_s": 5.0, "signals": signals}
    return settings_for(folder, plc=MOVING, interlocks=interlocks)


async def test_an_open_gate_is_named_at_every_door(tmp_path: Path) -> None:
    async with (
        terminal() as device,
        serving(settings_with(tmp_path, device)) as bench,
        ladder(bench) as plc,
    ):
        device.inputs[0] = False
        ready = (await bench.client.get("/ready")).json()
        assert ready["calibrate"]["reasons"] == ["interlock gate closed: is 0"]
        answer = await bench.client.post("/calibrate")
        assert (answer.status_code, answer.json()["code"]) == (503, "interlock-open")
        assert answer.json()["reasons"] == ["interlock gate closed: is 0"]
        await plc.waits(StatusBit.ONLINE, unwanted=StatusBit.READY)
        assert await plc.triggers(ControlBit.TRIGGER_CALIBRATE) & StatusBit.ERROR
        assert value_of(await plc.image(), "error_code") == 13
        assert not bench.robot.goals
        device.inputs[0] = True
        run = await bench.run_over((await bench.client.post("/calibrate")).headers["location"])
        assert run["state"] == "finished"


async def test_an_open_gate_and_a_plc_that_holds_abort_refuse_a_jog(tmp_path: Path) -> None:
    up = {"shift_mm": [0.0, 0.0, 20.0]}
    async with terminal() as device, serving(settings_with(tmp_path, device)) as bench, ladder(bench) as plc:
        device.inputs[0] = False
        assert (await bench.client.post("/robot/jog", json=up)).json()["code"] == "interlock-open"
        device.inputs[0] = True
        await plc.sets(ControlBit.ABORT)
        await plc.waits(StatusBit.ONLINE)
        assert (await bench.client.post("/robot/jog", json=up)).json()["code"] == "abort-held"
        assert not bench.robot.goals

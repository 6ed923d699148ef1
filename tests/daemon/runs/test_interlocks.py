"""The cell's interlocks are asked again before each move."""

from pathlib import Path

from tests.daemon.cell_under_test import Parts, serving, settings_for
from tests.drivers.modbus_terminal import terminal
from tests.drivers.rtu_terminal import rtu_terminal


async def test_a_gate_opened_between_two_moves_ends_the_run_before_the_next(tmp_path: Path) -> None:
    parts = Parts()
    async with terminal() as device:
        signals = [{"name": "gate closed", "kind": "discrete-input", "address": 0}]
        interlocks = {"address": f"tcp://127.0.0.1:{device.port}", "limit_s": 5.0, "signals": signals}
        async with serving(settings_for(tmp_path, interlocks=interlocks), parts) as bench:

            async def gate_opens(move: int) -> None:
                device.inputs[0] = move != 2

            parts.robot.before_move = gate_opens
            run = await bench.run_over((await bench.client.post("/calibrate")).headers["location"])
            assert (run["state"], run["cause"]["code"]) == ("failed", "interlock-open")
            assert "gate closed is 0" in run["cause"]["what"]
            assert "after picture 2 of 5" in run["cause"]["what"]
            assert len(bench.robot.goals) == 2
            assert not bench.robot.armed


async def test_late_answers_of_a_serial_terminal_never_let_a_move_begin(tmp_path: Path) -> None:
    """The part goes missing during the first move; a monitor asks for /ready while the terminal's answers are late."""
    parts = Parts()
    async with rtu_terminal() as device:
        device.bank.inputs[1] = True
        signals = [{"name": "gate closed", "address": 0}, {"name": "part present", "address": 1}]
        interlocks = {"address": device.address, "limit_s": 1.0, "signals": signals}
        async with serving(settings_for(tmp_path, interlocks=interlocks), parts) as bench:

            async def part_goes_and_answers_are_late(move: int) -> None:
                if move == 1:
                    device.bank.inputs[1] = False
                    device.holds = True
                    assert (await bench.client.get("/ready")).json()["calibrate"]["reasons"]
                    device.holds = False
                    await device.send(len(device.held))

            parts.robot.before_move = part_goes_and_answers_are_late
            reasons = []
            begun = await bench.client.post("/calibrate")
            while not (run := (await bench.client.get(begun.headers["location"])).json())["cause"]:
                reasons += (await bench.client.get("/ready")).json()["calibrate"]["reasons"]
        assert run["cause"]["code"] == "interlock-open"
        assert len(bench.robot.goals) == 1
        assert "interlock gate closed: is 0" not in reasons

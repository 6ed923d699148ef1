"""abb-motion-program-exec 0.7 (rpiRobotics), unmodified: a whole motion program, from upload to its log.

The program on the controller is theirs in RAPID; a twin of it, as far as MoveAbsJ, stands in for it here.
"""

import asyncio
import struct
from collections.abc import Iterator

import numpy as np
import pytest

from tests.foreign.client_checks import held_by
from tests.mock_robot.controller_client import AWAY, HOME
from tests.mock_robot.rws_cell import RwsCell, rws_cell_apart
from tests.support.waiting import eventually

client_module = pytest.importorskip(
    "abb_motion_program_exec.abb_motion_program_exec_client", reason="abb-motion-program-exec is not installed"
)
PROGRAM, LOG = "RAMDISK/motion_program.bin", "log-2026-11-21-00-00-00-0000.bin"
MOVE_ABS_J, NUMBERS_OF_A_MOVE = 1, 12 + 4 + 7


class Twin:
    """Their RAPID program, in as far as this test needs it."""

    def __init__(self, cell: RwsCell, header_bytes: int) -> None:
        self._cell, self._header_bytes = cell, header_bytes
        self.version = 0.0
        self._running: asyncio.Task[None] | None = None

    def __call__(self) -> None:
        self._running = asyncio.get_running_loop().create_task(self._run())

    async def _run(self) -> None:
        cell, controller = self._cell, self._cell.controller
        try:
            rows = [await self._move(*move) for move in self._moves(cell.world.volumes.files[PROGRAM])]
            cell.world.volumes.files[f"RAMDISK/{LOG}"] = _log(rows)
            for words in (f"Motion Program Log File Opened\n{LOG}", f"Motion Program Log File Closed\n{LOG}"):
                controller.record(cell.cell.clock(), 80003, words)
        except Exception as error:
            controller.record(cell.cell.clock(), 80001, f"Motion Program Failed\n{error!r}\n\n\n")
            raise
        finally:
            controller.run_program(False, cell.cell.clock())

    def _moves(self, program: bytes) -> Iterator[tuple[float, ...]]:
        (self.version,) = struct.unpack_from("<f", program)
        numbers = [number for (number,) in struct.iter_unpack("<f", program[self._header_bytes :])]
        for start in range(0, len(numbers), 2 + NUMBERS_OF_A_MOVE):
            number, opcode, *values = numbers[start : start + 2 + NUMBERS_OF_A_MOVE]
            assert opcode == MOVE_ABS_J
            yield (number, *values)

    async def _move(self, number: float, *values: float) -> list[float]:
        cell, arm = self._cell, self._cell.controller.arm
        arm.depart(np.radians(values[:6]), values[12], False, cell.controller.robot_s(cell.cell.clock()))
        await eventually(lambda: arm.is_settled_at(cell.controller.robot_s(cell.cell.clock())))
        return [cell.cell.clock(), number, *cell.world.joints_deg]


def _log(rows: list[list[float]]) -> bytes:
    """As their client reads it: version, two texts behind their lengths, rows; every number a float32."""

    def text(words: str) -> bytes:
        return struct.pack("<f", len(words)) + words.encode()

    heads = text("2026-11-21-00-00-00-0000") + text("timestamp,cmd_num,J1,J2,J3,J4,J5,J6")
    return struct.pack("<f", 10011) + heads + np.array(rows, "<f4").tobytes()


@pytest.fixture
def cell() -> Iterator[RwsCell]:
    with rws_cell_apart(time_scale=50.0) as running:
        yield running


def test_a_motion_program_runs_from_upload_to_log_and_the_arm_stands_at_its_last_target(cell: RwsCell) -> None:
    header_bytes = len(client_module.MotionProgram().get_program_bytes())
    twin = Twin(cell, header_bytes)
    cell.world.programs.append(twin)
    cell.does(lambda: cell.controller.run_program(False, cell.cell.clock()))
    program = client_module.MotionProgram()
    for joints in (AWAY, HOME):
        target = client_module.jointtarget(np.degrees(joints), np.zeros(6))
        program.MoveAbsJ(target, client_module.speeddata(500, 500, 5000, 1000), client_module.zonedata(True, *[0] * 6))
    client = client_module.MotionProgramExecClient(base_url=cell.first)
    log = client.execute_motion_program(program)
    assert twin.version == 10011
    assert log.column_headers[2:] == ["J1", "J2", "J3", "J4", "J5", "J6"]
    assert np.allclose(log.data[:, 2:], np.degrees([AWAY, HOME]), atol=1e-4)
    assert f"RAMDISK/{LOG}" not in cell.world.volumes.files
    target = client.abb_client.get_robtarget()
    assert [f"{value:.9g}" for value in target.trans] == list(held_by(cell).values())[:3]
    client.abb_client.close()


def test_it_refuses_by_itself_what_the_controller_would_refuse(cell: RwsCell) -> None:
    client = client_module.MotionProgramExecClient(base_url=cell.first)
    with pytest.raises(Exception, match="must be stopped"):
        client.execute_motion_program(client_module.MotionProgram())
    client.abb_client.close()

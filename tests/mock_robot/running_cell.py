"""A mock cell for stories: in the test's own event loop, or as the process the demo starts.

async with running_cell(time_scale=20) as cell:
    cell.announcement.robot_port
    cell.inject_fault("link-reply-lost", only=Command.MOVE)
    assert cell.commanded_moves == 1
"""

import asyncio
import json
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

from mock_robot.cabinet.cabinet import Cabinet
from mock_robot.cell import Announcement, MockCell, Ports, RobotProgram
from mock_robot.truth.truth import CellTruth
from protocols.cb.codes import Command
from tests.support.patience import CLOCK
from tests.support.waiting import LIMIT_S

ROOT = Path(__file__).parents[2]


@dataclass
class RunningCell:
    """A cell in this event loop: what the bench sees of it, and what it can do to it."""

    cell: MockCell
    announcement: Announcement

    @property
    def controller(self) -> Cabinet:
        return self.cell.controller

    @property
    def truth(self) -> CellTruth:
        return self.cell.truth

    @property
    def commanded_moves(self) -> int:
        """How many moves the controller accepted: what must not rise after a fault."""
        return self.controller.moves_accepted

    @property
    def moving(self) -> bool:
        now_s = self.cell.clock()
        return self.cell.controller.arm.is_moving_at(self.cell.controller.robot_s(now_s))

    def inject_fault(
        self, fault: str, *, strikes: int | None = None, only: Command | None = None, after_moves: int = 0
    ) -> None:
        self.cell.inject_fault(fault, strikes=strikes, only=only, after_moves=after_moves)

    def clear_faults(self, fault: str | None = None) -> None:
        self.cell.clear_faults(fault)

    def presses_emergency_stop(self, pressed: bool = True) -> None:
        self.controller.press_emergency_stop(pressed, self.cell.clock())
        self.cell.nudge()


@asynccontextmanager
async def running_cell(
    seed: int = 7,
    time_scale: float = 20.0,
    *,
    serial: bool = False,
    devices: bool = True,
    truth: CellTruth | None = None,
    program: RobotProgram = "rapid",
    profiler: int | None = None,
    apart: bool = False,
) -> AsyncIterator[RunningCell]:
    """A cell on ports the system chose, closed at the end whatever happens.

    `apart`: for a daemon in another process, which a busy machine may keep for seconds: the controller's time, but not
    the arm's, goes on ten times slower, so that it waits 20 s for a sign of life.
    """
    slower = 10.0 if apart else 1.0
    cell = MockCell(
        truth or CellTruth.from_seed(seed),
        time_scale=slower * time_scale,
        program=program,
        clock=lambda: CLOCK.now_s() / slower,
    )
    try:
        ports = Ports(serial=serial, devices=0 if devices else None, profiler=profiler)
        yield RunningCell(cell, await cell.start(ports))
    finally:
        await cell.close()


@dataclass
class CellProcess:
    """A cell in its own process, driven over its control port."""

    process: Process
    announcement: dict[str, Any]

    async def state(self) -> dict[str, Any]:
        return await self._ask("GET", "/state")

    async def commanded_moves(self) -> int:
        return int((await self.state())["moves_commanded"])

    async def inject_fault(self, fault: str, **how: Any) -> None:
        await self._ask("POST", f"/faults/{fault}", how)

    async def clear_faults(self, fault: str | None = None) -> None:
        await self._ask("DELETE", "/faults" if fault is None else f"/faults/{fault}")

    async def presses_emergency_stop(self, pressed: bool = True) -> None:
        await self._ask("POST", "/emergency-stop", {"pressed": pressed})

    async def ends(self, within_s: float = LIMIT_S) -> int:
        """SIGTERM; the exit code."""
        self.process.terminate()
        return await asyncio.wait_for(self.process.wait(), within_s)

    async def _ask(self, method: str, path: str, body: Any = None) -> Any:
        async with httpx.AsyncClient(
            base_url=self.announcement["control"], trust_env=False, verify=False, timeout=LIMIT_S
        ) as client:
            response = await client.request(method, path, json=body)
        response.raise_for_status()
        return response.json()


@asynccontextmanager
async def cell_process(*arguments: str, within_s: float = LIMIT_S) -> AsyncIterator[CellProcess]:
    """`python -m mock_robot run ...`, ready; it ends with this block, or when the tests' process dies."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "mock_robot", "run", "--with-parent", *arguments, stdin=PIPE, stdout=PIPE, cwd=ROOT
    )
    assert process.stdout is not None
    try:
        line = await asyncio.wait_for(process.stdout.readline(), within_s)
        assert line, f"the cell ended with {await process.wait()} before it was ready"
        yield CellProcess(process, json.loads(line))
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()

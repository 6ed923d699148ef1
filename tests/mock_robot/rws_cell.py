"""A cell with Robot Web Services for tests: in the test's own loop, or in a thread for clients that block."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

import httpx

from mock_robot.cell import MockCell, Ports
from mock_robot.links.cb_program import Controller
from mock_robot.rws.world import World
from mock_robot.truth.truth import CellTruth
from tests.support.patience import PatientLoop
from tests.support.waiting import LIMIT_S

Result = TypeVar("Result")
ACCEPT_2 = {"Accept": "application/hal+json;v=2.0"}
FORM_2 = {"Content-Type": "application/x-www-form-urlencoded;v=2.0", **ACCEPT_2}


@dataclass
class RwsCell:
    """A cell that serves RWS at two URLs; `robot`, `serial`: the CB link; `control`: the control port's URL."""

    cell: MockCell
    first: str
    second: str
    robot: tuple[str, int]
    loop: asyncio.AbstractEventLoop
    control: str = ""
    serial: str = ""

    @property
    def world(self) -> World:
        return self.cell.rws.world

    @property
    def controller(self) -> Controller:
        return self.cell.controller

    def rws(self, version: int) -> str:
        """The driver's address of one version."""
        return "rws://" + (self.first, self.second)[version - 1].partition("//")[2]

    def does(self, act: Callable[[], Result]) -> Result:
        """Something is done to the cell, in its own loop, from another thread."""

        async def done() -> Result:
            return act()

        return asyncio.run_coroutine_threadsafe(done(), self.loop).result(LIMIT_S)

    def client_1(self, user: str = "Default User", password: str = "robotics") -> httpx.Client:
        """A client that knows the rules of 1.0."""
        return httpx.Client(
            base_url=self.first, auth=httpx.DigestAuth(user, password), trust_env=False, timeout=LIMIT_S
        )

    def client_2(self, password: str = "robotics") -> httpx.Client:
        """A client that knows the rules of 2.0."""
        auth = ("Admin", password)
        return httpx.Client(
            base_url=self.second, auth=auth, verify=False, headers=ACCEPT_2, trust_env=False, timeout=LIMIT_S
        )


async def _started(**options: Any) -> RwsCell:
    made = {name: options.pop(name) for name in ("time_scale", "program", "home", "clock") if name in options}
    cell = MockCell(CellTruth.from_seed(7), **{"time_scale": 20.0, **made})
    announced = await cell.start(Ports(devices=None, rws=(0, 0), **options))
    assert announced.rws is not None
    robot = (announced.robot_host, announced.robot_port or 0)
    loop, control, serial = asyncio.get_running_loop(), announced.control_url, announced.serial_path or ""
    return RwsCell(cell, announced.rws.first, announced.rws.second, robot, loop, control, serial)


@asynccontextmanager
async def rws_cell(**options: Any) -> AsyncIterator[RwsCell]:
    """In this loop."""
    cell = await _started(**options)
    try:
        yield cell
    finally:
        await cell.cell.close()


@contextmanager
def rws_cell_apart(**options: Any) -> Iterator[RwsCell]:
    """In a thread of its own."""
    loop = PatientLoop()
    thread = threading.Thread(target=loop.run_forever, name="the cell", daemon=True)
    thread.start()
    try:
        cell = asyncio.run_coroutine_threadsafe(_started(**options), loop).result(LIMIT_S)
        try:
            yield cell
        finally:
            asyncio.run_coroutine_threadsafe(cell.cell.close(), loop).result(LIMIT_S)
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join(LIMIT_S)
        loop.close()

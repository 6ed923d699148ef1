"""The robot's links for each robot program: a cabinet that is reachable between `start` and `close`."""

import asyncio
import os
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

from mock_robot.arm.simulated_arm import SimulatedArm
from mock_robot.cabinet.cabinet import Cabinet
from mock_robot.errors import MockError
from mock_robot.faults.board import FaultBoard
from mock_robot.faults.tables import FAULTS
from mock_robot.links.cb_program import Controller
from mock_robot.links.servers import SerialLinkServer, TcpLinkServer, open_pty
from mock_robot.rapid.controller import DEPLOYED, RapidController
from mock_robot.rapid.devices import FrameFaultBoard
from mock_robot.rapid.errors import RapidProgramError, RapidSyntaxError
from mock_robot.rapid.home import load_problems

Clock = Callable[[], float]
_UNTURNED = [1.0, 0.0, 0.0, 0.0]
CAMERA_LOAD = [True, [[0.0, 0.0, 0.0], _UNTURNED], [1.5, [0.0, 0.0, 60.0], _UNTURNED, 0.0, 0.0, 0.0]]
"""`cell_flange` as an integrator sets it: the flange's frame, with a camera and its bracket, 1.5 kg, 60 mm out."""


class PythonWires:
    """Links of the Python program: a socket and, if requested, a pty beside it. `state`: that of a Cabinet."""

    def __init__(self, arm: SimulatedArm, clock: Clock, seed: int, **state: Any) -> None:
        self.controller: Cabinet = (controller := Controller(arm, **state))
        self.board = FaultBoard(FAULTS, seed)
        self._tcp = TcpLinkServer(controller, self.board, clock)
        self._serial = SerialLinkServer(controller, self.board, clock)
        self._closing = AsyncExitStack()

    async def start(self, host: str, port: int, serial: bool) -> tuple[str, int | None, str | None]:
        """Open the socket and the pty; returns their addresses."""
        host, port = await self._tcp.start(host, port)
        self._closing.push_async_callback(self._tcp.close)
        if not serial:
            return host, port, None
        path = await self._serial.start()
        self._closing.push_async_callback(self._serial.close)
        return host, port, path

    async def close(self) -> None:
        await self._closing.aclose()

    def nudge(self) -> None:
        self._tcp.nudge()
        self._serial.nudge()


class RapidWires:
    """Links of the RAPID program, which opens its own socket, or the pty behind its serial port, as configured.

    `home`: a folder with a program of its own, which is not configured and not waited for. `state`: that of a Cabinet.
    """

    def __init__(self, arm: SimulatedArm, clock: Clock, seed: int, home: Path | None = None, **state: Any) -> None:
        self.board = FrameFaultBoard(FAULTS, seed)
        self.controller = self._rapid = RapidController(
            arm, clock=clock, board=self.board, folder=home or DEPLOYED, home=home is not None, **state
        )
        self._ends: tuple[int, ...] = ()

    async def start(self, host: str, port: int, serial: bool) -> tuple[str, int | None, str | None]:
        """Configure as an integrator does, then load and start the program."""
        rapid = self._rapid
        rapid.devices.host = host
        if rapid.home:
            await asyncio.to_thread(self._begin_foreign)
            return host, None, None
        rapid.settings = {
            "cell_use_serial": serial,
            "cell_port": float(port),
            "cell_box_low": list(rapid.box.low_mm),
            "cell_box_high": list(rapid.box.high_mm),
            "cell_flange": CAMERA_LOAD,
            "cell_session": float(rapid.session - 1),
        }
        path = None
        if serial:
            self._ends, path = open_pty()
        await asyncio.to_thread(rapid.begin, self._ends[0] if serial else None)
        await asyncio.to_thread(rapid.await_link)
        address = rapid.devices.address
        return host, None if address is None else address[1], path

    def _begin_foreign(self) -> None:
        """Load and start whatever the folder holds. Raises MockError, which names what is not known, by file."""
        try:
            self._rapid.begin()
        except (RapidSyntaxError, RapidProgramError) as error:
            count, problems = load_problems(self._rapid.folder)
            named = "; ".join(f"{problem.file}: {problem.what}" for problem in problems) or str(error)
            raise MockError(f"{len(problems)} of {count} modules do not load: {named}") from error

    async def close(self) -> None:
        """Stop the tasks, which closes their sockets."""
        await asyncio.to_thread(self._rapid.end)
        for end in self._ends:
            os.close(end)
        self._ends = ()

    def nudge(self) -> None:
        """Nothing to do: the tasks poll."""


Wires = PythonWires | RapidWires

"""Random fault schedules for the CB link with the shipped RAPID: one move each, under one to three faults.

Reports every move that was commanded more than once, every arm that moved after an error, and every schedule that did
not end, with the state of the robot program.
"""

import asyncio
import faulthandler
import time
from collections import Counter, deque
from dataclasses import dataclass, field
from random import Random
from typing import Any

import numpy as np

from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import Configuration
from daemon.runtime.loop_monitor import EventLoopMonitor
from drivers.errors import DeviceError
from drivers.interfaces import MoveGoal
from drivers.robots.abb.cb_robot import CbRobot
from drivers.transports.tcp import TcpTransport
from drivers.transports.transport import Connection
from mock_robot.cell import MockCell, Ports
from mock_robot.faults.tables import FAULTS
from mock_robot.rapid.controller import RapidController
from mock_robot.truth.truth import CellTruth

STRIKES = tuple(name for name, fault in FAULTS.items() if fault.area in ("link", "robot"))
ARM = find_arm("IRB 1600-6/1.45")
CELLS = 12
TIME_SCALE = 30.0
REST_LIMIT_S = 12.0
SCHEDULE_LIMIT_S = 60.0
FROZEN_S = 240.0
"""When not even the limits are checked any more: print every thread's stack and exit."""
MAX_FRAMES = 12


@dataclass
class Tally:
    """Results of the schedules."""

    schedules: int = 0
    arrived: int = 0
    errors: Counter[str] = field(default_factory=Counter)
    twice: list[str] = field(default_factory=list)
    moved_afterwards: list[str] = field(default_factory=list)
    never_ended: list[str] = field(default_factory=list)

    @property
    def has_failures(self) -> bool:
        """Whether a forbidden result occurred."""
        return bool(self.twice or self.moved_afterwards or self.never_ended)

    def summary(self) -> str:
        """Summary as text."""
        ends = ", ".join(f"{count} {code}" for code, count in self.errors.most_common())
        lines = [f"schedules: {self.schedules}; {self.arrived} arrived, {ends}"]
        for what, found in (
            ("commanded more than once", self.twice),
            ("moved after an error", self.moved_afterwards),
            ("never ended", self.never_ended),
        ):
            lines += [f"  {what}: {len(found)}", *(f"    {each}" for each in found[:3])]
        return "\n".join(lines)


@dataclass
class RecordingTransport:
    """A transport that records its last pieces."""

    inner: TcpTransport
    pieces: deque[str] = field(default_factory=lambda: deque(maxlen=MAX_FRAMES))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)

    async def connect(self) -> Connection:
        """Connect the inner transport and record its traffic."""
        self.note("connects")
        return _RecordingConnection(await self.inner.connect(), self.note)

    def note(self, what: str) -> None:
        """Record a piece with its time."""
        self.pieces.append(f"{time.monotonic():.3f} {what}")


@dataclass
class _RecordingConnection:
    connection: Connection
    note: Any

    async def send(self, data: bytes) -> None:
        self.note(f"> {data.hex(' ')}")
        await self.connection.send(data)

    async def receive(self) -> bytes:
        data = await self.connection.receive()
        self.note(f"< {data.hex(' ')}")
        return data

    async def close(self) -> None:
        self.note("closes")
        await self.connection.close()


@dataclass
class Schedule:
    """One move under one to three faults; then all faults are cleared, and nothing may move again."""

    number: int
    seed: int
    cell: MockCell
    port: int
    loop: EventLoopMonitor
    stage: str = "arming"

    def __post_init__(self) -> None:
        self.random = Random(f"{self.seed} {self.number}")
        self.faults = {
            name: self.random.randint(0, 1) for name in self.random.sample(STRIKES, self.random.randint(1, 3))
        }
        self.transport = RecordingTransport(TcpTransport("127.0.0.1", self.port))

    def __str__(self) -> str:
        faults = " + ".join(f"{name}{' from the move on' if later else ''}" for name, later in self.faults.items())
        return f"schedule {self.number} of seed {self.seed}: {faults}"

    async def run(self, tally: Tally) -> bool:
        """Run; returns whether it ended, so that the cell can be used again."""
        tally.schedules += 1
        robot = CbRobot(self.transport)
        robot.start()
        try:
            async with asyncio.timeout(SCHEDULE_LIMIT_S):
                await self._ends(robot, tally)
        except (TimeoutError, DeviceError) as error:
            tally.never_ended.append(self._where_it_hangs(error))
            return False
        finally:
            await robot.close()
        return True

    async def _ends(self, robot: CbRobot, tally: Tally) -> None:
        cell = self.cell
        await _arm(robot)
        before = cell.controller.moves_accepted
        for fault, later in self.faults.items():
            cell.inject_fault(fault, after_moves=later)
        self.stage = "moving"
        failed = await _move_fails(robot, _somewhere(cell, self.random), tally)
        self.stage = "coming to rest"
        await _comes_to_rest(cell)
        cell.clear_faults()
        cell.controller.recover(cell.clock())
        cell.nudge()
        self.stage = "staying at rest"
        if failed and await _moves_by_itself(cell, robot):
            tally.moved_afterwards.append(str(self))
        if cell.controller.moves_accepted > before + 1:
            tally.twice.append(str(self))

    def _where_it_hangs(self, error: Exception) -> str:
        controller = self.cell.controller
        assert isinstance(controller, RapidController)
        names = (
            "cell_session cell_armed cell_request cell_verdict cell_done cell_done_status cell_abort cell_bell"
            " cell_moving cell_settled"
        )
        lines = [
            f"{self}: {self.stage} for more than {SCHEDULE_LIMIT_S:g} s: {error!r}",
            f"one turn of the event loop took up to {self.loop.longest().wall_s:.1f} s",
            f"{controller.panel}, settles {controller.settles}, {controller.unit}",
            ", ".join(f"{name} {controller.memory[name].value}" for name in names.split()),
            *(f"{task}: {' <- '.join(where) or 'no thread'}" for task, where in controller.whereabouts().items()),
            *(f"log {entry.code} {entry.text}" for entry in [*controller.log][-6:]),
            *self.transport.pieces,
        ]
        return "\n      ".join(lines)


async def schedules(count: int, seed: int, cells: int = CELLS) -> Tally:
    """Run several cells side by side, since a schedule mostly waits for timeouts."""
    tally = Tally()
    numbers = iter(range(count))
    loop = EventLoopMonitor()
    await loop.start()
    await asyncio.gather(*(_work(numbers, seed, tally, loop) for _ in range(min(cells, count))))
    await loop.stop()
    faulthandler.cancel_dump_traceback_later()
    return tally


async def _work(numbers: Any, seed: int, tally: Tally, loop: EventLoopMonitor) -> None:
    """Use one cell after another: a new one when a schedule has left the last one in an unusable state."""
    sound = False
    while not sound:
        sound = True
        cell = MockCell(CellTruth.from_seed(7), time_scale=TIME_SCALE, program="rapid")
        try:
            wire = await cell.start(Ports(devices=None))
            assert wire.robot_port is not None
            for number in numbers:
                faulthandler.dump_traceback_later(FROZEN_S, exit=True)
                sound = await Schedule(number, seed, cell, wire.robot_port, loop).run(tally)
                if not sound:
                    break
        finally:
            await cell.close()


async def _arm(robot: CbRobot) -> None:
    """Arm; repeated while an earlier motion is still ending."""
    while True:
        try:
            await robot.wait_for_link(30.0)
            await robot.set_armed(True)
        except DeviceError:
            await asyncio.sleep(0.2)
        else:
            return


async def _move_fails(robot: CbRobot, goal: MoveGoal, tally: Tally) -> bool:
    """Move; returns whether the move failed."""
    try:
        await robot.move_to(goal)
    except DeviceError as error:
        tally.errors[error.code] += 1
        return True
    tally.arrived += 1
    return False


async def _comes_to_rest(cell: MockCell) -> None:
    """Wait until the controller stops and disarms by itself, after two seconds of silence."""
    ends_s = time.monotonic() + REST_LIMIT_S
    while cell.controller.arm.is_moving_at(cell.controller.robot_s(cell.clock())) and time.monotonic() < ends_s:  # noqa: ASYNC110 - it happens in arm time
        await asyncio.sleep(0.02)


async def _moves_by_itself(cell: MockCell, robot: CbRobot) -> bool:
    """Whether the arm moves after the next greeting. Before it, the move may still have begun and been stopped."""
    await robot.wait_for_link(30.0)
    await _comes_to_rest(cell)
    departures = cell.controller.arm.departures
    await asyncio.sleep(0.5)
    return cell.controller.arm.departures != departures or cell.controller.arm.is_moving_at(
        cell.controller.robot_s(cell.clock())
    )


def _somewhere(cell: MockCell, random: Random) -> MoveGoal:
    joints_rad = np.radians([random.uniform(-25, 25), *(random.uniform(-12, 12) for _ in range(3)), 40, 0])
    pose = ARM.forward(joints_rad)
    return MoveGoal(pose, Configuration(*ARM.configuration(joints_rad)), speed_mm_s=250.0)

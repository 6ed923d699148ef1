"""A robot with a second way to stop, over Robot Web Services, for when its own link fails or is late."""

import asyncio
import logging
from dataclasses import dataclass, field, replace

from drivers.errors import DeviceError, DeviceTimeout, DeviceUnreachable, GarbledAnswer, LinkLost
from drivers.interfaces import LinkHealth, MoveGoal, Standstill
from drivers.robot_wrapper import RobotWrapper
from drivers.robots.abb.rws.robot import RwsRobot
from drivers.timing import Timing, retrieve_error

log = logging.getLogger(__name__)

OWN_LIMIT_S = 0.1
"""Time for the robot's own link to answer a stop. Without any stop the arm stops after 2 s of silence."""
SECOND_WAIT_S = 0.5
"""How long a move that failed waits for the second way's answer; sending it goes on."""
LINK_FAILED = (LinkLost, DeviceTimeout, DeviceUnreachable, GarbledAnswer)


@dataclass(frozen=True, eq=False)
class RedundantStop(RobotWrapper):
    """As `robot`. The second way stops the whole program, which must then be started by hand; it reads, too."""

    second: RwsRobot
    _timing: Timing
    _stopping: set[asyncio.Task[None]] = field(default_factory=set, init=False)

    @property
    def link(self) -> LinkHealth:
        """Health of the robot's own link; the detail includes the second way."""
        own, second = self.robot.link, self.second.link
        how = "there" if second.connected else f"NOT there, {second.detail}"
        return LinkHealth(own.connected, f"{own.detail}; second way to stop: {how}", own.since_s)

    def start(self) -> None:
        self.robot.start()
        self.second.start()

    async def move_to(self, goal: MoveGoal) -> None:
        """Move; a link failure on the way, or one at cancellation, stops the arm over the second way."""
        try:
            await self.robot.move_to(goal)
        except LINK_FAILED:
            await self._stop_the_second_way_whatever_happens()
            raise
        except asyncio.CancelledError:
            if not self.robot.link.connected:
                await self._stop_the_second_way_whatever_happens()
            raise

    async def stop_and_disarm(self) -> None:
        """Over the robot's own link, and over the second way when that fails or is late. Raises DeviceError."""
        own = asyncio.ensure_future(self.robot.stop_and_disarm())
        own.add_done_callback(retrieve_error)
        if await self._timing.wait_until_done(own, OWN_LIMIT_S) and own.exception() is None:
            return
        try:
            await self.second.stop_and_disarm()
        except DeviceError as error:
            log.warning("stopping the second way: %s", error)
            await own

    async def read_standstill(self) -> Standstill:
        """Over the robot's own link; while that is down, over the second way, which cannot confirm the disarming."""
        if self.robot.link.connected:
            return await self.robot.read_standstill()
        return replace(await self.second.read_standstill(), disarmed=False)

    async def close(self) -> None:
        await asyncio.gather(self.robot.close(), self.second.close())

    async def _stop_the_second_way_whatever_happens(self) -> None:
        stopping = asyncio.create_task(self._stop_the_second_way(), name="stops the second way")
        self._stopping.add(stopping)
        stopping.add_done_callback(self._stopping.discard)
        await self._timing.wait_until_done(stopping, SECOND_WAIT_S)

    async def _stop_the_second_way(self) -> None:
        try:
            await self.second.stop_and_disarm()
        except DeviceError as error:
            log.warning("stopping the second way: %s", error)

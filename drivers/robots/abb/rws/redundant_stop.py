"""A robot with a second way to stop, over Robot Web Services, for when its own link fails or is late."""

import asyncio
import logging
from dataclasses import replace

from calibration.transforms import Array
from drivers.errors import DeviceError, DeviceTimeout, DeviceUnreachable, GarbledAnswer, LinkLost
from drivers.interfaces import LinkHealth, MoveGoal, PoseReading, Robot, RobotCapabilities, RobotStatus, Standstill
from drivers.robots.abb.rws.robot import RwsRobot
from drivers.timing import Timing

log = logging.getLogger(__name__)

OWN_LIMIT_S = 0.1
"""Time for the robot's own link to answer a stop. Without any stop the arm stops after 2 s of silence."""
SECOND_WAIT_S = 0.5
"""How long a move that failed waits for the second way's answer; sending it goes on."""
LINK_FAILED = (LinkLost, DeviceTimeout, DeviceUnreachable, GarbledAnswer)


class RedundantStop:
    """drivers.interfaces.Robot. The second way stops the whole program, which must then be started by hand."""

    def __init__(self, robot: Robot, second: RwsRobot, timing: Timing) -> None:
        self._robot, self._second, self._timing = robot, second, timing
        self._stopping: set[asyncio.Task[None]] = set()

    @property
    def robot(self) -> Robot:
        """The robot over its own link."""
        return self._robot

    @property
    def second(self) -> RwsRobot:
        """The second way to stop, which reads, too."""
        return self._second

    @property
    def link(self) -> LinkHealth:
        """Health of the robot's own link; the detail includes the second way."""
        own, second = self._robot.link, self._second.link
        how = "there" if second.connected else f"NOT there, {second.detail}"
        return LinkHealth(own.connected, f"{own.detail}; second way to stop: {how}", own.since_s)

    @property
    def capabilities(self) -> RobotCapabilities:
        """Capabilities of the robot's own link."""
        return self._robot.capabilities

    def start(self) -> None:
        """Start both links."""
        self._robot.start()
        self._second.start()

    async def read_pose(self) -> PoseReading:
        """Over the robot's own link."""
        return await self._robot.read_pose()

    async def read_joints(self) -> Array:
        """Axis angles (6,) in rad."""
        return await self._robot.read_joints()

    async def read_status(self) -> RobotStatus:
        """Over the robot's own link."""
        return await self._robot.read_status()

    async def set_armed(self, armed: bool) -> None:
        """Over the robot's own link."""
        await self._robot.set_armed(armed)

    async def move_to(self, goal: MoveGoal) -> None:
        """Move; a link failure on the way, or one at cancellation, stops the arm over the second way."""
        try:
            await self._robot.move_to(goal)
        except LINK_FAILED:
            await self._stop_the_second_way_whatever_happens()
            raise
        except asyncio.CancelledError:
            if not self._robot.link.connected:
                await self._stop_the_second_way_whatever_happens()
            raise

    async def stop_and_disarm(self) -> None:
        """Over the robot's own link, and over the second way when that fails or is late. Raises DeviceError."""
        own = asyncio.ensure_future(self._robot.stop_and_disarm())
        own.add_done_callback(_retrieve)
        if await self._timing.wait_until_done(own, OWN_LIMIT_S) and own.exception() is None:
            return
        try:
            await self._second.stop_and_disarm()
        except DeviceError as error:
            log.warning("stopping the second way: %s", error)
            await own

    async def read_standstill(self) -> Standstill:
        """Over the robot's own link; while that is down, over the second way, which cannot confirm the disarming."""
        if self._robot.link.connected:
            return await self._robot.read_standstill()
        return replace(await self._second.read_standstill(), disarmed=False)

    async def close(self) -> None:
        """Close both links."""
        await asyncio.gather(self._robot.close(), self._second.close())

    async def _stop_the_second_way_whatever_happens(self) -> None:
        stopping = asyncio.create_task(self._stop_the_second_way(), name="stops the second way")
        self._stopping.add(stopping)
        stopping.add_done_callback(self._stopping.discard)
        await self._timing.wait_until_done(stopping, SECOND_WAIT_S)

    async def _stop_the_second_way(self) -> None:
        try:
            await self._second.stop_and_disarm()
        except DeviceError as error:
            log.warning("stopping the second way: %s", error)


def _retrieve(own: "asyncio.Future[None]") -> None:
    """Retrieve a late error, so that asyncio does not log it."""
    if not own.cancelled():
        own.exception()

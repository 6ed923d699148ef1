"""A robot that checks the cell's interlocks before arming and before each move."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from calibration.transforms import Array
from drivers.errors import InterlockRefused
from drivers.interfaces import LinkHealth, MoveGoal, PoseReading, Robot, RobotCapabilities, RobotStatus, Standstill

if TYPE_CHECKING:
    from drivers.interlocks import Interlocks

FIX = "close the gate, put the part in; or correct [interlocks] in the settings"


@dataclass(frozen=True)
class InterlockedRobot:
    """As `robot`; arming and moving raise InterlockRefused when an interlock does not allow motion."""

    robot: Robot
    interlocks: "Interlocks"

    @property
    def link(self) -> LinkHealth:
        return self.robot.link

    @property
    def capabilities(self) -> RobotCapabilities:
        return self.robot.capabilities

    def start(self) -> None:
        self.robot.start()

    async def read_pose(self) -> PoseReading:
        return await self.robot.read_pose()

    async def read_joints(self) -> Array:
        """Axis angles (6,) in rad."""
        return await self.robot.read_joints()

    async def read_status(self) -> RobotStatus:
        return await self.robot.read_status()

    async def set_armed(self, armed: bool) -> None:
        if armed:
            await self._require_interlocks()
        await self.robot.set_armed(armed)

    async def move_to(self, goal: MoveGoal) -> None:
        await self._require_interlocks()
        await self.robot.move_to(goal)

    async def stop_and_disarm(self) -> None:
        await self.robot.stop_and_disarm()

    async def read_standstill(self) -> Standstill:
        return await self.robot.read_standstill()

    async def close(self) -> None:
        await self.interlocks.close()
        await self.robot.close()

    async def _require_interlocks(self) -> None:
        closed = [reading for reading in await self.interlocks.readings() if not reading.allows]
        if closed:
            what = "; ".join(f"{reading.name} {reading.why}" for reading in closed)
            names = tuple(reading.name for reading in closed)
            raise InterlockRefused(f"interlocks {self.interlocks.address}", what, FIX, names)

"""A robot around another one, for wrappers that change some of what it does."""

from dataclasses import dataclass

from calibration.transforms import Array
from drivers.interfaces import LinkHealth, MoveGoal, PoseReading, Robot, RobotCapabilities, RobotStatus, Standstill


@dataclass(frozen=True, eq=False)
class RobotWrapper:
    """drivers.interfaces.Robot, as `robot` in everything that a subclass does not change."""

    robot: Robot

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
        return await self.robot.read_joints()

    async def read_status(self) -> RobotStatus:
        return await self.robot.read_status()

    async def set_armed(self, armed: bool) -> None:
        await self.robot.set_armed(armed)

    async def move_to(self, goal: MoveGoal) -> None:
        await self.robot.move_to(goal)

    async def stop_and_disarm(self) -> None:
        await self.robot.stop_and_disarm()

    async def read_standstill(self) -> Standstill:
        return await self.robot.read_standstill()

    async def close(self) -> None:
        await self.robot.close()

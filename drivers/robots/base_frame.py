"""A robot whose controller gives poses in the world frame, seen in its base frame."""

from dataclasses import dataclass, replace
from typing import Any

from calibration.transforms import Array, inverse
from drivers.interfaces import ConfiguredRobot, MoveGoal, PoseReading, Robot, RobotCapabilities
from drivers.robot_wrapper import RobotWrapper


@dataclass(frozen=True, eq=False)
class RobotInBaseFrame(RobotWrapper):
    """As `robot`, with poses in the base frame; `world_T_base` (4, 4): where it stands in the controller's world."""

    world_T_base: Array

    @property
    def capabilities(self) -> RobotCapabilities:
        return self.robot.capabilities._replace(pose_frame="base")

    async def read_pose(self) -> PoseReading:
        reading = await self.robot.read_pose()
        return replace(reading, base_T_flange=inverse(self.world_T_base) @ reading.base_T_flange)

    async def move_to(self, goal: MoveGoal) -> None:
        await self.robot.move_to(replace(goal, base_T_flange=self.world_T_base @ goal.base_T_flange))


def configured(robot: Robot) -> ConfiguredRobot | None:
    """The robot with settings behind wrappers; None for one that has none, as over Robot Web Services."""
    while not isinstance(robot, ConfiguredRobot):
        inner = getattr(robot, "robot", None)
        if inner is None:
            return None
        robot = inner
    return robot


async def read_base_frame(robot: Robot) -> Array | None:
    """world_T_base (4, 4) as the controller is configured, over Robot Web Services; None where it is not read.

    Raises DeviceError.
    """
    inner: Any = robot
    while inner is not None:
        for reader in (inner, getattr(inner, "second", None)):
            read = getattr(reader, "read_base_frame", None)
            if read is not None:
                frame: Array = await read()
                return frame
        inner = getattr(inner, "robot", None)
    return None

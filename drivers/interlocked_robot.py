"""A robot that checks the cell's interlocks before arming and before each move."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.errors import InterlockRefused
from drivers.interfaces import MoveGoal
from drivers.robot_wrapper import RobotWrapper

if TYPE_CHECKING:
    from drivers.interlocks import Interlocks

FIX = "close the gate, put the part in; or correct [interlocks] in the settings"


@dataclass(frozen=True, eq=False)
class InterlockedRobot(RobotWrapper):
    """As `robot`; arming and moving raise InterlockRefused when an interlock does not allow motion."""

    interlocks: "Interlocks"

    async def set_armed(self, armed: bool) -> None:
        if armed:
            await self._require_interlocks()
        await self.robot.set_armed(armed)

    async def move_to(self, goal: MoveGoal) -> None:
        await self._require_interlocks()
        await self.robot.move_to(goal)

    async def close(self) -> None:
        await self.interlocks.close()
        await self.robot.close()

    async def _require_interlocks(self) -> None:
        closed = [reading for reading in await self.interlocks.readings() if not reading.allows]
        if closed:
            what = "; ".join(f"{reading.name} {reading.why}" for reading in closed)
            names = tuple(reading.name for reading in closed)
            raise InterlockRefused(f"interlocks {self.interlocks.address}", what, FIX, names)

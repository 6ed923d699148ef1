"""drivers.interfaces.Robot over Robot Web Services: reads everything, can stop the program, never moves."""

import asyncio
from typing import Literal, NoReturn

from calibration.transforms import Array
from drivers.errors import MoveRefused, RequestRefused
from drivers.interfaces import MoveGoal, PoseReading, RobotCapabilities, RobotStatus, Standstill
from drivers.robots.abb.controller_link import LinkedRobot
from drivers.robots.abb.robtarget import POSE_CONVENTION
from drivers.robots.abb.rws import parsing
from drivers.robots.abb.rws.address import FRAMES, RwsAddress
from drivers.robots.abb.rws.client import LIMIT_S, RwsClient
from drivers.robots.abb.rws.link import RwsLink
from drivers.robots.abb.rws.parsing import ControllerState, EventLogEntry
from drivers.timing import Timing

STILL_GAP_S = 0.1
READ_ONLY = "over Robot Web Services the arm is read, not moved"
INSTEAD = "take the pictures by hand (handeyed calibrate --manual), or set [robot] address to the CB link, tcp://..."


class RwsRobot(LinkedRobot):
    """Raises DeviceUnreachable before `start` and while disconnected."""

    def __init__(
        self,
        address: RwsAddress,
        timing: Timing | None = None,
        name: str = "robot",
        *,
        limit_s: float | None = None,
        axes: int = 6,
    ) -> None:
        self._device = f"{name} {address.address}"
        self._address, self._axes = address, axes
        self._timing = timing or Timing()
        self._client = RwsClient(self._device, address, self._timing, LIMIT_S if limit_s is None else limit_s)
        self._link: RwsLink = RwsLink(self._client, self._timing)

    @property
    def capabilities(self) -> RobotCapabilities:
        """Can be read and stopped, not moved."""
        frame: Literal["base", "world"] = "base" if self._address.frame == "base" else "world"
        return RobotCapabilities(moves=False, pose_convention=POSE_CONVENTION, pose_frame=frame)

    # --- reading ---

    async def read_pose(self) -> PoseReading:
        """Pose of tool0 in wobj0. Two reads 100 ms apart determine `still`."""
        before = await self._pose()
        await self._timing.sleep(STILL_GAP_S)
        return await self._pose(before)

    async def read_base_frame(self) -> Array:
        """world_T_base (4, 4): the base frame that the controller is configured with."""
        path = f"/rw/motionsystem/mechunits/{self._address.mechunit}/baseframe"
        return parsing.frame(self._device, await self._link.one(path))

    async def read_joints(self) -> Array:
        values = await self._link.one(f"/rw/motionsystem/mechunits/{self._address.mechunit}/jointtarget")
        return parsing.joints_rad(self._device, values, self._axes)

    async def read_state(self) -> ControllerState:
        """Panel, program and speed ratio in the controller's words."""
        return await self._link.read_state()

    async def read_status(self) -> RobotStatus:
        """State of the panel, and whether the arm moved within 100 ms."""
        asked_at_s = self._timing.clock()
        state, pose = await asyncio.gather(self.read_state(), self.read_pose())
        return parsing.status(state, not pose.still, asked_at_s)

    async def read_event_log(self) -> tuple[EventLogEntry, ...]:
        """Newest entries of the common log, newest first."""
        items = await self._client.get_event_log()
        return tuple(parsing.log_entry(self._device, item) for item in items)

    # --- acting ---

    async def stop_and_disarm(self) -> None:
        """Stop the program now, also when the controller seems unreachable. Over RWS nothing is armed."""
        dialect = await self._client.find()
        path, query = dialect.call("stop")
        await self._client.post(path, query, {"stopmode": "stop"}, urgent=True)

    async def read_standstill(self) -> Standstill:
        """Standing: the program is stopped, and two poses 100 ms apart agree."""
        execution = await self._link.read_execution(urgent=True)
        before = await self._pose(urgent=True)
        await self._timing.sleep(STILL_GAP_S)
        after = await self._pose(before, urgent=True)
        return Standstill(standing=after.still and execution != "running", disarmed=True)

    async def set_armed(self, armed: bool) -> None:
        """Disarming has no effect; arming raises RequestRefused."""
        if armed:
            raise RequestRefused(self._device, f"arming was refused, {READ_ONLY}", INSTEAD, "READ_ONLY")

    async def move_to(self, goal: MoveGoal) -> NoReturn:
        """Raises MoveRefused."""
        raise MoveRefused(self._device, f"the move was refused, {READ_ONLY}", INSTEAD, "READ_ONLY")

    async def _pose(self, before: PoseReading | None = None, *, urgent: bool = False) -> PoseReading:
        asked_at_s = self._timing.clock()
        query = {"tool": "tool0", "wobj": "wobj0", "coordinate": FRAMES[self._address.frame]}
        path = f"/rw/motionsystem/mechunits/{self._address.mechunit}/robtarget"
        values = await self._link.one(path, query, urgent=urgent)
        now = parsing.pose(self._device, values, asked_at_s, self._axes)
        return parsing.with_standstill(before, now) if before is not None else now

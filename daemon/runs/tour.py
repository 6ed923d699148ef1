"""Drive the arm through stations, and do something at each while it stands."""

from collections.abc import Awaitable, Callable

from daemon.cell.cell import Cell
from daemon.cell.motion_rules import MotionRules
from daemon.cell.settling import require_arrived
from daemon.config.settings import TaughtPose
from daemon.model.run_states import RunEvent as E
from daemon.runs.run_log import RunLog
from drivers.interfaces import PoseReading

AtStation = Callable[[PoseReading], Awaitable[None]]


async def tour(
    stations: tuple[TaughtPose, ...], cell: Cell, rules: MotionRules, log: RunLog, at_station: AtStation, last: E | None
) -> None:
    """Move, settle, `at_station`, for each; `last` is the event after the last one, None when the run ends there.

    The arm is armed on entry, and left stopped and disarmed. Raises DeviceError, DaemonError, and what `at_station`
    raises.
    """
    async with cell.motion_lease(f"run {log.id}") as robot:
        for station, pose in enumerate(stations, start=1):
            goal = await rules.goal(station, pose, robot)
            await cell.move_to(goal)
            await log.took(E.ARRIVED)
            reading = await cell.settled_pose()
            require_arrived(goal.base_T_flange, reading)
            await log.took(E.SETTLED)
            await at_station(reading)
            event = E.CAPTURED if station < len(stations) else last
            if event is not None:
                await log.took(event)

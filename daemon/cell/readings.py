"""What readers see of the cell: each reading is shared among all who ask within 0.1 s."""

from dataclasses import dataclass

from calibration.transforms import Array
from daemon.cell.cell import Cell
from daemon.runtime.clock import Clock
from daemon.runtime.shared_reading import RecentReading, SharedReading
from drivers.errors import RequestRefused
from drivers.interfaces import PoseReading, Robot, RobotSetup, RobotStatus
from drivers.robots.base_frame import configured


@dataclass(frozen=True, eq=False)
class RobotReading:
    """Status, pose and axis angles (6,) in rad, read one after the other."""

    status: RobotStatus
    pose: PoseReading
    joints: Array


class CellReadings:
    """Readings for GET requests: however many clients ask, the devices answer ten times a second at most."""

    def __init__(self, cell: Cell, clock: Clock) -> None:
        self._cell = cell
        self.robot = RecentReading(self._read_robot, clock.monotonic_s)
        self.setup = RecentReading(lambda: read_setup(cell.robot), clock.monotonic_s)
        self.settled_pose = SharedReading(cell.read_settled_pose)
        """Pose and joints at rest, read after the call; who ask at once share it."""

    async def _read_robot(self) -> RobotReading:
        robot = self._cell.robot
        return RobotReading(await robot.read_status(), await robot.read_pose(), await robot.read_joints())


async def read_setup(robot: Robot) -> RobotSetup | None:
    """Settings of the robot's program; None where there is none, or one that does not give them."""
    program = configured(robot)
    if program is None:
        return None
    try:
        return await program.read_setup()
    except RequestRefused:
        return None

"""Schema of the robot's state. Lengths mm, angles deg, quaternions scalar first."""

from calibration.documents.pose import PoseDocument
from daemon.api.schemas.answer import Answer


class RobotDocument(Answer):
    """The pose of the arm and the status of the controller."""

    connected: bool
    detail: str
    base_T_flange: PoseDocument
    configuration: tuple[int, int, int, int]
    joints_deg: list[float]
    still: bool
    motors_on: bool
    automatic: bool
    emergency_stop: bool
    moving: bool
    armed: bool
    program_running: bool
    speed_limited: bool
    held_by: str | None

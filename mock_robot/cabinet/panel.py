"""Switches of a controller cabinet, and the motion each position forbids."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from calibration.transforms import Array, quaternion_from_rotation
from mock_robot.errors import NoSuchState
from protocols.cb.codes import Status
from protocols.egm.messages import RobotSample


class Mode(Enum):
    """Operating mode: automatic, manual reduced speed, manual full speed."""

    AUTO = "AUTO"
    MANR = "MANR"
    MANF = "MANF"

    @classmethod
    def from_name(cls, name: str) -> "Mode":
        """The mode called `name`; raises NoSuchState."""
        try:
            return cls(name.upper())
        except ValueError:
            raise NoSuchState("mode", name, tuple(mode.value for mode in cls)) from None


@dataclass
class Panel:
    """Switch positions. `speed_override` of the pendant, 0 to 1. `cycle`: forever, or once and then stopped."""

    motors_on: bool = True
    mode: Mode = Mode.AUTO
    emergency_stop: bool = False
    program_running: bool = True
    speed_override: float = 1.0
    cycle: str = "forever"

    def forbids_motion(self) -> Status | None:
        return next((status for forbidden, status in _FORBIDDEN if forbidden(self)), None)


_FORBIDDEN: tuple[tuple[Callable[[Panel], bool], Status], ...] = (
    (lambda panel: panel.emergency_stop, Status.ESTOP),
    (lambda panel: not panel.motors_on, Status.MOTORS_OFF),
    (lambda panel: panel.mode is Mode.MANF, Status.WRONG_MODE),
    (lambda panel: not panel.program_running, Status.WRONG_MODE),
)


def robot_sample(seqno: int, now_s: float, joints_rad: Array, pose: Array, panel: Panel) -> RobotSample:
    """What EGM says of a moment: joints and pose (4, 4) in single precision, as the controller sends them."""
    w, i, j, k, x, y, z = (float(np.float32(v)) for v in (*quaternion_from_rotation(pose[:3, :3]), *pose[:3, 3]))
    return RobotSample(
        seqno=seqno,
        robot_ms=int(now_s * 1000) % 2**32,
        joints_deg=tuple(float(np.float32(angle)) for angle in np.degrees(joints_rad)),
        position_mm=(x, y, z),
        quaternion_wxyz=(w, i, j, k),
        time_us=int(now_s * 1e6),
        motors_on=panel.motors_on,
        program_running=panel.program_running,
    )

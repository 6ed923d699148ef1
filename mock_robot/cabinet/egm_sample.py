"""What the controller's EGM says of a moment."""

import numpy as np

from calibration.transforms import Array, quaternion_from_rotation
from mock_robot.cabinet.panel import Panel
from protocols.egm.messages import RobotSample


def robot_sample(seqno: int, now_s: float, joints_rad: Array, pose: Array, panel: Panel) -> RobotSample:
    """Joints and pose (4, 4) in single precision, as the controller sends them."""
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

"""Compares the flange's pose by the arm's axes with the one the controller reports: base frame, model, track."""

from dataclasses import dataclass

import numpy as np

from calibration.kinematics.seven_axes import AnyArm
from calibration.transforms import Array, difference, inverse
from drivers.interfaces import PoseReading

MAX_OFF_MM, MAX_OFF_RAD = 10.0, np.radians(2.0)
"""Limits of the difference; calibrated arms have 1 mm and 0.1 deg."""
MAX_TILT_RAD = np.radians(2.0)
USED_AXIS = 8.9e9
"""External axes at or above this do not exist."""


@dataclass(frozen=True, eq=False)
class FrameDifference:
    """`reported_T_base` (4, 4): where the base stands in the frame of the reported poses. `what`, `fix`: sentences."""

    reported_T_base: Array
    off_mm: float
    off_rad: float
    what: str = ""
    fix: str = ""

    @property
    def agrees(self) -> bool:
        """Whether reported poses are in the base frame of this arm."""
        return self.off_mm <= MAX_OFF_MM and self.off_rad <= MAX_OFF_RAD


def frame_difference(arm: AnyArm, joints_rad: Array, here: PoseReading) -> FrameDifference:
    """Compare FK of joints (6,) or (7,) with the pose read at the same place."""
    base_T_flange = arm.forward(joints_rad)
    off_mm, off_rad = difference(base_T_flange, here.base_T_flange)
    found = FrameDifference(here.base_T_flange @ inverse(base_T_flange), off_mm, off_rad)
    if found.agrees:
        return found
    cause, fix = _cause(found.reported_T_base, here.external_axes)
    what = (
        f"by the axes of {arm.name} the flange is {off_mm:.0f} mm and {np.degrees(off_rad):.1f} deg from where the"
        f" controller reports it; likely cause: {cause}"
    )
    return FrameDifference(found.reported_T_base, off_mm, off_rad, what, fix)


def _cause(reported_T_base: Array, external_axes: tuple[float, ...]) -> tuple[str, str]:
    """Likely cause and remedy, from where the base would stand in the frame of the reported poses."""
    x, y, z = (float(value) for value in reported_T_base[:3, 3])
    up = float(np.clip(reported_T_base[2, 2], -1.0, 1.0))
    stands = f"at ({x:.0f}, {y:.0f}, {z:.0f}) mm"
    frame = "set [robot] base_frame to base_frame_pos and _orient of the controller's MOC.cfg"
    moved = [value for value in external_axes if abs(value) > 1.0 and value < USED_AXIS]
    if up < -np.cos(np.radians(30.0)):
        return f"the arm hangs upside down, its base {stands} in the world frame", frame
    if np.arccos(up) > MAX_TILT_RAD:
        return f"the base is tilted by {np.degrees(np.arccos(up)):.0f} deg, {stands} in the world frame", frame
    if moved:
        axes = ", ".join(f"{value:.0f}" for value in moved)
        return (
            f"the base rides on a track (external axes at {axes}) and stands {stands} in the world frame",
            "keep the track still while calibrating, and set [robot] base_frame for where it stands then",
        )
    turn = np.degrees(np.arctan2(reported_T_base[1, 0], reported_T_base[0, 0]))
    return (
        f"the base stands {stands}, turned by {turn:.0f} deg, in the world frame (a pedestal), or another arm is meant",
        f"{frame}, or correct [robot] model",
    )

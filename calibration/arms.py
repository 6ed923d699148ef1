"""Published arms by name.

IRB 1600: ABB data sheet and product specification 3HAC023604-001 as modelled in ros-industrial/abb_experimental,
abb_irb1600_support/urdf/irb1600_8_145_macro.xacro (lengths and limits of every 1.45 m variant) and
irb1600_6_12_macro.xacro (1.2 m; its axis speeds are those of the 6 kg drives and are used for -6/1.45, too).
The lengths agree with RobotComponents' preset IRB1600-6/1.45, which lists the narrower 1.2 m limits for axes 2 and 3.
IRB 120: the same repository, abb_irb120_support/urdf/irb120_3_58_macro.xacro.
"""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from calibration.arm import Arm
from calibration.errors import GeometryError


def _radians(*degrees: float) -> tuple[float, ...]:
    return tuple(float(angle) for angle in np.radians(degrees))


IRB_1600_6_145 = Arm(
    name="IRB 1600-6/1.45",
    shoulder_forward_mm=150.0,
    shoulder_height_mm=486.5,
    lower_arm_mm=700.0,
    elbow_up_mm=0.0,
    forearm_mm=600.0,
    flange_mm=65.0,
    lower_rad=_radians(-180, -90, -245, -200, -115, -400),
    upper_rad=_radians(180, 120, 65, 200, 115, 400),
    speed_rad_s=_radians(150, 160, 170, 320, 400, 450),
)

IRB_1600_6_12 = Arm(
    name="IRB 1600-6/1.2",
    shoulder_forward_mm=150.0,
    shoulder_height_mm=486.5,
    lower_arm_mm=475.0,
    elbow_up_mm=0.0,
    forearm_mm=600.0,
    flange_mm=65.0,
    lower_rad=_radians(-180, -63, -235, -200, -115, -400),
    upper_rad=_radians(180, 110, 55, 200, 115, 400),
    speed_rad_s=_radians(150, 160, 170, 320, 400, 450),
)

IRB_120_3_06 = Arm(
    name="IRB 120-3/0.6",
    shoulder_forward_mm=0.0,
    shoulder_height_mm=290.0,
    lower_arm_mm=270.0,
    elbow_up_mm=70.0,
    forearm_mm=302.0,
    flange_mm=72.0,
    lower_rad=_radians(-165, -110, -110, -160, -120, -400),
    upper_rad=_radians(165, 110, 70, 160, 120, 400),
    speed_rad_s=_radians(250, 250, 250, 320, 320, 420),
)

ARMS: Mapping[str, Arm] = MappingProxyType({arm.name: arm for arm in (IRB_1600_6_145, IRB_1600_6_12, IRB_120_3_06)})


def arm_named(name: str) -> Arm:
    """The arm of that name; raises GeometryError listing the known ones."""
    try:
        return ARMS[name]
    except KeyError:
        raise GeometryError(f"no arm is named {name!r}; known are {', '.join(ARMS)}") from None

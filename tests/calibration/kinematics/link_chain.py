"""Arms for tests, and an independent chain of links that says where their flange is."""

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import Arm
from calibration.transforms import Array, transform

LARGE = find_arm("IRB 1600-6/1.45")
SMALL = find_arm("IRB 120-3/0.6")
DIFFERENT = [
    SMALL,
    LARGE,
    *map(find_arm, ("IRB 1100-4/0.58", "IRB 2600-12/1.85", "IRB 6650S-90/3.9", "IRB 7600-150/3.5")),
]
"""Without and with a shoulder and an elbow set off; the widest, and the narrowest limits."""


def joints_of(arm: Arm) -> st.SearchStrategy[Array]:
    ranges = [st.floats(low, high) for low, high in zip(arm.lower_rad, arm.upper_rad, strict=True)]
    return st.tuples(*ranges).map(np.array)


def urdf_chain(arm: Arm, joints: Array) -> Array:
    """Link after link as a URDF states it: offset in the parent, turn about the axis, tool0 turned by 90° about y."""
    links = [
        ((0, 0, 0), "z"),
        ((arm.shoulder_forward_mm, 0, arm.shoulder_height_mm), "y"),
        ((0, 0, arm.lower_arm_mm), "y"),
        ((0, 0, arm.elbow_up_mm), "x"),
        ((arm.forearm_mm, 0, 0), "y"),
        ((arm.flange_mm, 0, arm.wrist_offset_mm), "x"),
    ]
    base_T_link = np.eye(4)
    for (offset, axis), angle in zip(links, joints, strict=True):
        base_T_link = base_T_link @ transform(Rotation.from_euler(axis, angle).as_matrix(), offset)
    return base_T_link @ transform(Rotation.from_euler("y", np.pi / 2).as_matrix(), np.zeros(3))

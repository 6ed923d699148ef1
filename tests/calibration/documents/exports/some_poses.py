"""Three poses of an IRB 1600."""

import numpy as np

from calibration.kinematics.abb_arms import find_arm

ARM = find_arm("IRB 1600-6/1.45")
JOINTS_DEG = np.array([[0, 10, 5, 0, 60, 0], [20, 5, 10, 30, 50, -40], [-25, 15, 0, -35, 70, 20]], float)
POSES = np.stack([ARM.forward(np.radians(joints)) for joints in JOINTS_DEG])

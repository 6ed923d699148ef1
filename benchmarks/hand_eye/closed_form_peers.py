"""Common closed-form methods as `poses -> mount_T_camera`: OpenCV's where available, otherwise ours.

They get the target poses a careful user would compute: refined on all corners, with intrinsics given or estimated over
all views.
"""

from collections.abc import Callable
from typing import Protocol

import cv2
import numpy as np

from calibration.closed_forms.registry import CLOSED_FORMS
from calibration.transforms import Array, inverse, transform


class Poses(Protocol):
    """Input of the methods: a prepared session, or one given as poses (n, 4, 4)."""

    @property
    def anchor_T_mount(self) -> Array:
        """base_T_flange, or flange_T_base"""

    @property
    def camera_T_target(self) -> Array:
        """Of every view."""


Method = Callable[[Poses], Array]
HAND_EYE = ("TSAI", "PARK", "HORAUD", "ANDREFF", "DANIILIDIS")
OPENCV_HAS_THEM = hasattr(cv2, "calibrateHandEye") and hasattr(cv2, "calibrateRobotWorldHandEye")


def opencv_methods() -> dict[str, Method]:
    """OpenCV's five, its Shah and its Li; Andreff and Li have no counterpart here."""
    if OPENCV_HAS_THEM:
        methods = {f"cv2 {name.lower()}": _hand_eye(getattr(cv2, f"CALIB_HAND_EYE_{name}")) for name in HAND_EYE}
        return methods | {"cv2 shah": _robot_world("SHAH"), "cv2 li": _robot_world("LI")}
    return {name: own(name) for name in ("tsai", "park", "horaud", "daniilidis", "shah")}


def whose() -> str:
    """Sentence on the origin of the methods, for a table's heading."""
    if OPENCV_HAS_THEM:
        return f"the methods are OpenCV {cv2.__version__}'s own functions"
    return (
        f"OpenCV {cv2.__version__} has no calibrateHandEye: our own closed forms stand for its methods"
        " (`make test-opencv4` runs the real ones)"
    )


def own(name: str) -> Method:
    """A closed form of this project."""
    return lambda poses: CLOSED_FORMS[name](poses.anchor_T_mount, poses.camera_T_target)


def _hand_eye(method: int) -> Method:
    def solve(poses: Poses) -> Array:
        mount, camera = poses.anchor_T_mount, poses.camera_T_target
        rotation, translation = cv2.calibrateHandEye(*_stacks(mount), *_stacks(camera), method=method)
        return transform(rotation, np.ravel(translation))

    return solve


def _robot_world(name: str) -> Method:
    method = getattr(cv2, f"CALIB_ROBOT_WORLD_HAND_EYE_{name}")

    def solve(poses: Poses) -> Array:
        # cam2gripper = inverse(gripper2cam), the last two of base2world R, t and gripper2cam R, t.
        found = cv2.calibrateRobotWorldHandEye(
            *_stacks(poses.camera_T_target), *_stacks(inverse(poses.anchor_T_mount)), method=method
        )
        return inverse(transform(found[2], np.ravel(found[3])))

    return solve


def _stacks(poses: Array) -> tuple[list[Array], list[Array]]:
    return list(poses[:, :3, :3]), list(poses[:, :3, 3])

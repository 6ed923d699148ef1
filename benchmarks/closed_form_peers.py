"""The methods everybody uses, as `Prepared -> mount_T_camera`: OpenCV's where it has them, else ours in their place.

They get the poses of the target that a careful user would feed them: refined on all corners, with the intrinsics
given or estimated over all views.
"""

from collections.abc import Callable

import cv2
import numpy as np

from calibration.closed_forms.registry import CLOSED_FORMS
from calibration.prepare import Prepared
from calibration.transforms import Array, inverse, transform

Method = Callable[[Prepared], Array]
HAND_EYE = ("TSAI", "PARK", "HORAUD", "ANDREFF", "DANIILIDIS")
OPENCV_HAS_THEM = hasattr(cv2, "calibrateHandEye") and hasattr(cv2, "calibrateRobotWorldHandEye")


def opencv_methods() -> dict[str, Method]:
    """OpenCV's five and its Shah; Andreff has no counterpart of ours."""
    if OPENCV_HAS_THEM:
        methods = {f"cv2 {name.lower()}": _hand_eye(getattr(cv2, f"CALIB_HAND_EYE_{name}")) for name in HAND_EYE}
        return methods | {"cv2 shah": _robot_world}
    return {name: own(name) for name in ("tsai", "park", "horaud", "daniilidis", "shah")}


def whose() -> str:
    """One sentence for the head of a table."""
    if OPENCV_HAS_THEM:
        return f"the methods are OpenCV {cv2.__version__}'s own functions"
    return (
        f"OpenCV {cv2.__version__} has no calibrateHandEye: our own closed forms stand for its methods"
        " (`make test-opencv4` runs the real ones)"
    )


def own(name: str) -> Method:
    """A closed form of ours."""
    return lambda prepared: CLOSED_FORMS[name](prepared.anchor_T_mount, prepared.camera_T_target)


def _hand_eye(method: int) -> Method:
    def solve(prepared: Prepared) -> Array:
        mount, camera = prepared.anchor_T_mount, prepared.camera_T_target
        rotation, translation = cv2.calibrateHandEye(*_stacks(mount), *_stacks(camera), method=method)
        return transform(rotation, np.ravel(translation))

    return solve


def _robot_world(prepared: Prepared) -> Array:
    # cam2gripper = inverse(gripper2cam), the last two of base2world R, t and gripper2cam R, t.
    found = cv2.calibrateRobotWorldHandEye(
        *_stacks(prepared.camera_T_target),
        *_stacks(inverse(prepared.anchor_T_mount)),
        method=cv2.CALIB_ROBOT_WORLD_HAND_EYE_SHAH,
    )
    return inverse(transform(found[2], np.ravel(found[3])))


def _stacks(poses: Array) -> tuple[list[Array], list[Array]]:
    return list(poses[:, :3, :3]), list(poses[:, :3, 3])

"""rig.json of the fake cell: its camera, and a scanner beside it."""

from typing import Any

import numpy as np

from calibration.documents.pose import PoseDocument
from calibration.transforms import transform_from_vector
from tests.daemon.fakes import FLANGE_T_CAMERA

SCANNER = transform_from_vector([0.2, -0.1, 0.4, 30.0, 60.0, -20.0])
KNOWN = {"translation_mm": [0.1] * 3, "rotation_deg": [0.01] * 3, "expanded_mm": 0.2,
         "covariance": np.diag([1e-7] * 3 + [0.01] * 3).tolist()}  # fmt: skip


def a_rig(*, accepted: bool = True, setup: str = "eye-in-hand", shift_mm: float = 0.0) -> dict[str, Any]:
    """rig.json of a camera and a scanner on the flange."""
    poses = {"camera": FLANGE_T_CAMERA, "scanner": transform_from_vector([0, 0, 0, shift_mm, 0, 0]) @ SCANNER}
    sensors = [
        {"name": name, "views": 6, "mount_T_sensor": PoseDocument.of(pose).model_dump(mode="json"),
         "uncertainty": KNOWN, "alone_expanded_mm": 0.3, "probability": 0.5}
        for name, pose in poses.items()
    ]  # fmt: skip
    pose = PoseDocument.of(np.eye(4)).model_dump(mode="json")
    finding = {"code": "rig-uncertain", "severity": "error", "message": "U is 3 mm", "fix": "add views"}
    return {
        "schema_version": 1, "setup": setup, "mount": "flange", "sensors": sensors,
        "relative": [{"a": "camera", "b": "scanner", "a_T_b": pose, "uncertainty": KNOWN}], "anchor_T_target": pose,
        "robot_translation_mm": 0.1, "robot_rotation_deg": 0.01, "stations": 6, "shared_stations": 6,
        "tolerance_mm": 1.0, "verdict": {"accepted": accepted, "findings": [] if accepted else [finding]},
    }  # fmt: skip

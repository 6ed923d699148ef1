"""The single-arm YuMi: poses taught with their arm angles are taken again, and X comes out beside the truth."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.kinematics.seven_axes import IRB_14050
from calibration.transforms import Array, difference, inverse, rotation_from_vector, transform
from daemon.config.settings import TaughtPose
from mock_robot.truth.score import score_calibration
from mock_robot.truth.truth import CellTruth
from tests.mock_robot.running_cell import running_cell
from tests.stories.plant import daemon_for, small_pictures
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

TARGET_MM = (360.0, 0.0, -150.0)
"""The target's middle: below the arm, which reaches 0.56 m."""
NEARER_MM = 150.0
"""Between the two distances: from one the focal length and the target's size trade off."""

TURNS_DEG = [
    (0, 0, 0),
    (18, 0, 30),
    (-18, 0, -30),
    (0, 18, 45),
    (0, -18, 0),
    (12, 12, 60),
    (-12, 12, -45),
    (12, -12, 15),
]
POINT_MM = 0.5
BOX_MM = [[-600, -600, 0], [700, 600, 1000]]


def cell_of_the_yumi() -> CellTruth:
    truth = small_pictures(7, arm=IRB_14050.name)
    moved = transform(np.eye(3), np.array(TARGET_MM) - (950.0, 0.0, 250.0))
    nominal = replace(truth.nominal, anchor_T_target=moved @ truth.nominal.anchor_T_target)
    return replace(truth, anchor_T_target=moved @ truth.anchor_T_target, nominal=nominal)


def taught_poses(start: Array) -> tuple[TaughtPose, ...]:
    """Poses about the first one, every other one nearer, as jogged: with confdata and arm angle."""
    poses, joints, first = [], start, IRB_14050.forward(start)
    pivot = transform(np.eye(3), (0.0, 0.0, 450.0))
    for number, turn in enumerate(TURNS_DEG):
        nearer = transform(np.eye(3), (0.0, 0.0, NEARER_MM * (number % 2)))
        turned = transform(rotation_from_vector(np.radians(turn)), np.zeros(3))
        pose = first @ pivot @ turned @ nearer @ inverse(pivot)
        joints = IRB_14050.nearest(pose, start)
        taught = TaughtPose.of(pose).model_copy(
            update={
                "configuration": tuple(IRB_14050.configuration(joints)),
                "arm_angle_deg": float(np.degrees(IRB_14050.arm_angle_rad(joints))),
            }
        )
        poses.append(taught)
    return tuple(poses)


async def test_taught_poses_of_the_yumi_calibrate_the_camera(tmp_path: Path) -> None:
    truth = cell_of_the_yumi()
    async with running_cell(7, 100.0, truth=truth, program="python") as cell:
        start = cell.controller.arm.joints_at(0.0)
        poses = taught_poses(start)
        calibration = {"poses": [pose.model_dump(mode="json") for pose in poses]}
        async with daemon_for(cell, tmp_path, robot={"box_mm": BOX_MM}, calibration=calibration) as story:
            ask = story.operator.client
            seen = (await ask.get("/robot")).json()
            assert len(seen["joints_deg"]) == 7
            assert (seen["model"], seen["frame_warning"], seen["external_axes"]) == (IRB_14050.name, None, None)
            run = (await ask.post("/calibrate", params={"wait": LIMIT_S})).json()
            assert (run["state"], run["stations"]) == ("finished", len(poses)), run["cause"]
            angle_deg = (await ask.get("/robot")).json()["arm_angle_deg"]
            assert angle_deg == pytest.approx(poses[-1].arm_angle_deg, abs=0.01)
            document = (await story.application.store.current())[1].document
            assert document.flange_T_camera is not None
            found = document.flange_T_camera.transform()
            print("story:", difference(found, truth.flange_T_camera), score_calibration(truth, found)["point_rms_mm"])
            assert score_calibration(truth, found)["point_rms_mm"] < POINT_MM
            refused = await ask.post("/calibrate", json={"arm": True})
            assert "seven" in refused.json()["detail"]

"""An arm that is not as drawn: a run identifies its errors, and clouds are placed by them, over real sockets."""

from pathlib import Path

import numpy as np
import pytest

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.calibration import CalibrationDocument
from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.documents.pose import PoseDocument
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import Postures
from calibration.kinematics.stance import Stance
from calibration.transforms import Array, map_points
from tests.daemon.fakes import ply_of, points_of
from tests.stories.plant import plant, small_pictures
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

POINTS_MM = np.array([[0.0, 0.0, 450.0], [60.0, -40.0, 480.0], [-50.0, 30.0, 430.0]])
PLY = {"content-type": "application/x-ply"}


def transform_of(pose: PoseDocument | None) -> Array:
    assert pose is not None
    return pose.transform()


async def test_points_are_placed_better_between_the_views_of_the_run(tmp_path: Path) -> None:
    truth = small_pictures(7, arm_class="worn")
    arm, built = find_arm(truth.arm), truth.built_arm()
    assert built is not None
    async with plant(tmp_path, planned=True, truth=truth) as story:
        ask = story.operator.client
        run = (await ask.post("/calibrate", json={"arm": True, "count": 12}, params={"wait": LIMIT_S})).json()
        assert run["state"] == "finished", run["cause"]
        link = run["links"]["calibration"]
        errors = (await ask.get(f"{link}/arm")).json()
        assert errors["taken_up"], errors["ladder"]
        assert errors["joints_from_poses"] == 0
        calibration = (await ask.get(link)).json()
        document = CalibrationDocument.model_validate(calibration)
        in_use = CalibrationInUse.of(document, ArmErrorsDocument.model_validate(errors))
        views = np.radians([view["joints_deg"] for view in calibration["views"]])
        between = (views[:-1] + views[1:]) / 2
        reported, true = arm.forward(between), built.base_T_flange(Postures(between)) @ truth.mount_T_scanner
        stances = [*map(Stance, reported, between)]
        corrected = in_use.base_T_flange(stances) @ transform_of(in_use.document.mount_T_camera)
        before, after = [], []
        for joints, pose, as_built, place in zip(between, reported, corrected, true, strict=True):
            flange = PoseDocument.of(pose)
            at = ",".join(map(repr, (*flange.translation_mm, *flange.quaternion_wxyz)))
            params = {"pose": at, "joints": ",".join(map(repr, np.degrees(joints).tolist()))}
            answer = await ask.post("/register", params=params, content=ply_of(POINTS_MM), headers=PLY)
            assert answer.headers["handeyed-arm"] == "as-built", answer.text
            np.testing.assert_allclose(points_of(answer.content), map_points(as_built, POINTS_MM), atol=1e-4)
            expected = map_points(place, POINTS_MM)
            after.append(points_of(answer.content) - expected)
            before.append(map_points(pose @ transform_of(document.mount_T_camera), POINTS_MM) - expected)
        rms_before, rms_after = (float(np.sqrt(np.mean(np.square(found)))) for found in (before, after))
        assert rms_after < rms_before, (rms_before, rms_after)

"""A palletiser's motions on the mock: the one number is measured at the target, the rest is calibrated and used.

`pytest -s tests/stories/test_four_axis.py` prints the figures of docs/arms.md.
"""

from pathlib import Path

import numpy as np
import pytest

from calibration.transforms import map_points
from daemon.config.settings import TaughtPose
from mock_robot.truth.score import score_calibration
from tests.daemon.fakes import ply_of, points_of
from tests.simulated.palletisers import upright_poses
from tests.stories.plant import TEXT, plant, small_pictures
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

SEED = 7
TOUCHED_MM, SIGMA_MM = 0.1, 0.15
"""Error of the touched height of the target, and its stated standard deviation."""
POINT_MM = 0.4


async def test_the_target_is_touched_once_and_a_cloud_comes_out_in_base(tmp_path: Path) -> None:
    truth = small_pictures(SEED)
    poses = upright_poses(
        np.random.default_rng(1), "eye-in-hand", truth.target, truth.camera, truth.mount_T_camera,
        truth.anchor_T_target, 8, (450.0, 600.0),
    )  # fmt: skip
    height = {"of": "target", "coordinate_mm": truth.base_T_target[2, 3] + TOUCHED_MM, "sigma_mm": SIGMA_MM}
    taught = tuple(TaughtPose.of(pose) for pose in poses)
    async with plant(tmp_path, truth=truth, calibration={"poses": taught, "policy": "operator"}) as story:
        ask = story.operator.client
        refused = (await ask.post("/calibrate", params={"wait": LIMIT_S})).json()
        without = (await ask.get(refused["links"]["calibration"])).json()
        assert without["verdict"]["findings"][0]["code"] == "parallel-axes"
        assert without["flange_T_camera"] is None

        run = (await ask.post("/calibrate", json={"axis_offset": height}, params={"wait": LIMIT_S})).json()
        assert run["state"] == "finished", run["cause"]
        link = run["links"]["calibration"]
        assert "no picture shows it" in (await ask.get(link, headers=TEXT)).text
        assert (await ask.post(f"{link}/apply", json={"applied_by": "Ann"})).status_code == 200
        document = (await story.application.store.current())[1].document
        assert document.mount_T_camera is not None and document.uncertainty is not None
        assert document.axis_offset is not None and document.axis_offset.sigma_mm == SIGMA_MM
        found = document.mount_T_camera.transform()
        off_mm = found[:3, 3] - truth.mount_T_camera[:3, 3]
        points_mm = score_calibration(truth, found)["point_rms_mm"]
        print("story: X off by", off_mm.round(3), "mm, a point by", round(points_mm, 3), "mm RMS, one sigma",
              np.round(document.uncertainty.translation_mm, 3))  # fmt: skip
        assert points_mm < POINT_MM
        covariance = document.uncertainty.matrix()
        assert covariance is not None
        by_camera = found[:3, :3].T @ off_mm
        assert by_camera @ np.linalg.solve(covariance[3:, 3:], by_camera) < 11.34  # chi-square of three, 99 %

        points = np.array([[0.0, 0, 600], [50, -20, 580], [-80, 40, 620]])
        answer = await ask.post(
            "/register", params={"pose": "now"}, content=ply_of(points), headers={"content-type": "application/x-ply"}
        )
        flange = story.cell.cell.flange_at(story.cell.cell.clock())
        registered = points_of(answer.content) - map_points(flange @ truth.mount_T_scanner, points)
        print("story: registered points off by", np.linalg.norm(registered, axis=1).round(3), "mm")
        assert np.linalg.norm(registered, axis=1).max() < 2 * POINT_MM

    async with plant(tmp_path / "no poses", truth=truth, planned=True, calibration={"axis_offset": height}) as story:
        planned = await story.operator.client.post("/calibrate")
        assert planned.json()["code"] == "no-poses"
        assert "teach eight poses" in planned.json()["fix"]

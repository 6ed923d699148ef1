"""A camera on a stand and the target on the flange: calibrated, verified, charted and used, over real sockets."""

from pathlib import Path

import numpy as np
import pytest

from calibration.transforms import map_points
from mock_robot.truth.score import score_calibration
from tests.daemon.fakes import ply_of, points_of
from tests.stories.plant import TEXT, Plant, plant, small_pictures
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

POINT_MM = 0.4
UNGUESSED = {"base_T_camera_guess": None, "flange_T_target_guess": None}


async def calibrates(story: Plant) -> float:
    """How far the result maps points from the truth, RMS."""
    run = (await story.operator.client.post("/calibrate", params={"wait": LIMIT_S})).json()
    assert run["state"] == "finished", run["cause"]
    assert run["result"]["applied"]
    document = (await story.application.store.current())[1].document
    assert document.setup == "eye-to-hand"
    assert document.flange_T_camera is None
    assert document.mount_T_camera is not None
    return score_calibration(story.truth, document.mount_T_camera.transform())["point_rms_mm"]


async def test_from_the_guesses_to_a_chart_and_a_cloud_in_base(tmp_path: Path) -> None:
    async with plant(tmp_path, planned=True, truth=small_pictures(7, setup="eye-to-hand")) as story:
        ask = story.operator.client
        assert await calibrates(story) < POINT_MM

        words = (await ask.post("/verify", params={"wait": LIMIT_S}, headers=TEXT)).text
        assert "points of the target in flange coordinates" in words
        verified = (await ask.get("/runs", params={"limit": 1})).json()["runs"][0]["result"]["verification"]
        assert verified["frame"] == "flange"
        assert max(verified["sigma_mm"]) < POINT_MM
        assert (await ask.get("/drift")).json()["verifications"] == 1

        points = np.array([[0.0, 0, 600], [50, -20, 580]])
        answer = await ask.post(
            "/register", params={"pose": "now"}, content=ply_of(points), headers={"content-type": "application/x-ply"}
        )
        expected = map_points(story.truth.mount_T_scanner, points)
        assert np.abs(points_of(answer.content) - expected).max() < 2 * POINT_MM

        scan = (await ask.post("/scans", json={"name": "held part"})).json()
        await ask.post(
            f"/scans/{scan['id']}/views",
            params={"pose": "now"},
            content=ply_of(points),
            headers={"content-type": "application/x-ply"},
        )
        refused = await ask.get(f"/scans/{scan['id']}/report")
        assert refused.status_code == 409
        assert "beside the robot" in refused.json()["detail"]


async def test_with_no_guess_it_turns_the_target_a_little_and_finds_out(tmp_path: Path) -> None:
    truth = small_pictures(3, setup="eye-to-hand")
    async with plant(tmp_path, planned=True, truth=truth, calibration=UNGUESSED) as story:
        assert await calibrates(story) < POINT_MM

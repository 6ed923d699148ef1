"""The main job from nothing to a merged door, over real sockets, with the mock's truth beside every figure."""

from pathlib import Path

import numpy as np
import pytest

from calibration.documents.calibration import calibration_document
from calibration.solve import solve_hand_eye
from calibration.verdict import VerdictLimits, judge
from daemon.sessions.session_reader import load_problem, open_session
from mock_robot.truth.score import score_calibration, score_cloud
from tests.daemon.fakes import ply_of, points_of
from tests.stories.plant import TEXT, plant
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

STATED = VerdictLimits().with_tolerance(4.0)
"""As the plant's settings state it."""

THREE_POSES_MM = 0.4
EIGHT_POSES_MM = 0.15
DOOR_MM = 0.3
"""Bars of the product, with the mock's default noise: 0.05 px, 0.05 mm, 0.005 deg."""


async def test_calibrate_verify_register_and_scan_a_door(tmp_path: Path) -> None:
    async with plant(tmp_path, planned=True) as story:
        ask = story.operator.client
        run = (await ask.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert run["state"] == "finished", run["cause"]
        assert run["result"]["expanded_mm"] <= run["result"]["tolerance_mm"], "it goes on until that is so"
        assert run["result"]["applied"]
        assert not story.cell.moving

        # X is the truth's, and the folder of the run tells the same.
        current = (await story.application.store.current())[1].document
        assert current.flange_T_camera is not None
        off = score_calibration(story.truth, current.flange_T_camera.transform())
        assert off["point_rms_mm"] < THREE_POSES_MM
        problem = load_problem(open_session(tmp_path / "runs" / run["id"]))
        solution = solve_hand_eye(problem)
        again = calibration_document(
            solution, judge(problem, solution, STATED), calibration_id=current.id, created_at=current.created_at,
            software=current.software, target=problem.target,
        )  # fmt: skip
        expected = {name: getattr(current.accuracy, name) for name in ("expected_mm", "why")}
        assert again.with_accuracy(**expected) == current

        # Tab. 1: the target stands still, so its points scatter by no more than the noise.
        words = (await ask.post("/verify", params={"wait": LIMIT_S}, headers=TEXT)).text
        assert "(a) Position 1" in words
        assert "sigma z" in words
        verified = (await ask.get("/runs", params={"limit": 1})).json()["runs"][0]["result"]["verification"]
        assert len(verified["stations"]) == 3
        assert len(verified["points"]) == 88
        assert max(verified["sigma_mm"]) < THREE_POSES_MM

        # A cloud from where the arm stands.
        points = np.array([[0.0, 0, 600], [50, -20, 580]])
        params, headers = {"pose": "now"}, {"content-type": "application/x-ply"}
        answer = await ask.post("/register", params=params, content=ply_of(points), headers=headers)
        truth = story.cell.cell.flange_at(story.cell.cell.clock()) @ story.truth.flange_T_camera
        expected = points @ truth[:3, :3].T + truth[:3, 3]
        assert np.abs(points_of(answer.content) - expected).max() < THREE_POSES_MM

        # A part wider than one view. Every second pose is, from some postures, too far a turn of axis 4.
        poses = story.cell.announcement.sheet["scan_poses"]
        scan = (await ask.post("/scans", params={"wait": LIMIT_S}, json={"name": "door", "poses": poses})).json()
        assert "run" in scan, scan.get("detail")
        assert scan["run"]["state"] == "finished", scan["run"]["cause"]
        cloud = await ask.get(scan["links"]["cloud"])
        score = score_cloud(story.truth, cloud.content)
        assert score["rms_mm"] < DOOR_MM
        assert score["covered"] > 0.4


async def test_eight_poses_are_better_than_three_need_be(tmp_path: Path) -> None:
    async with plant(tmp_path, seed=11) as story:
        run = (await story.operator.client.post("/calibrate", params={"wait": LIMIT_S}, json={"count": 8})).json()
        assert (run["state"], run["stations"]) == ("finished", 8), run["cause"]
        document = (await story.application.store.calibration(run["id"])).document
        assert document.verdict.accepted
        assert document.flange_T_camera is not None
        off = score_calibration(story.truth, document.flange_T_camera.transform())
        assert off["point_rms_mm"] < EIGHT_POSES_MM

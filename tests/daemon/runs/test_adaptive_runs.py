"""A calibration that plans as it goes, with devices that misbehave at the moment the test chooses."""

import asyncio
import re
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.numbers import significant
from calibration.planning.next_view import NextView, next_view
from calibration.transforms import transform, vector_from_rotation
from tests.daemon.cell_under_test import Parts, pose_json, serving, settings_for
from tests.daemon.fakes import FLANGE_T_CAMERA, poses_around_the_target
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

TEXT = {"accept": "text/plain"}


async def test_aborted_while_it_plans_nothing_moves_and_the_plan_is_forgotten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    planning, go_on = threading.Event(), threading.Event()

    def plans_slowly(*question: Any, **more: Any) -> NextView:
        planning.set()
        assert go_on.wait(LIMIT_S)
        return next_view(*question, **more)

    monkeypatch.setattr("daemon.runs.adaptive_sequence.next_view", plans_slowly)
    guess = pose_json(FLANGE_T_CAMERA)
    async with serving(settings_for(tmp_path, calibration={"poses": [], "flange_T_camera_guess": guess})) as bench:
        run = (await bench.client.post("/calibrate")).json()
        await asyncio.to_thread(planning.wait, LIMIT_S)
        assert (await bench.client.get(run["links"]["self"])).json()["state"] == "planning"
        stopped = (await bench.client.post(f"/runs/{run['id']}/abort")).json()
        assert (stopped["state"], bench.robot.armed) == ("aborted", False)
        assert bench.robot.stops >= 1
        go_on.set()
        await asyncio.to_thread(planning.wait, LIMIT_S)
    assert not bench.robot.goals


async def test_a_link_lost_while_it_plans_fails_the_run_before_the_next_move(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = Parts()

    def loses_the_link(*question: Any, **more: Any) -> NextView:
        found = next_view(*question, **more)
        parts.robot.lost = len(parts.robot.goals) == 1
        return found

    monkeypatch.setattr("daemon.runs.adaptive_sequence.next_view", loses_the_link)
    guess = pose_json(FLANGE_T_CAMERA)
    settings = settings_for(tmp_path, calibration={"poses": [], "count": 3, "flange_T_camera_guess": guess})
    async with serving(settings, parts) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert run["cause"]["what"] == "link to the controller lost after picture 2 of 4"
        assert len(bench.robot.goals) == 1
        parts.robot.lost = False


async def test_a_run_that_plans_shows_what_it_expects_and_keeps_every_picture(tmp_path: Path) -> None:
    guess = pose_json(FLANGE_T_CAMERA)
    async with serving(settings_for(tmp_path, calibration={"poses": [], "flange_T_camera_guess": guess})) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S}, json={"count": 4})).json()
        assert (run["state"], run["station"], run["stations"]) == ("finished", 4, 4), run["cause"]
        assert [name for name in run["links"] if name.startswith("frame")] == [f"frame {k}" for k in range(5)]
        told = [event.data["predicted"] for event in bench.application.events._kept if event.kind == "run"]
        assert any(words and re.fullmatch(r"predicted U 0\.\d+ -> 0\.\d+ mm", words) for words in told), told
        assert run["planning"]["goal"]["views"] == 4
        assert [row["station"] for row in run["planning"]["history"]] == [0, 1, 2, 3, 4]
        again = (await bench.client.get(run["links"]["self"], headers=TEXT)).text
        assert f"predicted U {significant(run['planning']['now_mm'])} mm" in again


@pytest.mark.parametrize(("goals", "stops"), [({"tolerance_mm": 3.0}, True), ({"tolerance_mm": 1e-7}, False)])
async def test_a_run_stops_when_the_tolerance_is_met(tmp_path: Path, goals: dict[str, float], stops: bool) -> None:
    guess = pose_json(FLANGE_T_CAMERA)
    async with serving(settings_for(tmp_path, calibration={"poses": [], "flange_T_camera_guess": guess})) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S}, json={"count": 6, **goals})).json()
        assert (run["state"], run["station"] < 6, run["result"]["accepted"]) == ("finished", stops, stops), run


async def test_planned_views_without_the_target_are_taken_from_elsewhere_and_in_the_end_given_up(
    tmp_path: Path,
) -> None:
    guess = pose_json(FLANGE_T_CAMERA)
    settings = settings_for(tmp_path, calibration={"poses": [], "count": 3, "flange_T_camera_guess": guess})
    parts = Parts()
    parts.camera.blind = lambda k: k == 3
    async with serving(settings, parts) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert (run["state"], run["stations"]) == ("finished", 4), run["cause"]
    parts = Parts()
    parts.camera.blind = lambda k: k > 2
    async with serving(settings, parts) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert (run["state"], run["cause"]["code"]) == ("failed", "target-not-seen")
        assert len(bench.robot.goals) == 5


async def test_the_exploring_turn_that_loses_the_target_is_reversed(tmp_path: Path) -> None:
    parts = Parts()
    parts.camera.blind = lambda k: k == 2
    async with serving(settings_for(tmp_path, calibration={"poses": []}), parts) as bench:
        await bench.client.post("/calibrate", params={"wait": LIMIT_S})
        start = poses_around_the_target(1)[0][:3, :3]
        turns = [
            np.degrees(vector_from_rotation(start.T @ goal.base_T_flange[:3, :3])) for goal in bench.robot.goals[:3]
        ]
        np.testing.assert_allclose(turns, [[0, 0, 15], [0, 0, -15], [12, 0, 0]], atol=0.01)


async def test_verify_without_taught_poses_plans_as_it_goes_from_the_calibration_in_force(tmp_path: Path) -> None:
    guess = pose_json(FLANGE_T_CAMERA)
    async with serving(settings_for(tmp_path, calibration={"poses": [], "flange_T_camera_guess": guess})) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S}, json={"count": 4})).json()
        body = {"despite_verdict": True}
        assert (await bench.client.post(f"/calibrations/{run['id']}/apply", json=body)).status_code == 200
        moves = len(bench.robot.goals)
        seen = (await bench.client.post("/verify", params={"wait": LIMIT_S})).json()
        assert (seen["state"], seen["station"], len(bench.robot.goals) - moves) == ("finished", 3, 3), seen["cause"]
        assert seen["result"]["verification"]["stations"] == [1, 2, 3]
        assert max(seen["result"]["verification"]["sigma_mm"]) < 0.5


@pytest.mark.parametrize(("off_mm", "told"), [(20.0, False), (120.0, True)])
async def test_a_camera_far_from_where_the_settings_have_it_is_reported(
    tmp_path: Path, off_mm: float, told: bool
) -> None:
    guess = pose_json(FLANGE_T_CAMERA @ transform(np.eye(3), [0.0, 0.0, off_mm]))
    async with serving(settings_for(tmp_path, calibration={"flange_T_camera_guess": guess})) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        verdict = (await bench.client.get(run["links"]["calibration"])).json()["verdict"]
        assert ("mount-not-as-expected" in {finding["code"] for finding in verdict["findings"]}) is told

"""An operator jogs the arm through the daemon at the shipped RAPID: by axis, in frames, to angles, within the rules."""

import asyncio
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.stories.plant import Plant, plant
from tests.support.waiting import LIMIT_S, eventually


def joints_deg(story: Plant) -> Any:
    controller = story.cell.controller
    return np.degrees(controller.arm.joints_at(controller.robot_s(story.cell.cell.clock())))


async def jogs(story: Plant, **body: Any) -> dict[str, Any]:
    answer: dict[str, Any] = (
        await story.operator.client.post("/robot/jog", params={"wait": LIMIT_S}, json=body)
    ).json()
    return answer


async def test_the_arm_is_jogged_to_a_first_pose_and_back_and_stays_within_its_limits(tmp_path: Path) -> None:
    async with plant(tmp_path, planned=True) as story:
        start = joints_deg(story)
        turned = await jogs(story, axis=6, by_deg=-12.0)
        assert turned["state"] == "finished", turned
        np.testing.assert_allclose(joints_deg(story) - start, [0, 0, 0, 0, 0, -12], atol=1e-3)
        np.testing.assert_allclose(turned["result"]["joints_deg"], joints_deg(story), atol=1e-3)

        before = (await story.operator.client.get("/robot")).json()["base_T_flange"]["translation_mm"]
        lifted = (await jogs(story, shift_mm=[0.0, 0.0, 30.0]))["result"]["base_T_flange"]["translation_mm"]
        np.testing.assert_allclose(np.subtract(lifted, before), [0, 0, 30], atol=0.05)
        assert (await jogs(story, joints_deg=start.tolist()))["state"] == "finished"
        np.testing.assert_allclose(joints_deg(story), start, atol=1e-3)

        moves = story.cell.commanded_moves
        for body, why in (
            ({"joints_deg": [0, 0, 0, 0, 170, 0]}, "beyond its limit"),
            ({"joints_deg": [0, 0, 0, 0, 0, 0, 0]}, "the arm has 6 axes"),
            ({"axis": 7, "by_deg": 1}, "there is no axis 7"),
        ):
            refused = await jogs(story, **body)
            assert (refused["status"], why in refused["detail"]) == (422, True), refused
        assert story.cell.commanded_moves == moves
        assert not story.cell.controller.armed


async def test_angles_of_an_unknown_arm_that_lead_out_of_the_box_are_refused_by_the_controller(tmp_path: Path) -> None:
    async with plant(tmp_path, planned=True, robot={"model": None}) as story:
        start = joints_deg(story)
        out = await jogs(story, joints_deg=[start[0], 100.0, 40.0, *start[3:]])
        assert (out["state"], out["cause"]["code"]) == ("failed", "move-refused"), out
        assert "outside the allowed space" in out["cause"]["what"]
        np.testing.assert_allclose(joints_deg(story), start, atol=1e-9)
        assert not story.cell.controller.armed


@pytest.mark.slow
async def test_angles_of_an_unknown_arm_are_refused_where_the_controllers_box_is_the_larger_one(tmp_path: Path) -> None:
    box = ((-500.0, -1000.0, 200.0), (950.0, 1000.0, 1500.0))
    async with plant(tmp_path, planned=True, robot={"model": None, "box_mm": box}) as story:
        for body in ({"axis": 6, "by_deg": 1.0}, {"joints_deg": joints_deg(story).tolist()}):
            refused = await jogs(story, **body)
            assert (refused["status"], refused["code"]) == (422, "pose-refused"), refused
            assert "set [robot] model" in refused["fix"]
        assert story.cell.commanded_moves == 0
        assert (await jogs(story, shift_mm=[0.0, 0.0, 5.0]))["state"] == "finished"


@pytest.mark.slow
async def test_in_a_calibration_by_hand_the_run_jogs_between_views_and_aborting_it_stops_the_arm(
    tmp_path: Path,
) -> None:
    async with plant(tmp_path, planned=True, time_scale=4) as story:
        ask = story.operator.client
        run = await story.operator.starts("/calibrate", manual=True)
        assert (await ask.post(run["links"]["stations"])).json()["station"] == 1
        before = (await ask.get("/robot")).json()["base_T_flange"]["translation_mm"]
        turned = await ask.post(run["links"]["jog"], json={"shift_mm": [0.0, 0.0, 15.0], "turn_deg": [0.0, 6.0, 0.0]})
        assert (turned.status_code, turned.json()["state"]) == (200, "waiting"), turned.text
        after = (await ask.get("/robot")).json()["base_T_flange"]["translation_mm"]
        np.testing.assert_allclose(np.subtract(after, before), [0, 0, 15], atol=0.1)
        assert not story.cell.controller.armed
        assert (await ask.post(run["links"]["stations"])).json()["station"] == 2

        jogging = asyncio.create_task(ask.post(run["links"]["jog"], json={"axis": 1, "by_deg": 25.0, "speed_mm_s": 5}))
        await eventually(lambda: story.cell.controller.arm.is_moving_at(now(story)))
        stopped = await ask.post(run["links"]["abort"])
        assert (stopped.status_code, stopped.json()["state"]) == (200, "aborted"), stopped.text
        assert (await jogging).status_code == 409
        assert not story.cell.controller.armed
        start = joints_deg(story)
        assert story.cell.controller.arm.is_settled_at(now(story))
        np.testing.assert_allclose(joints_deg(story), start, atol=1e-9)


def now(story: Plant) -> float:
    return story.cell.controller.robot_s(story.cell.cell.clock())

"""No robot program at all: poses by Robot Web Services, stillness also by EGM, views by hand; X is the truth's."""

import asyncio
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from mock_robot.cabinet.panel import Mode
from mock_robot.truth.score import score_calibration
from tests.stories.jogging import SMALL_PICTURES_MM, jogs_and_waits, where_next
from tests.stories.rws_plant import by_rws
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow


async def takes_a_view(ask: httpx.AsyncClient, run: dict[str, Any]) -> dict[str, Any]:
    """As an operator does: again when it comes too early after the jog, or a busy machine brought too few samples."""
    async with asyncio.timeout(LIMIT_S):
        while (answer := await ask.post(run["links"]["stations"])).status_code in (409, 504):
            assert answer.json()["code"] in ("not-still", "device-timeout")
    assert answer.status_code == 200, answer.text
    taken: dict[str, Any] = answer.json()
    return taken


@pytest.mark.parametrize("version", [1, 2])
async def test_the_first_calibration_of_a_cell_needs_no_robot_program(tmp_path: Path, version: int) -> None:
    async with by_rws(tmp_path, version) as story:
        rng, ask = np.random.default_rng(0), story.operator.client
        told = (await ask.get("/robot")).text
        assert f"RWS {version}.0" in told
        run = await story.operator.starts("/calibrate", manual=True, tolerance_mm=1.0)
        for number in range(1, 9):
            run = await takes_a_view(ask, run)
            assert run["station"] == number
            if run["planning"]["advice"].startswith("that is enough"):
                break
            await jogs_and_waits(story.cell, where_next(story.cell, run["planning"], rng))
        run = (await ask.post(run["links"]["finish"], params={"wait": LIMIT_S})).json()
        assert run["state"] == "finished", run["cause"]
        document = (await story.application.store.calibration(run["id"])).document
        assert document.flange_T_camera is not None
        off = score_calibration(story.truth, document.flange_T_camera.transform())
        assert off["point_rms_mm"] < SMALL_PICTURES_MM


async def test_a_ringing_arm_is_not_looked_at(tmp_path: Path) -> None:
    async with by_rws(tmp_path, 2) as story:
        run = await story.operator.starts("/calibrate", manual=True)
        story.cell.inject_fault("egm-vibration")
        refused = await story.operator.client.post(run["links"]["stations"])
        while refused.status_code in (200, 504):  # samples of a quiet arm in the window, or too few on a busy machine
            refused = await story.operator.client.post(run["links"]["stations"])
        assert (refused.status_code, refused.json()["code"]) == (409, "not-still")
        assert "still vibrates by 0." in refused.json()["detail"]


async def test_an_automatic_run_is_refused_with_what_to_do_instead(tmp_path: Path) -> None:
    async with by_rws(tmp_path, 2) as story:
        controller, now_s = story.cell.controller, story.cell.cell.clock()
        controller.switch_mode(Mode.AUTO, now_s)
        controller.run_program(True, now_s)
        ended = (await story.operator.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert ended["state"] == "failed"
        assert "the arm is read, not moved" in str(ended["cause"])
        assert "--manual" in str(ended["cause"])
        assert controller.panel.program_running, "the program that runs is not ours to stop"

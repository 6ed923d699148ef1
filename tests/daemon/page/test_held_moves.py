"""A button that moves the arm while it is held: back to the target, after a run that ended early."""

import asyncio
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.fakes import Gate
from tests.daemon.page.conftest import page_of
from tests.daemon.page.holding import keep_holding, let_go, press_shortly
from tests.support.waiting import LIMIT_S, eventually

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow, pytest.mark.usefixtures("patient_lease")]

BACK = "Back to the target"


async def aborted_away(bench: Bench, parts: Parts) -> Any:
    """A run that was aborted on the way to its second picture; the pose of its first one. The arm stands elsewhere."""
    parts.robot.before_move = gate = Gate(2)
    started = (await bench.client.post("/calibrate")).json()
    await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
    seen_at = bench.robot.base_T_flange.copy()
    assert (await bench.client.post(started["links"]["abort"])).json()["state"] == "aborted"
    bench.robot.base_T_flange[2, 3] += 200.0
    bench.robot.goals.clear()
    parts.robot.before_move = None
    parts.camera.blind = lambda number: bool(np.abs(bench.robot.base_T_flange - seen_at).max() > 1.0)
    return seen_at


async def test_after_an_abort_one_hold_brings_the_arm_back_to_the_target(browser: Any, tmp_path: Path) -> None:
    parts = Parts()
    async with serving(settings_for(tmp_path), parts) as bench, page_of(browser) as page:
        seen_at = await aborted_away(bench, parts)
        await page.goto(f"{bench.url}/page/?lang=en#/cell")
        button = page.get_by_role("button", name=BACK)
        await button.wait_for()
        assert await page.locator("main .primary").locator("visible=true").count() == 1
        there = lambda: bool(np.allclose(bench.robot.base_T_flange, seen_at, atol=1e-9))  # noqa: E731
        await keep_holding(page, "#hold-back", there)
        await page.keyboard.up("Enter")
        assert len(bench.robot.goals) >= 10
        await page.get_by_text("Not calibrated yet.").wait_for()
        assert not bench.robot.armed


@pytest.mark.parametrize("how", ["key", "Escape", "blur", "window", "hidden", "offline"])
async def test_the_arm_stops_however_the_button_is_let_go(browser: Any, tmp_path: Path, how: str) -> None:
    parts = Parts()
    async with serving(settings_for(tmp_path), parts) as bench, page_of(browser) as page:
        await aborted_away(bench, parts)
        parts.robot.before_move = gate = Gate(3)
        await page.goto(f"{bench.url}/page/?lang=en#/cell")
        await keep_holding(page, "#hold-back", gate.reached.is_set)
        assert bench.robot.armed
        await let_go(page, how)
        await eventually(lambda: not bench.robot.armed)
        await eventually(lambda: bench.application.cell.buttons == {})
        run = (await bench.client.get("/runs", params={"limit": 1})).json()["runs"][0]
        over = await bench.run_over(run["links"]["self"])
        assert (over["kind"], over["state"], len(bench.robot.goals)) == ("jog", "finished", 3)


@pytest.mark.parametrize("how", ["up", "leaves", "pointerdown", "pointerup"])
async def test_a_pointer_that_leaves_or_is_joined_by_another_lets_go(browser: Any, tmp_path: Path, how: str) -> None:
    parts = Parts()
    async with serving(settings_for(tmp_path), parts) as bench, page_of(browser) as page:
        await aborted_away(bench, parts)
        parts.robot.before_move = gate = Gate(3)
        await page.goto(f"{bench.url}/page/?lang=en#/cell")
        box = await page.get_by_role("button", name=BACK).bounding_box()
        await keep_holding(page, "#hold-back", gate.reached.is_set, by_mouse=True)
        if how == "up":
            await page.mouse.up()
        elif how == "leaves":
            await page.mouse.move(box["x"] + 20, box["y"] + box["height"] + 200)
        else:
            beside = "kind => document.body.dispatchEvent(new PointerEvent(kind, { bubbles: true }))"
            await page.evaluate(beside, how)  # of another pointer, or of this one over something that came between
        await eventually(lambda: not bench.robot.armed)
        assert len(bench.robot.goals) == 3


async def test_a_short_press_moves_nothing(browser: Any, tmp_path: Path) -> None:
    parts = Parts()
    async with serving(settings_for(tmp_path), parts) as bench, page_of(browser) as page:
        await aborted_away(bench, parts)
        asked: list[Any] = []
        page.on("request", lambda request: asked.append(request.url) if request.method == "POST" else None)
        await page.goto(f"{bench.url}/page/?lang=en#/cell")
        await press_shortly(page.get_by_role("button", name=BACK))
        await page.get_by_text("Hold: the arm moves until you let go.").wait_for()
        assert (bench.robot.goals, [url for url in asked if "jog" in url]) == ([], [])

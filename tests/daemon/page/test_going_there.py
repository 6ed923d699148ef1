"""Guided by hand: the frame in the picture, one button held to the next pose, or an arrow for each axis."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.transforms import difference, rotation_from_vector, transform
from daemon.model.run_states import RunState
from daemon.runs.jog import MAX_STEP_MM
from tests.daemon.by_hand import COLUMNS, FRAME_PX, POSES, ROWS, ByHand, by_hand
from tests.daemon.cell_under_test import Parts
from tests.daemon.fakes import Gate
from tests.daemon.page.conftest import page_of
from tests.daemon.page.holding import keep_holding, let_go, press_shortly
from tests.support.waiting import LIMIT_S, eventually

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow, pytest.mark.usefixtures("patient_lease")]

SCREEN = {"width": 1366, "height": 768}
GO, TAKE = "Hold: go there", "Take picture"
PRIMARY = "main .primary >> visible=true"
FRAME = "polygon.belongs"


@asynccontextmanager
async def advised(browser: Any, folder: Path, parts: Parts | None = None) -> AsyncIterator[tuple[ByHand, Any, Any]]:
    """A run by hand with three pictures, on a page, and the pose (4, 4) that is proposed."""
    async with by_hand(folder, parts) as hand, page_of(browser, viewport=SCREEN) as page:
        for pose in POSES[:3]:
            planning = (await hand.takes(pose)).json()["planning"]
        await page.goto(f"{hand.bench.url}/page/?lang=en#/calibrate/{hand.run['id']}")
        await page.locator(FRAME).wait_for()
        yield hand, page, PoseDocument.model_validate(planning["next_pose"]).transform()


async def outline_in_the_picture(page: Any) -> Any:
    """Pixels (4, 2) of the corners of the target that the page shows, in the order of the frame's."""
    corners = (0, COLUMNS - 1, COLUMNS * ROWS - 1, COLUMNS * (ROWS - 1))
    circles = await page.locator("#camera circle.corner, .flush circle.corner").evaluate_all(
        "all => all.map((one) => [Number(one.getAttribute('cx')), Number(one.getAttribute('cy'))])"
    )
    return np.array(circles)[list(corners)] if len(circles) == COLUMNS * ROWS else None


def waits(hand: ByHand) -> bool:
    """Whether the run is at rest, for the operator's next act."""
    run = hand.bench.application.supervisor.in_progress
    return run is not None and run.state is RunState.WAITING


async def test_one_hold_brings_the_target_into_its_frame(browser: Any, tmp_path: Path) -> None:
    async with advised(browser, tmp_path) as (hand, page, there):
        robot = hand.bench.robot
        go = page.get_by_role("button", name=GO)
        await page.get_by_text("bring the target into the dashed frame").wait_for()
        assert await page.locator(PRIMARY).all_text_contents() == [GO]
        button, picture = await go.bounding_box(), await page.locator(".flush .picture .frame").bounding_box()
        assert button["width"] >= 200 and button["height"] >= 60
        for one in (button, picture, await page.get_by_role("button", name=TAKE).bounding_box()):
            assert one["y"] + one["height"] <= SCREEN["height"]
        assert picture["width"] >= 640
        frame = await page.locator(FRAME).get_attribute("points")
        arrived = lambda: bool(np.allclose(robot.base_T_flange, there, atol=1e-9))  # noqa: E731
        await keep_holding(page, "#hold-there", arrived)
        await page.keyboard.up("Enter")
        await eventually(lambda: not robot.armed)
        stood = POSES[2]
        for goal in robot.goals:
            assert difference(stood, goal.base_T_flange)[0] <= MAX_STEP_MM + 1e-9
            stood = goal.base_T_flange
        await page.get_by_text("There: take the picture.").wait_for()
        assert await page.locator(PRIMARY).all_text_contents() == [TAKE]
        assert await page.evaluate("document.activeElement.id") == "hold-there", "the focus is not lost"
        shown = np.array([at.split(",") for at in frame.split()], float)

        async def off_px() -> float:
            found = await outline_in_the_picture(page)
            return np.inf if found is None else float(np.abs(found - shown).max())

        async with asyncio.timeout(LIMIT_S):
            while await off_px() > FRAME_PX:
                await page.wait_for_timeout(100)
        moves = len(robot.goals)
        await page.get_by_role("button", name=TAKE).press("Enter")
        await page.get_by_text("Picture 5 of").first.wait_for()
        assert len(robot.goals) == moves, "to take a picture moves nothing"


@pytest.mark.parametrize("how", ["key", "Escape", "hidden", "offline"])
@pytest.mark.parametrize("button", ["#hold-there", ".arrow.towards >> nth=0"])
async def test_the_arm_stops_when_it_is_let_go_and_the_run_waits_on(
    browser: Any, tmp_path: Path, how: str, button: str
) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(2)
    async with advised(browser, tmp_path, parts) as (hand, page, _):
        robot = hand.bench.robot
        await keep_holding(page, button, gate.reached.is_set)
        assert robot.armed
        await let_go(page, how)
        await eventually(lambda: not robot.armed)
        await eventually(lambda: hand.bench.application.cell.buttons == {})
        await eventually(lambda: waits(hand))
        assert (len(robot.goals), difference(POSES[2], robot.base_T_flange)[0] <= MAX_STEP_MM) == (2, True)


async def test_axis_by_axis_at_most_six_holds_come_there(browser: Any, tmp_path: Path) -> None:
    async with advised(browser, tmp_path) as (hand, page, there):
        robot = hand.bench.robot
        turned = there @ transform(rotation_from_vector(np.radians([0, 0, -60.0])), np.zeros(3))
        turned[:3, 3] -= (-507.0, -287.0, 58.0)
        robot.base_T_flange = turned
        ways = (
            "Turn Z, 60 degrees right, hold", "Move X, 507 mm left, hold", "Move Y, 287 mm left, hold",
            "Move Z, 58 mm right, hold",
        )  # fmt: skip
        await page.get_by_role("button", name=ways[0]).wait_for()
        away = page.get_by_role("button", name="Turn Z, 10 degrees left, away from the pose, hold")
        assert await away.get_attribute("aria-disabled") is None
        assert "towards" not in (await away.get_attribute("class") or "")
        for name in ways:  # four holds, at most six are allowed
            button = page.get_by_role("button", name=name).and_(page.locator(".towards:not([aria-disabled])"))
            goals = len(robot.goals)
            await button.focus()
            await page.keyboard.down("Enter")
            await eventually(lambda goals=goals: len(robot.goals) > goals and waits(hand))
            await page.keyboard.up("Enter")
            await page.locator(f'[aria-label="{name}"]').wait_for(state="detached")
            await page.locator("#hold-there:not([aria-disabled])").wait_for()
        off_mm, off_rad = difference(there, robot.base_T_flange)
        assert (off_mm < 40.0, np.degrees(off_rad) < 6.0) == (True, True)
        await page.get_by_text("There: take the picture.").wait_for()


async def test_a_short_press_moves_nothing_in_a_run(browser: Any, tmp_path: Path) -> None:
    async with advised(browser, tmp_path) as (hand, page, _):
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url) if request.method == "POST" else None)
        for button in ("#hold-there", ".arrow.towards"):
            await press_shortly(page.locator(button).first)
        await page.get_by_text("Hold: the arm moves until you let go.").wait_for()
        assert (hand.bench.robot.goals, [url for url in asked if "/jog" in url]) == ([], [])

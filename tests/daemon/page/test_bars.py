"""Bars of the cockpit on every screen: sizes for fingers and gloves, contrast, what moves and what does not."""

import json
import re
import subprocess
from typing import Any

import pytest

from tests.daemon.access_keys import bearer
from tests.daemon.cell_under_test import Bench
from tests.daemon.fakes import Gate, poses_around_the_target
from tests.daemon.page.conftest import COUNT_SHIFTS, MAX_SHIFT, TWO_FRAMES, Opened
from tests.daemon.page.holding import hold_by_mouse, hold_until
from tests.support.waiting import LIMIT_S

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow]

Cell = tuple[Bench, dict[str, str]]

PLACES = ("cell", "calibrate", "result", "verify", "scans", "jog", "devices", "history", "settings")
LEAST_PX, LEAST_MOVING_PX, LEAST_TEXT_PX = 44, 60, 12

TOO_SMALL = """([least, moving, text]) => {
  const hidden = (one) => !one.getClientRects().length || getComputedStyle(one).visibility === 'hidden' ||
    one.closest('.sr-only, .skip, script, style');
  const small = [];
  for (const one of document.querySelectorAll('button, a[href], input, select, summary')) {
    if (hidden(one) || getComputedStyle(one).display === 'inline') continue;
    const pressed = one.matches('[type=radio], [type=checkbox], [type=file]') ? one.closest('label') : one;
    const { width, height } = pressed.getBoundingClientRect();
    const flat = one.matches('.moves, .arrow') && height < moving - 0.5;
    if (flat || Math.min(width, height) < least - 0.5) small.push([one.outerHTML.slice(0, 100), width, height]);
  }
  const words = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = words.nextNode(); node; node = words.nextNode()) {
    const one = node.parentElement;
    if (!node.textContent.trim() || hidden(one)) continue;
    const px = parseFloat(getComputedStyle(one).fontSize) * (one.ownerSVGElement ? one.getScreenCTM().a : 1);
    if (px < text - 0.05) small.push([node.textContent.slice(0, 40), px]);
  }
  return small;
}"""
"""What can be pressed, what moves the arm, and text, smaller than so many px. Links within a sentence are left out."""

FAINT = """async () => (await axe.run({ runOnly: ['color-contrast-enhanced'] })).violations.flatMap(
    ({ nodes }) => nodes.map((one) => one.html.slice(0, 120)))"""
"""Text with a contrast below 7:1, or below 4.5:1 where it is large."""


async def calibrate(cell: Cell) -> None:
    """Store and activate a calibration, and check it once."""
    bench, keys = cell
    headers = bearer(keys["operator"])
    run = await bench.client.post("/calibrate", json={"count": 5}, params={"wait": LIMIT_S}, headers=headers)
    made = run.json()["result"]["calibration_id"]
    applied = {"applied_by": "operator"}
    assert (await bench.client.post(f"/calibrations/{made}/apply", json=applied, headers=headers)).status_code == 200
    await bench.client.post("/verify", json={}, params={"wait": LIMIT_S}, headers=headers)


CLIPPED = """() => [...document.querySelectorAll('main .card, main button, main .chip')]
    .filter((one) => one.clientWidth && !/auto|scroll/.test(getComputedStyle(one).overflowY))
    .filter((one) => one.scrollHeight > one.clientHeight + 1 || one.scrollWidth > one.clientWidth + 1)
    .map((one) => one.outerHTML.slice(0, 100))"""
"""What holds more than it shows (B21)."""


def has_font_for(language: str) -> bool:
    """Whether fontconfig knows a font for it; without one, letters have the width of an empty box."""
    listed = subprocess.run(["fc-list", f":lang={language}"], capture_output=True, text=True, check=False)
    return bool(listed.stdout.strip())


@pytest.mark.parametrize("language", ["en", "de", "zh", "es"])
async def test_nothing_is_clipped_in_any_language(open_page: Opened, cell: Cell, language: str) -> None:
    if not has_font_for(language):
        pytest.skip(f"there is no font for {language} here: apt-get install fonts-noto-cjk")
    await calibrate(cell)
    for width, height in ((1366, 768), (390, 844)):
        viewport = {"width": width, "height": height}
        async with open_page("operator", "cell", f"lang={language}", viewport=viewport) as page:
            await page.locator("dl.line").wait_for()
            for place in PLACES:
                await page.evaluate("place => { location.hash = '#/' + place }", place)
                await page.locator("main .card").locator("visible=true").first.wait_for()
                await page.wait_for_function("document.documentElement.scrollWidth <= innerWidth")
                assert await page.evaluate(CLIPPED) == [], (place, width)


async def test_what_is_asked_again_is_large_enough_for_gloves(open_page: Opened, cell: Cell) -> None:
    async with open_page("operator", "cell", "lang=en", viewport={"width": 390, "height": 844}) as page:
        await page.locator("dl.line").wait_for()
        problem = {"status": 503, "json": {"code": "storage-error", "detail": "the disk is gone", "fix": "look at it"}}
        await page.route(re.compile(r"/devices$"), lambda route: route.fulfill(**problem))
        await page.evaluate("location.hash = '#/devices'")
        await page.get_by_role("button", name="Try again").first.wait_for()
        for again in await page.get_by_role("button", name="Try again").all():
            assert (await again.bounding_box())["height"] >= LEAST_PX


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", [(1366, 768), (390, 844)], ids=["screen", "telephone"])
async def test_everything_is_large_enough_for_gloves_and_dark_enough_for_a_hall(
    open_page: Opened, cell: Cell, axe: str, theme: str, size: tuple[int, int]
) -> None:
    await calibrate(cell)
    viewport = dict(zip(("width", "height"), size, strict=True))
    async with open_page("operator", "cell", f"lang=en&theme={theme}", viewport=viewport) as page:
        await page.locator("dl.line").wait_for()
        await page.evaluate(axe)
        for place in PLACES:
            await page.evaluate("place => { location.hash = '#/' + place }", place)
            await page.locator("main .card").locator("visible=true").first.wait_for()
            small = await page.evaluate(TOO_SMALL, [LEAST_PX, LEAST_MOVING_PX, LEAST_TEXT_PX])
            assert small == [], place
            assert await page.evaluate(FAINT) == [], place


@pytest.mark.parametrize("size", [(1366, 768), (390, 844)], ids=["screen", "telephone"])
async def test_from_the_start_to_the_result_nothing_jumps_and_something_moves_while_the_daemon_plans(
    open_page: Opened, cell: Cell, size: tuple[int, int]
) -> None:
    """The seconds go on, also before the first picture: here the arm stands still for as long as that takes."""
    bench, _ = cell
    bench.robot.before_move = gate = Gate(len(bench.robot.goals) + 1)
    last = Gate(len(bench.robot.goals) + len(poses_around_the_target()))
    try:
        async with open_page("operator", viewport=dict(zip(("width", "height"), size, strict=True))) as page:
            await page.add_init_script(COUNT_SHIFTS)
            await page.goto("about:blank")
            await page.goto(f"{bench.url}/page/?lang=en#/calibrate")
            await page.get_by_text("Ready.").wait_for()

            async def reached() -> bool:
                return gate.reached.is_set()

            await hold_until(page, hold_by_mouse, "Calibrate (arm moves)", reached)
            times = page.locator(".times")
            await times.filter(has_text="s so far").wait_for()
            said: list[Any] = []
            while len(said) < 4:
                said.append(await times.inner_text())
                await page.wait_for_function(
                    "before => document.querySelector('.times').innerText !== before", arg=said[-1]
                )
            seconds = [int("".join(filter(str.isdigit, text.split("·")[0]))) for text in said]
            assert seconds == sorted(set(seconds)), said
            bench.robot.before_move = last
            gate.open.set()
            await last.reached.wait()
            await page.locator(".film button").nth(last.at_move - gate.at_move - 1).wait_for()
            last.open.set()
            await page.get_by_text("✓ Good").wait_for()
            await page.locator(".result #compare").wait_for()
            await page.locator(".result .flush image").wait_for()
            await page.evaluate(TWO_FRAMES)
            shifts = await page.evaluate("shifted")
            assert sum(value for value, _ in shifts) <= MAX_SHIFT, json.dumps(shifts)
    finally:
        bench.robot.before_move = None
        gate.open.set()
        last.open.set()

"""The page as a cockpit: what has to be seen and reached without scrolling, at the sizes that people have."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from tests.daemon.access_keys import bearer
from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.fakes import Gate
from tests.daemon.page.conftest import Opened, page_of
from tests.daemon.page.holding import hold_by_key, hold_until
from tests.support.waiting import LIMIT_S

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow]

SCREEN = {"width": 1366, "height": 768}
PHONE = {"width": 390, "height": 844}
Cell = tuple[Bench, dict[str, str]]


async def box_of(page: Any, selector: str) -> Any:
    """x, y, width and height of the one visible element; the place is waited for."""
    found = page.locator(selector).locator("visible=true")
    await found.first.wait_for()
    assert await found.count() == 1, (selector, await found.count())
    return await found.bounding_box()


async def calibrated(cell: Cell) -> str:
    """The id of a calibration that was activated."""
    bench, keys = cell
    answer = await bench.client.post(
        "/calibrate", json={"count": 5}, params={"wait": LIMIT_S}, headers=bearer(keys["operator"])
    )
    made: str = answer.json()["result"]["calibration_id"]
    applied = await bench.client.post(
        f"/calibrations/{made}/apply", json={"applied_by": "operator"}, headers=bearer(keys["operator"])
    )
    assert applied.status_code == 200, applied.text
    return made


@pytest.mark.parametrize(("place", "least_px"), [("cell", 640), ("calibrate", 640), ("verify", 640), ("result", 500)])
async def test_picture_number_and_action_are_on_the_first_screen(
    open_page: Opened, cell: Cell, place: str, least_px: int
) -> None:
    await calibrated(cell)
    async with open_page("operator", place, viewport=SCREEN) as page:
        picture = await box_of(page, ".flush .picture .frame")
        assert picture["width"] >= least_px
        assert picture["y"] + picture["height"] <= SCREEN["height"]
        if place in ("cell", "result"):
            number = await box_of(page, ".figure")
            assert number["y"] + number["height"] <= 480
        if place != "result":
            action = await box_of(page, "main .primary")
            assert action["y"] + action["height"] <= SCREEN["height"]
            assert action["width"] >= 200 and action["height"] >= 60
        assert (await box_of(page, ".top"))["height"] <= 64
        assert await page.evaluate("scrollY") == 0


async def test_a_telephone_shows_sentence_number_picture_and_action_at_once(open_page: Opened, cell: Cell) -> None:
    await calibrated(cell)
    async with open_page("operator", "cell", viewport=PHONE, has_touch=True) as page:
        action = await box_of(page, "main .primary")
        assert action["y"] + action["height"] <= PHONE["height"]
        for selector in (".bar-top .sentence", ".figure", ".flush .picture .frame"):
            box = await box_of(page, selector)
            assert box["y"] + box["height"] <= action["y"], selector
        assert (await box_of(page, ".top"))["height"] <= 56


@pytest.mark.parametrize("language", ["en", "de"])
async def test_the_six_places_stand_in_one_row(open_page: Opened, language: str) -> None:
    async with open_page("admin", "cell", f"lang={language}", viewport={"width": 1024, "height": 768}) as page:
        await page.locator("#places a").first.wait_for()
        links = page.locator("#places a").locator("visible=true")
        assert await links.count() == 6
        assert len({(await links.nth(index).bounding_box())["y"] for index in range(6)}) == 1


async def test_a_calibration_has_one_address_from_its_start_to_its_result(open_page: Opened, cell: Cell) -> None:
    bench, _ = cell
    bench.robot.before_move = gate = Gate(len(bench.robot.goals) + 2)
    try:
        async with open_page("operator", "calibrate", viewport=PHONE, has_touch=True) as page:
            await page.get_by_text("Ready.").wait_for()

            async def reached() -> bool:
                return gate.reached.is_set()

            await hold_until(page, hold_by_key, "Calibrate (arm moves)", reached)
            await page.get_by_text("Picture 2 of").first.wait_for()
            address = page.url
            end = await box_of(page, ".end-run")
            assert end["x"] >= 0 and end["x"] + end["width"] <= PHONE["width"]
            gate.open.set()
            await page.get_by_text("✓ Good").wait_for()
            assert page.url == address and "#/calibrate/" in address
            assert await page.evaluate("document.activeElement.tagName") == "H1", "the focus is not lost"
    finally:
        gate.open.set()
        bench.robot.before_move = None


MISSES = (
    "[...document.querySelectorAll('.views tbody tr')].map((row) => row.querySelector('.bar-cell').textContent).join()"
)
"""Of the pictures in the table, px."""


async def test_a_picture_misses_by_as_much_on_run_and_on_result(open_page: Opened, cell: Cell) -> None:
    """From the pose as reported, as the arrows beside show it; the corrected pose is chosen."""
    made = await calibrated(cell)
    bench, keys = cell
    views = (await bench.client.get(f"/runs/{made}/views", headers=bearer(keys["viewer"]))).json()
    reported, corrected = (",".join([text] * len(views["views"])) for text in ("0.500", "0.070"))
    views["views"] = [view | {"rms_px": 0.5, "rms_px_free": 0.07} for view in views["views"]]
    for place in (f"run/{made}", "result"):
        async with open_page("viewer", "cell", viewport=SCREEN) as page:
            await page.route("**/runs/*/views", lambda route: route.fulfill(json=views))
            await page.evaluate("place => { location.hash = '#/' + place }", place)
            await page.wait_for_function(f"text => {MISSES} === text", arg=reported)
            if place == "result":
                await page.get_by_label("With the correction of this robot pose").check()
                await page.wait_for_function(f"text => {MISSES} === text", arg=corrected)


FRAME = "document.querySelector('.views').parentElement"


@pytest.mark.parametrize("language", ["en", "de", "es"])
async def test_every_column_of_the_pictures_is_in_view(open_page: Opened, cell: Cell, language: str) -> None:
    await calibrated(cell)
    async with open_page("viewer", "result", f"lang={language}", viewport=SCREEN) as page:
        await page.locator(".views tbody tr").first.wait_for()
        assert await page.evaluate(f"{FRAME}.scrollWidth <= {FRAME}.clientWidth")


LINES = """([button, why]) => [button, why].map((selector) => {
  const words = document.createRange();
  words.selectNodeContents(document.querySelector(selector));
  const { top, bottom } = words.getBoundingClientRect();
  return [top, bottom];
})"""
"""Upper and lower end of the text, px."""


@pytest.mark.parametrize("role", ["operator", "viewer"])
@pytest.mark.parametrize("language", ["en", "de", "es"])
async def test_why_the_arm_cannot_be_moved_does_not_lie_on_the_name_of_the_button(
    open_page: Opened, cell: Cell, language: str, role: str
) -> None:
    """While a run is in progress, and for who may not: the sentence of a viewer has two lines."""
    await calibrated(cell)
    bench, keys = cell
    bench.robot.before_move = gate = Gate(len(bench.robot.goals) + 1)
    run = (await bench.client.post("/verify", headers=bearer(keys["operator"]))).json()["id"]
    try:
        async with open_page(role, "cell", f"lang={language}", viewport=SCREEN) as page:
            await page.locator("#hold-verify[aria-disabled=true]").wait_for()
            name, why = await page.evaluate(LINES, ["#hold-verify .label", "#hold-verify-how"])
            assert name[1] <= why[0] + 1
            box = await box_of(page, "#hold-verify")
            assert why[1] <= box["y"] + box["height"]
    finally:
        gate.open.set()
        bench.robot.before_move = None
        await bench.client.get(f"/runs/{run}", params={"wait": LIMIT_S}, headers=bearer(keys["operator"]))


async def test_the_arm_is_moved_in_a_drawer_beside_the_picture(open_page: Opened, cell: Cell) -> None:
    async with open_page("operator", "cell", viewport=SCREEN) as page:
        await page.get_by_role("button", name="Move arm").press("Enter")
        drawer = await box_of(page, ".drawer")
        picture = await box_of(page, ".flush .picture .frame")
        assert picture["x"] + picture["width"] <= drawer["x"]
        await page.keyboard.press("Escape")
        await page.locator(".drawer").wait_for(state="detached")
        assert await page.evaluate("document.activeElement.textContent") == "Move arm"


@pytest.mark.parametrize("picture", ["wall", "target"])
async def test_after_a_run_that_was_aborted_the_cell_is_ready_only_with_the_target_in_view(
    browser: Any, tmp_path: Path, picture: str
) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(1)  # no picture was taken: nobody knows where the target was seen
    async with page_of(browser, viewport=SCREEN) as page, serving(settings_for(tmp_path), parts) as bench:
        started = (await bench.client.post("/calibrate")).json()
        await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        assert (await bench.client.post(started["links"]["abort"])).json()["state"] == "aborted"
        parts.camera.blind = lambda number: picture == "wall"
        await page.goto(f"{bench.url}/page/?lang=en#/cell")
        primary = page.locator("main .primary").locator("visible=true")
        if picture == "target":
            await page.get_by_text("Not calibrated yet.").wait_for()
            assert await primary.text_content() == "Calibrate …"
            return
        await page.get_by_text("Not calibrated, and the camera does not see the target.").wait_for()
        assert await page.get_by_text("Ready").count() == 0
        assert await primary.count() == 1
        await primary.press("Enter")
        await page.locator(".drawer").wait_for()

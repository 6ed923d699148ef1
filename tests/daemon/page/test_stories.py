"""The page as people use it: from signing in to an active calibration, by mouse, finger and keyboard; roles; links."""

import asyncio
import re
from typing import Any

import pytest

from tests.daemon.cell_under_test import Bench
from tests.daemon.fakes import Gate, poses_around_the_target
from tests.daemon.page.conftest import AXE_FINDINGS, COUNT_SHIFTS, MAX_SHIFT, SHOWN, TWO_FRAMES, Opened
from tests.daemon.page.holding import hold_by_finger, hold_by_key, hold_by_mouse, hold_until, press
from tests.support.waiting import eventually

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow]


@pytest.mark.parametrize(
    ("hold", "context"),
    [
        pytest.param(hold_by_mouse, {}, id="mouse"),
        pytest.param(hold_by_finger, {"has_touch": True, "viewport": {"width": 360, "height": 780}}, id="finger"),
        pytest.param(hold_by_key, {}, id="keyboard"),
    ],
)
async def test_from_signing_in_to_a_calibration_in_force(
    open_page: Opened, cell: tuple[Bench, dict[str, str]], hold: Any, context: dict[str, Any]
) -> None:
    bench, keys = cell
    async with open_page(place="calibrate", **context) as page:
        await page.get_by_label("Key or code").fill(keys["operator"])
        await page.keyboard.press("Enter")
        await page.get_by_text("Ready.").wait_for()
        good = page.get_by_text("✓ Good")
        await hold_until(page, hold, "Calibrate (arm moves)", good.is_visible)
        newest = (await bench.client.get("/runs", headers={"Authorization": f"Bearer {keys['viewer']}"})).json()[
            "runs"
        ][0]
        assert newest["started_by"] == "operator"
        await hold_until(page, hold, "Activate", page.get_by_text("Active since").is_visible)
    now = await bench.client.get("/calibrations/current", headers={"Authorization": f"Bearer {keys['viewer']}"})
    assert now.json()["applied"]["calibration_id"] == newest["result"]["calibration_id"]


async def test_what_moves_the_arm_is_held(open_page: Opened, cell: tuple[Bench, dict[str, str]]) -> None:
    async with open_page("operator", "calibrate") as page:
        asked: list[str] = []
        page.on(
            "request",
            lambda request: (
                asked.append(request.url) if request.method == "POST" and "touch" not in request.url else None
            ),
        )
        await page.get_by_text("Ready.").wait_for()
        button = page.get_by_role("button", name="Calibrate (arm moves)")
        await button.click()
        await button.dblclick()
        await button.click(delay=600)
        await press(button)
        assert asked == []


async def test_a_viewer_sees_everything_and_starts_nothing(open_page: Opened) -> None:
    async with open_page("viewer", "calibrate") as page:
        button = page.get_by_role("button", name="Calibrate (arm moves)")
        await button.wait_for()
        assert await button.get_attribute("aria-disabled") == "true"
        assert await page.get_by_role("button", name="End run").get_attribute("aria-disabled") == "true"
        await page.evaluate("location.hash = '#/history'")
        await page.get_by_role("heading", name="History").first.wait_for()
        assert await page.get_by_role("link", name="Log").count() == 0
        await page.evaluate("location.hash = '#/audit'")
        await page.get_by_text("Your role does not allow this").first.wait_for()


async def test_without_the_stream_nothing_can_be_started(open_page: Opened) -> None:
    async with open_page("operator", "help") as page:
        await page.get_by_text("● live").wait_for()
        await page.context.route("**/live", lambda route: route.abort())
        await page.goto("about:blank")
        await page.go_back()
        await page.get_by_text("No connection to the daemon").wait_for()
        await page.evaluate("location.hash = '#/calibrate'")
        button = page.get_by_role("button", name="Calibrate (arm moves)")
        await button.wait_for()
        assert await button.get_attribute("aria-disabled") == "true"
        await page.context.unroute("**/live")
        await page.get_by_text("● live").wait_for()
        await page.get_by_text("Hold for one second").wait_for()


async def test_a_screen_that_could_not_be_fetched_is_fetched_again(open_page: Opened) -> None:
    async with open_page("viewer", "help") as page:
        await page.get_by_text("● live").wait_for()
        await page.context.route("**/screens/audit.js", lambda route: route.abort(), times=1)
        await page.evaluate("location.hash = '#/audit'")
        await page.get_by_text("Your role does not allow this").first.wait_for()


LATE_EFFECTS = """() => {
    const soon = window.setTimeout;
    window.requestAnimationFrame = (call) => soon(call, 3000);
    window.setTimeout = (call, ms, ...rest) => soon(call, ms > 0 && ms < 200 ? 3000 : ms, ...rest);
}"""
"""Preact calls effects after the next frame or 35 ms: here later than the screen comes."""


async def test_a_screen_that_comes_before_its_effect_is_shown(open_page: Opened) -> None:
    asked, shown = asyncio.Event(), asyncio.Event()

    async def hold(route: Any) -> None:
        asked.set()
        await shown.wait()
        await route.continue_()

    async with open_page("viewer", "help") as page:
        await page.context.route("**/screens/audit.js", hold)
        await page.reload()
        await page.get_by_text("● live").wait_for()
        await asked.wait()
        await page.evaluate(LATE_EFFECTS)
        await page.evaluate("location.hash = '#/audit'")
        await page.get_by_text("Asking").wait_for()
        shown.set()
        await page.get_by_text("Your role does not allow this").first.wait_for()


async def test_ten_tabs_share_one_stream(open_page: Opened) -> None:
    async with open_page("viewer", "devices") as first:
        await first.get_by_text("● live").wait_for()
        streams = open_streams(first.context)
        tabs = [await first.context.new_page() for _ in range(9)]
        for tab in tabs:
            await tab.goto(first.url)
            await tab.get_by_text("● live").wait_for()
        await eventually(lambda: len(streams) <= 1)  # a tab that hears nothing for 4 s takes over
        await first.close()
        await tabs[-1].get_by_text("● live").wait_for()
        await eventually(lambda: len(streams) == 1)
        await tabs[-1].get_by_text("● live").wait_for()


def open_streams(context: Any) -> set[Any]:
    """The requests for /live from now on that have not ended."""
    streams: set[Any] = set()

    def begun(request: Any) -> None:
        if request.url.endswith("/live"):
            streams.add(request)

    def ended(request: Any) -> None:
        streams.discard(request)

    context.on("request", begun)
    context.on("requestfinished", ended)
    context.on("requestfailed", ended)
    return streams


async def test_two_people_see_each_others_acts(open_page: Opened, cell: tuple[Bench, dict[str, str]]) -> None:
    bench, _ = cell
    bench.robot.before_move = gate = Gate(len(bench.robot.goals) + 2)

    async def reached() -> bool:
        return gate.reached.is_set()

    try:
        async with open_page("operator", "calibrate") as ann, open_page("admin", "cell") as ben:
            await ben.get_by_text("● live").wait_for()
            await ann.get_by_text("Ready.").wait_for()
            await hold_until(ann, hold_by_mouse, "Calibrate (arm moves)", reached)
            await ben.get_by_text("operator, since").first.wait_for()
            await ben.get_by_role("button", name="End run").click()
            await ann.get_by_text("ended before its end").first.wait_for()
    finally:
        gate.open.set()
        bench.robot.before_move = None


@pytest.mark.parametrize("width", [360, 800, 1280, 1920])
async def test_end_run_is_in_view_and_nothing_overflows(open_page: Opened, width: int) -> None:
    for query in ("lang=pseudo", "lang=de&scale=1.5"):
        async with open_page("admin", "cell", query, viewport={"width": width, "height": 780}) as page:
            await page.locator(".figure, .sentence, .card p").first.wait_for()
            for place in ("cell", "calibrate", "result", "verify", "scans", "history", "settings", "help"):
                await page.evaluate("place => { location.hash = '#/' + place }", place)
                await page.locator(".card").first.wait_for()
                await page.wait_for_timeout(150)
                await page.wait_for_function("document.documentElement.scrollWidth <= innerWidth")
                if width <= 360:  # a telephone shows "End run" while there is a run
                    continue
                box = await page.locator(".end-run").bounding_box()
                assert box["x"] >= 0 and box["x"] + box["width"] <= width and box["y"] + box["height"] <= 780


PLACES = (
    "sign-in", "cell", "calibrate", "run", "result", "verify", "scans", "jog", "devices", "history", "audit",
    "settings", "help",
)  # fmt: skip


async def test_what_comes_late_moves_nothing(open_page: Opened) -> None:
    """Every answer of the daemon is held back until the page is drawn without it, on each place."""
    async with open_page("admin", viewport={"width": 412, "height": 780}) as page:
        index = page.url.split("#")[0]
        drawn = asyncio.Event()

        async def answer(route: Any) -> None:
            await drawn.wait()
            await route.continue_()

        await page.add_init_script(COUNT_SHIFTS)
        await page.route(re.compile(r"^http://[^/]+/(?!page/)"), answer)

        async def shifts_of(place: str) -> list[Any]:
            drawn.clear()
            await page.goto("about:blank")
            await page.goto(f"{index}#/{place}")
            await page.locator("dl.line").wait_for()
            await page.evaluate(TWO_FRAMES)
            drawn.set()
            await page.locator("main .card").first.wait_for()
            await page.get_by_text("● live").wait_for()
            await page.evaluate(TWO_FRAMES)
            shifts: list[Any] = await page.evaluate("shifted")
            return shifts

        shifts = {place: await shifts_of(place) for place in PLACES}
        assert {place: moved for place, moved in shifts.items() if sum(value for value, _ in moved) > MAX_SHIFT} == {}
        await page.unroute_all(behavior="ignoreErrors")


@pytest.mark.parametrize(("language", "theme"), SHOWN)
async def test_axe_finds_nothing(open_page: Opened, axe: str, theme: str, language: str) -> None:
    async with open_page("admin", "cell", f"lang={language}&theme={theme}") as page:
        await page.locator("dl.line").wait_for()
        await page.evaluate(axe)
        for place in PLACES:
            await page.evaluate("place => { location.hash = '#/' + place }", place)
            await page.locator("main .card").first.wait_for()
            await page.wait_for_timeout(150)
            found = await page.evaluate(AXE_FINDINGS)
            assert found == [], place


async def test_hostile_names_stay_text(open_page: Opened, cell: tuple[Bench, dict[str, str]]) -> None:
    bench, keys = cell
    name = "<img src=x onerror=alert(1)><script>alert(2)</script>"
    made = await bench.client.post(
        "/scans", json={"name": name}, headers={"Authorization": f"Bearer {keys['operator']}"}
    )
    assert made.status_code == 201
    async with open_page("viewer", "scans") as page:
        await page.get_by_text(name).first.wait_for()
        for place in ("history", f"scans/{made.json()['id']}", "help/%3Cimg%20src=x%3E", "run/%3Cscript%3E"):
            await page.evaluate("place => { location.hash = '#/' + place }", place)
            await page.locator("main .card, main .quiet").first.wait_for()
            assert await page.locator("main img, main script").count() == 0


async def test_by_hand_the_arm_is_jogged_and_never_moved(open_page: Opened, cell: tuple[Bench, dict[str, str]]) -> None:
    bench, keys = cell
    moves = len(bench.robot.goals)
    async with open_page("operator", "calibrate") as page:
        await page.get_by_text("Ready.").wait_for()
        await page.get_by_label("Guided by hand").check()
        await page.get_by_role("button", name="Begin by hand").click()
        for pose in poses_around_the_target(4):
            bench.robot.base_T_flange = pose.copy()
            await page.get_by_role("button", name="Take picture").and_(page.locator(":not([aria-disabled])")).click()
            await page.get_by_role("button", name="Take picture").and_(page.locator(":not([aria-disabled])")).wait_for()
        await page.get_by_role("button", name="Finish").and_(page.locator(":not([aria-disabled])")).click()
        await page.get_by_text("✓ Good").wait_for()
    assert len(bench.robot.goals) == moves
    newest = (await bench.client.get("/runs", headers={"Authorization": f"Bearer {keys['viewer']}"})).json()["runs"][0]
    assert (newest["state"], newest["request"]["manual"]) == ("finished", True)

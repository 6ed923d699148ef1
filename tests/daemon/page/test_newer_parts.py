"""Jogs, touch tests, rigs and the arm's own errors as people use them on the page."""

import json
import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pytest_asyncio

from calibration.documents.calibration import CalibrationFindingDocument
from calibration.documents.more_arm_views import MoreArmViewsDocument, PointAfterViewsDocument
from daemon.model.records import AppliedCalibration, CalibrationRecord
from tests.daemon.access_keys import bearer, with_keys
from tests.daemon.calibrations import an_arm, document_with_covariance, with_views
from tests.daemon.cell_under_test import Bench
from tests.daemon.fakes import ply_of
from tests.daemon.page.conftest import AXE_FINDINGS, SHOWN, Opened
from tests.daemon.page.holding import hold_by_key, hold_by_mouse, hold_requests, hold_until, press
from tests.daemon.rig_files import a_rig
from tests.extensions.touch.touches import TIP, touch_two_points, touching
from tests.support.waiting import eventually

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow]

Cell = tuple[Bench, dict[str, str]]

MORE_VIEWS = MoreArmViewsDocument(
    box_mm=((400.0, -200.0, 0.0), (800.0, 200.0, 400.0)),
    points=64,
    now_mm=0.42,
    after=[PointAfterViewsDocument(more=10, point_mm=0.2), PointAfterViewsDocument(more=30, point_mm=0.15)],
    further=[],
)

ARM_FINDING = {
    "code": "arm-errors", "severity": "info", "message": "the arm is not as drawn", "fix": "nothing to do",
    "id": "arm-errors", "params": {"after_mm": 0.2, "before_mm": 0.5},
    "advice": {"id": "as-written", "params": {"sentence": "nothing to do"}},
}  # fmt: skip


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def cell(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Cell]:
    """The fake cell with an active calibration that knows its uncertainty and the errors of its arm."""
    async with with_keys(tmp_path_factory.mktemp("page"), robot={"model": "IRB 1600-6/1.45"}) as (bench, keys):
        document = with_views(document_with_covariance())
        finding = CalibrationFindingDocument.model_validate(ARM_FINDING)
        verdict = document.verdict.model_copy(update={"findings": [finding]})
        document = document.model_copy(update={"verdict": verdict})
        store = bench.application.store
        await store.save_calibration(
            CalibrationRecord("cal-1", None, document.created_at, True, document),
            an_arm(zero_2=1e-3, link_1_tx=0.4).model_copy(update={"more_views": MORE_VIEWS}),
        )
        await store.apply(AppliedCalibration("cal-1", document.created_at, "test"))
        bench.client.headers.update(bearer(keys["admin"]))
        await bench.verify()
        yield bench, keys


def written(folder: Path, name: str, document: Any) -> Path:
    file = folder / name
    file.write_text(json.dumps(document))
    return file


@pytest.mark.parametrize("hold", [pytest.param(hold_by_mouse, id="mouse"), pytest.param(hold_by_key, id="keyboard")])
async def test_a_jog_moves_the_flange_by_the_step_that_its_button_names(
    open_page: Opened, cell: Cell, hold: Any
) -> None:
    bench, _ = cell
    async with open_page("operator", "jog") as page:
        asked: list[Any] = []
        page.on("request", lambda request: asked.append(request) if request.url.endswith("/robot/jog") else None)
        for chip in ("Shift", "Z", "50 mm"):
            await press(page.get_by_role("button", name=chip, exact=True))
        before = bench.robot.base_T_flange[2, 3]

        async def moved() -> bool:
            return bool(bench.robot.base_T_flange[2, 3] != before)

        await hold_until(page, hold, "Z +50 mm", moved)
        await page.get_by_text("✓ The arm stands.").wait_for()
        assert bench.robot.base_T_flange[2, 3] - before == pytest.approx(50.0)
        assert len({request.headers["idempotency-key"] for request in asked}) == len(asked) == 1

        await hold_until(page, hold, "Z −50 mm", lambda: _is(lambda: bench.robot.base_T_flange[2, 3] == before))


async def _is(true: Any) -> bool:
    return bool(true())


async def test_a_jog_that_is_refused_says_why(open_page: Opened, cell: Cell) -> None:
    bench, _ = cell
    goals = len(bench.robot.goals)
    async with open_page("operator", "jog", "lang=de") as page:
        refusal = page.get_by_text("Achsen werden nur über die CB-Verbindung bewegt").first
        await hold_until(page, hold_by_mouse, "Achse 1 +5°", refusal.is_visible)
        await page.get_by_role("button", name="Alle Achsen").click()
        await page.get_by_label("Achse 2, °").fill("zwei")
        await page.get_by_text("Jede Achse braucht eine Zahl.").wait_for()
    assert len(bench.robot.goals) == goals


async def take_view(page: Any, number: int) -> None:
    """Press *Take picture*, and wait until the page asks for the view after it."""
    await press(page.get_by_role("button", name="Take picture"))
    await page.get_by_text(f"Picture {number + 1} of").wait_for()
    await page.get_by_role("button", name="Take picture").and_(page.locator(":not([aria-disabled])")).wait_for()


@pytest_asyncio.fixture(loop_scope="module")
async def by_hand(cell: Cell) -> AsyncIterator[str]:
    """The id of a manual run that waits for its first view; ended afterwards."""
    bench, _ = cell
    stood = bench.robot.base_T_flange.copy()
    begun = await bench.client.post("/calibrate", json={"manual": True})
    run_id: str = begun.json()["id"]
    yield run_id
    await bench.client.post(f"/runs/{run_id}/abort")
    bench.robot.base_T_flange = stood


@pytest.mark.parametrize("hold", [pytest.param(hold_by_mouse, id="mouse"), pytest.param(hold_by_key, id="keyboard")])
async def test_between_two_views_by_hand_the_page_jogs_the_arm(
    open_page: Opened, cell: Cell, by_hand: str, hold: Any
) -> None:
    bench, _ = cell
    async with open_page("operator", "run") as page:
        asked: list[Any] = []
        page.on("request", lambda request: asked.append(request) if request.url.endswith("/jog") else None)
        await take_view(page, 1)
        up = page.locator(".way-bar", has_text="Move Z").locator(".value")
        up_mm = re.search(r"[+−]?\d+", await up.inner_text())
        assert up_mm

        refusal = page.get_by_text("axes are moved over the CB link only").first
        await hold_until(page, hold, "Axis 1 +5°", refusal.is_visible)

        for chip in ("Shift", "Z", "50 mm"):
            await press(page.get_by_role("button", name=chip, exact=True))
        before = bench.robot.base_T_flange[2, 3]
        await hold_until(page, hold, "Z +50 mm", lambda: _is(lambda: bench.robot.base_T_flange[2, 3] != before))
        await page.get_by_text("✓ The arm stands.").wait_for()
        assert bench.robot.base_T_flange[2, 3] - before == pytest.approx(50.0)
        assert not bench.robot.armed
        left_mm = f"{int(up_mm[0].replace('−', '-')) - 50:+d}".replace("-", "−")
        await up.get_by_text(f"{left_mm} mm").wait_for()

        await take_view(page, 2)
        assert {request.url for request in asked} == {f"{bench.url}/runs/{by_hand}/jog"}
        assert len({request.headers["idempotency-key"] for request in asked}) == len(asked) == 2


async def test_a_viewer_of_a_run_by_hand_jogs_nothing(open_page: Opened, by_hand: str) -> None:
    async with open_page("viewer", "run") as page:
        button = page.get_by_role("button", name="Axis 1 +5°")
        await button.wait_for()
        assert await button.get_attribute("aria-disabled") == "true"


async def test_a_robot_that_is_only_read_is_jogged_with_the_pendant(open_page: Opened, by_hand: str) -> None:
    async def only_read(route: Any) -> None:
        answer = await route.fetch()
        await route.fulfill(response=answer, json=await answer.json() | {"moves": False})

    async with open_page("operator", "help") as page:
        await page.route("**/arm", only_read)
        await page.evaluate("location.hash = '#/run'")
        await page.get_by_text("Nothing moves by itself: jog with the pendant.").wait_for()
        await page.get_by_role("button", name="Take picture").wait_for()
        assert await page.locator(".hold-button").count() == 0
        await page.unroute_all(behavior="ignoreErrors")


async def test_a_run_by_hand_is_accessible_and_overflows_nowhere(open_page: Opened, by_hand: str, axe: str) -> None:
    async with open_page("operator", "run", viewport={"width": 360, "height": 780}) as page:
        address = page.url
        for language in ("en", "de", "zh", "es", "pseudo"):
            for theme in ("light", "dark"):
                await page.goto("about:blank")
                await page.goto(address.replace("lang=en", f"lang={language}&theme={theme}"))
                await page.locator("#hold-plus").wait_for()
                await page.wait_for_timeout(300)
                await page.evaluate(axe)
                assert await page.evaluate(AXE_FINDINGS) == [], (language, theme)
                assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth"), language


async def test_points_are_touched_one_after_the_other_by_keyboard_alone(
    open_page: Opened, cell: Cell, tmp_path: Path
) -> None:
    bench, keys = cell
    goals = len(bench.robot.goals)
    stood = bench.robot.base_T_flange.copy()
    async with open_page("operator", "verify/touch") as page:
        take = page.get_by_role("button", name="The tip is at point")
        assert await take.get_attribute("aria-disabled") == "true"
        await page.locator("section[aria-labelledby=touch] input[type=file]").set_input_files(
            written(tmp_path, "tip.json", TIP)
        )
        await page.get_by_label("Tolerance, mm").fill("1,0")
        bench.robot.base_T_flange = touching(0)
        await press(page.get_by_role("button", name="The tip is at point 0"))
        await page.get_by_text("✓ Within the tolerance of 1.0 mm").first.wait_for()
        bench.robot.base_T_flange = touching(10, (2.0, 0.0, 0.0))
        await press(page.get_by_role("button", name="The tip is at point 10"))
        await page.get_by_text("✕ Beyond the tolerance of 1.0 mm").first.wait_for()
        await page.get_by_role("rowheader", name="Point 10").wait_for()
        await page.locator("section[aria-labelledby=touches] .timeline li").nth(1).wait_for()
        assert await page.locator("section[aria-labelledby=touches] .timeline li").count() == 2
        await page.locator("section[aria-labelledby=touches] svg .alarm-dot").wait_for()
    bench.robot.base_T_flange = stood
    assert len(bench.robot.goals) == goals
    stored = (await bench.client.get("/touches", headers=bearer(keys["viewer"]))).json()["touches"]
    assert [len(test["touches"]["touches"]) for test in stored] == [2, 1]
    assert stored[0]["created_by"] == "operator"


async def test_the_next_point_is_named_though_the_tests_are_answered_last(open_page: Opened, cell: Cell) -> None:
    bench, _ = cell
    cross = await touch_two_points(bench)
    async with open_page("operator", "help") as page:
        shown = await hold_requests(page, "**/touches?*")
        await page.evaluate("location.hash = '#/verify/touch'")
        await page.get_by_role("heading", name="Touch test", exact=True).wait_for(state="attached")
        shown.set()
        await page.get_by_role("button", name=f"The tip is at point {cross[2]}").wait_for()


async def test_a_touch_test_of_another_person_is_shown_at_once(open_page: Opened, cell: Cell) -> None:
    bench, _ = cell
    await touch_two_points(bench)
    async with open_page("viewer", "verify/touch") as page:
        tests = page.locator("section[aria-labelledby=touches] .timeline li")
        await tests.first.wait_for()
        before = await tests.count()
        await touch_two_points(bench)
        await tests.nth(before).wait_for()


async def test_a_touch_test_made_before_the_stream_is_open_is_shown(open_page: Opened, cell: Cell) -> None:
    bench, _ = cell
    await touch_two_points(bench)
    async with open_page("viewer", "help") as page:
        made = await hold_requests(page, "**/events")
        await page.evaluate("location.hash = '#/verify/touch'")
        await page.reload()
        tests = page.locator("section[aria-labelledby=touches] .timeline li")
        await tests.first.wait_for()
        before = await tests.count()
        await touch_two_points(bench)
        made.set()
        await tests.nth(before).wait_for()


async def test_a_rig_is_looked_at_and_put_in_force_from_its_file(open_page: Opened, cell: Cell, tmp_path: Path) -> None:
    bench, keys = cell
    await bench.client.post("/rigs", json=a_rig(shift_mm=5.0))
    async with open_page("operator", "devices") as page:
        chosen = page.locator("section[aria-labelledby=rig] input[type=file]")
        await chosen.set_input_files(written(tmp_path, "notes.json", [1, 2]))
        await page.get_by_text("notes.json is no rig.json").wait_for()
        await chosen.set_input_files(written(tmp_path, "refused.json", a_rig(accepted=False)))
        await page.get_by_text("only an admin can activate it").wait_for()
        await chosen.set_input_files(written(tmp_path, "rig.json", a_rig()))
        await page.get_by_role("region", name="rig.json").get_by_text("scanner in camera").wait_for()
        earlier = page.get_by_text("Earlier ones: 1")
        await hold_until(page, hold_by_key, "Activate", earlier.is_visible)
    rigs = (await bench.client.get("/rigs", headers=bearer(keys["viewer"]))).json()["rigs"]
    assert [(one["created_by"], one["rig"] == rigs[0]["rig"]) for one in rigs] == [("operator", True), ("admin", False)]


async def test_the_errors_of_the_arm_are_asked_for_and_shown_before_and_after(open_page: Opened, cell: Cell) -> None:
    bench, _ = cell
    async with open_page("operator", "calibrate") as page:
        await page.get_by_text("Ready.").wait_for()
        asked: list[Any] = []
        await page.route("**/plan", lambda route: _refuse(route, asked))
        await press(page.get_by_label("Find the errors of the arm, too"), "Space")
        await press(page.get_by_role("button", name="Show the poses"))
        await eventually(lambda: bool(asked))
        assert json.loads(asked[0]) == {"arm": True}
        await page.evaluate("location.hash = '#/result/cal-1'")
        await press(page.get_by_role("button", name="Errors of the arm"))
        await page.get_by_text("Errors of the arm are in use.").wait_for()
        await page.get_by_text("Before: missed by, as drawn").wait_for()
        await page.get_by_text("zero_2").wait_for()
        await page.get_by_text("30 more pictures would bring a registered point from 0.42 mm to 0.15 mm").wait_for()
        report = (await bench.client.get("/calibrations/cal-1/report", headers={"Accept": "text/html"})).text
        assert "30 pictures more would bring a registered point from 0.420 to 0.150 mm RMS" in report
        field = (await bench.client.get("/calibrations/cal-1/arm/field")).json()
        columns = {tuple(point["flange_mm"][:2]) for point in field["points"]}
        assert await page.locator(".field .bubble").count() == 2 * len(columns)


async def test_a_large_cloud_shows_how_much_of_it_was_sent(open_page: Opened, tmp_path: Path) -> None:
    file = tmp_path / "large.ply"
    file.write_bytes(ply_of(np.random.default_rng(0).normal([0, 0, 500], 50, (700_000, 3))))
    async with open_page("operator", "scans") as page:
        link = await page.context.new_cdp_session(page)
        slow = {"offline": False, "latency": 0, "downloadThroughput": -1, "uploadThroughput": 4_000_000}
        await link.send("Network.enable")
        await link.send("Network.emulateNetworkConditions", slow)
        await page.evaluate(WATCH_PROGRESS)
        await page.locator("section[aria-labelledby=new] input[type=file]").set_input_files(file)
        await page.get_by_role("heading", name="About this scan").wait_for()
        shares = await page.evaluate("shares")
    assert shares == sorted(shares)
    assert sum(0 < share < 1 for share in shares) >= 2, shares


WATCH_PROGRESS = """() => {
    window.shares = [];
    new MutationObserver(() => {
        const bar = document.querySelector('section[aria-labelledby=new] progress');
        if (bar) shares.push(bar.value);
    }).observe(document.body, { subtree: true, childList: true, attributes: true, characterData: true });
}"""


async def test_a_rig_of_another_person_is_shown_at_once(open_page: Opened, cell: Cell) -> None:
    bench, _ = cell
    await bench.client.post("/rigs", json=a_rig())
    earlier = len((await bench.client.get("/rigs")).json()["rigs"]) - 1
    async with open_page("viewer", "devices") as page:
        await page.locator("section[aria-labelledby=rig]").get_by_text("scanner in camera").first.wait_for()
        await bench.client.post("/rigs", json=a_rig(shift_mm=7.0))
        await page.get_by_text(f"Earlier ones: {earlier + 1}").wait_for()


async def _refuse(route: Any, asked: list[Any]) -> None:
    asked.append(route.request.post_data)
    await route.abort()


NEW = ("jog", "verify", "verify/touch", "devices", "result/cal-1", "calibrate")


@pytest.mark.parametrize(("language", "theme"), SHOWN)
async def test_axe_finds_nothing_where_all_of_it_is_shown(
    open_page: Opened, cell: Cell, axe: str, theme: str, language: str, tmp_path: Path
) -> None:
    bench, _ = cell
    await everything_stored(bench)
    async with open_page("admin", "jog", f"lang={language}&theme={theme}") as page:
        await page.locator("dl.line").wait_for()
        await page.evaluate(axe)
        for place in NEW:
            await page.evaluate("place => { location.hash = '#/' + place }", place)
            await page.locator("main .card").first.wait_for()
            await page.wait_for_timeout(300)
            assert await page.evaluate(AXE_FINDINGS) == [], place


@pytest.mark.parametrize("width", [360, 768, 1280, 1920])
async def test_nothing_new_overflows(open_page: Opened, cell: Cell, width: int) -> None:
    bench, _ = cell
    await everything_stored(bench)
    for query in ("lang=pseudo", "lang=de&scale=1.5"):
        async with open_page("admin", "jog", query, viewport={"width": width, "height": 780}) as page:
            for place in NEW:
                await page.evaluate("place => { location.hash = '#/' + place }", place)
                await page.locator(".card").first.wait_for()
                await page.wait_for_timeout(300)
                assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth"), (query, place)


async def everything_stored(bench: Bench) -> None:
    """A rig, one that was refused, and a touch test, unless they are there."""
    if (await bench.client.get("/touches")).json()["touches"]:
        return
    for body, query in ((a_rig(accepted=False), "?despite_verdict=true"), (a_rig(), "")):
        assert (await bench.client.post(f"/rigs{query}", json=body)).status_code == 201
    await touch_two_points(bench)

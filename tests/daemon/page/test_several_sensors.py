"""A cell with two cameras: a person chooses one by name, and each screen asks for it and drives it."""

import json
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

import pytest
import pytest_asyncio

from drivers.errors import DeviceUnreachable
from tests.daemon.access_keys import bearer, with_keys
from tests.daemon.cell_under_test import Bench, Parts
from tests.daemon.fakes import FakeCamera
from tests.daemon.named_cameras import WRIST, calibrate, wrist
from tests.daemon.page.conftest import Opened
from tests.daemon.page.holding import hold_by_key, hold_until, press
from tests.support.waiting import eventually

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow]

Cell = tuple[Bench, dict[str, str]]


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def cell(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Cell]:
    """The fake cell with a second camera, `wrist`, which is calibrated."""
    parts = Parts()
    parts.cameras["wrist"] = FakeCamera(parts.robot, flange_T_camera=WRIST)
    folder = tmp_path_factory.mktemp("page")
    async with with_keys(folder, parts, cameras={"wrist": wrist()}) as (bench, keys):
        bench.client.headers.update(bearer(keys["admin"]))
        await calibrate(bench.client, camera="wrist")
        yield bench, keys


async def test_each_screen_asks_for_the_camera_chosen(open_page: Opened, cell: Cell) -> None:
    async with open_page("operator", "cell") as page:
        asked: set[str] = set()
        page.on("request", lambda request: asked.add(request.url.removeprefix(cell[0].url)))
        await page.get_by_text("No calibration is active").first.wait_for()
        await press(page.get_by_role("button", name="wrist"))
        await page.get_by_text("No calibration is active").wait_for(state="detached")
        await eventually(lambda: "/camera/stream?width=480&camera=wrist" in asked)
        for place, path in (
            ("calibrate", "/calibrate?camera=wrist"),
            ("verify", "/drift?camera=wrist"),
            ("jog", "/calibrations/current?camera=wrist"),
        ):
            asked.clear()
            await page.evaluate("place => { location.hash = '#/' + place }", place)
            await eventually(lambda path=path: path in asked)
            assert await page.get_by_role("button", name="wrist").get_attribute("aria-pressed") == "true"


async def test_the_camera_chosen_is_planned_and_verified(open_page: Opened, cell: Cell) -> None:
    async with open_page("operator", "calibrate") as page:
        asked: list[Any] = []
        page.on("request", lambda request: asked.append(request) if request.method == "POST" else None)
        await press(page.get_by_role("button", name="wrist"))
        await press(page.get_by_role("button", name="Show the poses"))
        await eventually(lambda: any(request.url.endswith("/plan") for request in asked))
        await page.evaluate("location.hash = '#/verify'")
        await hold_until(page, hold_by_key, "Quick check (arm moves)", verification_asked(asked))
        bodies = {
            request.url.rsplit("/", 1)[-1]: json.loads(request.post_data) for request in asked if request.post_data
        }
        assert (bodies["plan"], bodies["verify"]) == ({"camera": "wrist"}, {"camera": "wrist"})


def verification_asked(asked: list[Any]) -> Callable[[], Awaitable[bool]]:
    async def is_among() -> bool:
        return any(request.url.endswith("/verify") for request in asked)

    return is_among


async def test_a_camera_that_does_not_answer_hinders_no_run_with_the_other(open_page: Opened, cell: Cell) -> None:
    camera = cell[0].camera
    async with open_page("operator", "verify") as page:
        reasons = page.locator(".bar-top")
        camera.failing = DeviceUnreachable("camera", "it does not answer", "switch it on")
        try:
            await reasons.get_by_text("it does not answer").wait_for()
            await press(page.get_by_role("button", name="wrist"))
            await reasons.get_by_text("it does not answer").wait_for(state="detached")
            await page.get_by_role("button", name="Quick check (arm moves)", disabled=False).wait_for()
        finally:
            camera.failing = None


async def test_a_result_is_shown_and_compared_as_of_its_own_camera(open_page: Opened, cell: Cell) -> None:
    bench, _ = cell
    listed = (await bench.client.get("/calibrations")).json()["calibrations"]
    assert [(row["camera"], row["current"]) for row in listed] == [("wrist", True)]
    async with open_page("viewer", "result") as page:
        await page.get_by_text("No calibration was made yet").first.wait_for()
        await press(page.get_by_role("button", name="wrist"))
        await page.get_by_text("Active since").first.wait_for()
        await page.evaluate("id => { location.hash = '#/result/' + id }", listed[0]["id"])
        await page.get_by_text("Active since").first.wait_for()
        assert await page.get_by_role("button", name="wrist").count() == 0

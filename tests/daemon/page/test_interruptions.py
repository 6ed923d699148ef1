"""What the page shows when something fails under it: daemon, robot, clock, calibration; files sent and fetched."""

import asyncio
import re
import tarfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.transforms import rotation_from_vector, transform
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.clouds import cloud
from tests.daemon.fakes import Gate, ply_of
from tests.daemon.knocked_camera import calibrated
from tests.daemon.page.conftest import AXE_FINDINGS, Opened, page_of
from tests.daemon.page.holding import press
from tests.support.waiting import LIMIT_S

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow]

LIVE = "● live"
LEVEL = [1.0, 1.0, 0.0]


async def test_a_daemon_that_ends_and_comes_back_is_followed_by_itself(browser: Any, axe: str, tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(2)
    async with page_of(browser) as page:
        async with serving(settings_for(tmp_path), parts) as bench:
            url = bench.url
            await page.goto(f"{url}/page/?lang=en#/run")
            await page.get_by_text(LIVE).wait_for()
            await bench.client.post("/calibrate")
            await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
            await page.get_by_text("the arm is moving").first.wait_for()
        await page.get_by_text("No connection to the daemon for").wait_for()
        await page.get_by_text(LIVE).wait_for(state="detached")
        await page.locator(".line .dimmed").wait_for()  # the robot is of before
        await page.evaluate(axe)
        assert await page.evaluate(AXE_FINDINGS) == [], "what is old can still be read"
        await page.route("**/runs?limit=1", lambda route: route.abort("connectionreset"), times=1)
        async with serving(settings_for(tmp_path, server={"port": int(url.rsplit(":", 1)[1])})):
            await page.get_by_text(LIVE).wait_for()
            await page.get_by_text("ended before its end").or_(page.get_by_text("✕ failed")).first.wait_for()
            await page.locator(".line .dimmed").wait_for(state="detached")
            await page.get_by_text("No connection to the daemon").wait_for(state="detached")


async def test_an_unplugged_robot_is_shown_and_nothing_can_be_started(
    open_page: Opened, cell: tuple[Bench, dict[str, str]]
) -> None:
    bench, _ = cell
    async with open_page("operator", "calibrate") as page:
        await page.get_by_text("Ready.").wait_for()
        bench.robot.lost = True
        try:
            await page.get_by_text("Not yet:").or_(page.get_by_text("look at the cable")).first.wait_for()
            await page.get_by_text("● motors on").wait_for(state="detached")
            button = page.get_by_role("button", name="Calibrate (arm moves)")
            await button.and_(page.locator("[aria-disabled=true]")).wait_for()
        finally:
            bench.robot.lost = False
        await page.get_by_text("● motors on").wait_for()
        await page.get_by_text("Ready.").wait_for()


async def test_a_clock_that_jumps_changes_no_age(open_page: Opened) -> None:
    async with open_page("viewer", "cell") as page:
        await page.get_by_text(LIVE).wait_for()
        for hours in (5, -5):
            async with page.expect_request("**/live"):
                await page.evaluate("hours => { const now = Date.now; Date.now = () => now() + hours * 3.6e6 }", hours)
            await page.get_by_text(LIVE).wait_for()
            await page.get_by_text("No connection to the daemon").wait_for(state="detached")


async def test_a_drift_alarm_is_shown_where_the_calibration_is_used(browser: Any, tmp_path: Path) -> None:
    async with page_of(browser) as page, calibrated(tmp_path) as (bench, camera):
        for _ in range(3):
            await bench.verify()
        await page.goto(f"{bench.url}/page/?lang=en#/verify")
        await page.get_by_text("✓ It still holds").wait_for()
        camera.knock = transform(rotation_from_vector(np.array([0.0, 0.02, 0.0])), [0.0, 0.0, 0.0])
        await bench.verify()
        await page.get_by_text("▲ drifting").wait_for()
        await page.locator(".banner").first.wait_for()
        await page.evaluate("location.hash = '#/cell'")
        await page.get_by_text("▲ drifting").wait_for()


async def test_clouds_sent_from_the_page_are_placed_and_shown(
    open_page: Opened, cell: tuple[Bench, dict[str, str]]
) -> None:
    await apply_calibration(cell[0])
    files = [
        {"name": f"part-{seed}.ply", "mimeType": "application/x-ply", "buffer": ply_of(cloud(4000, seed) * LEVEL)}
        for seed in (1, 2)
    ]
    async with open_page("operator", "scans") as page:
        await page.get_by_label("Name of the part").fill("door")
        await page.locator("input[type=file]").set_input_files(files)
        await page.get_by_role("heading", name="door").wait_for()
        await page.get_by_text("points shown").wait_for()
        await page.get_by_role("columnheader", name="Overlap").wait_for()
        async with page.expect_response("**/cloud?*box=*") as finer:
            await page.locator("canvas").focus()
            for _ in range(14):
                await page.keyboard.press("+")
        assert (await finer.value).status == 200
        await page.get_by_role("button", name="By deviation").click()
        await page.get_by_text("in front of them").wait_for()
        await page.get_by_role("button", name="By normal").click()
        await page.route(
            "**/report?*",
            lambda route: route.fulfill(status=202, json={"state": "in progress", "progress": 0.3, "links": {}}),
        )
        await page.get_by_label("Fit the views to each other").check()
        await page.get_by_text("Fitting the views together: 30 % is done.").wait_for()
        await page.unroute("**/report?*")
        await press(page.get_by_role("button", name="Try again"))
        await page.get_by_role("columnheader", name="Overlap").wait_for()
        await page.locator("dd").get_by_text("8,000", exact=True).wait_for()
        await page.evaluate("location.hash = '#/scans'")
        await page.get_by_text(re.compile(r"2 views · 8k points, [0-9]+ kB · operator")).wait_for()


async def test_a_result_is_reported_exported_and_solved_again(
    open_page: Opened, cell: tuple[Bench, dict[str, str]]
) -> None:
    bench, keys = cell
    operator = {"Authorization": f"Bearer {keys['operator']}"}
    run = await bench.client.post("/calibrate", json={"count": 5}, params={"wait": LIMIT_S}, headers=operator)
    calibration_id = run.json()["result"]["calibration_id"]
    async with open_page("operator", f"result/{calibration_id}") as page:
        async with page.expect_popup() as opened:
            await page.get_by_role("link", name="Report").click()
        report = await opened.value
        await report.get_by_role("heading", name="Calibration report").wait_for()
        async with page.expect_download() as saved:
            await press(page.get_by_role("button", name="For my robot: files"))
            await page.get_by_role("link", name="tf_static.yaml").click()
        assert (await saved.value).suggested_filename == "tf_static.yaml"
        await press(page.get_by_role("button", name="Which way it may be wrong"))
        await page.get_by_text("along the axes of the ellipsoid").wait_for()
        await press(page.get_by_role("button", name="Recalculate"))
        await page.get_by_role("group", name="Pictures to use").get_by_role("button", name="3").click()
        await page.get_by_text("4 of 5 pictures are used").wait_for()
        await page.get_by_role("button", name="Recalculate (nothing moves)").click()
        await page.get_by_text("4 / 5").or_(page.get_by_text("4 / 4")).wait_for()


async def test_a_support_bundle_is_downloaded_with_the_pictures_asked_for(open_page: Opened, tmp_path: Path) -> None:
    async with open_page("admin", "help") as page:
        await page.get_by_label("With the pictures of the last run").check()
        async with page.expect_download() as begun, page.expect_request("**/support-bundle") as asked:
            await press(page.locator("section[aria-labelledby=bundle]").get_by_role("button", name="Download"))
        assert (await asked.value).post_data_json == {"pictures": True}
        bundle = await begun.value
        assert bundle.suggested_filename.endswith(".tar.gz")
        await bundle.save_as(tmp_path / "bundle.tar.gz")
    with tarfile.open(tmp_path / "bundle.tar.gz") as files:
        assert "handeyed-support/settings.json" in files.getnames()

"""The arm brings a known tip before a point that the camera has seen, each move held on the page."""

import re
from collections.abc import AsyncIterator
from typing import Any

import numpy as np
import pytest
import pytest_asyncio

from daemon.model.records import AppliedCalibration, CalibrationRecord
from tests.daemon.access_keys import bearer, with_keys
from tests.daemon.calibrations import document_with_covariance
from tests.daemon.cell_under_test import Bench
from tests.daemon.page.conftest import Opened
from tests.daemon.page.holding import hold_by_key, hold_by_mouse, hold_until, press
from tests.extensions.touch.touches import touch_two_points, touching

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow]

Cell = tuple[Bench, dict[str, str]]

SEEN_WITHIN_MM = 0.2
"""How exactly the fake camera sees a point."""


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def cell(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Cell]:
    """The fake cell, verified, with a touch test of two points."""
    async with with_keys(tmp_path_factory.mktemp("page")) as (bench, keys):
        document = document_with_covariance()
        store = bench.application.store
        await store.save_calibration(CalibrationRecord("cal-1", None, document.created_at, True, document))
        await store.apply(AppliedCalibration("cal-1", document.created_at, "test"))
        bench.client.headers.update(bearer(keys["admin"]))
        await bench.verify()
        await touch_two_points(bench)
        yield bench, keys


@pytest.mark.parametrize("hold", [pytest.param(hold_by_mouse, id="mouse"), pytest.param(hold_by_key, id="keyboard")])
async def test_the_arm_brings_the_tip_before_a_point_and_nearer_each_move_held(
    open_page: Opened, cell: Cell, hold: Any
) -> None:
    bench, _ = cell
    stood = bench.robot.base_T_flange.copy()
    before = len(bench.robot.goals)
    at_point = touching(10)
    axis = at_point[:3, 2]
    bench.robot.base_T_flange = touching(10, tuple(-40.0 * axis))
    async with open_page("operator", "verify/touch") as page:
        asked: list[Any] = []
        page.on("request", lambda request: asked.append(request) if request.url.endswith("/touch/approach") else None)
        await press(page.locator(".chip", has_text=re.compile("^10")))
        nearer = page.get_by_role("button", name="2 mm nearer to point 10")
        await page.get_by_text("Go to the stand-off first.").wait_for()
        assert await nearer.get_attribute("aria-disabled") == "true"
        moves = (("To 20 mm before point 10", 20.0), ("2 mm nearer to point 10", 18.0))
        for number, (name, left_mm) in enumerate(moves, 1):

            async def asked_for(number: int = number) -> bool:
                return len(asked) >= number

            await hold_until(page, hold, name, asked_for)
            await page.get_by_text(f"{left_mm:.2f} mm", exact=True).wait_for()
            left = (at_point - bench.robot.goals[-1].base_T_flange)[:3, 3]
            np.testing.assert_allclose(left, left_mm * axis, atol=SEEN_WITHIN_MM)
        assert len({request.headers["idempotency-key"] for request in asked}) == len(asked) == 2
        bench.robot.base_T_flange = touching(10, (0.0, 0.0, 50.0))
        await page.get_by_text("Go to the stand-off first.").wait_for()
        assert await nearer.get_attribute("aria-disabled") == "true"
    bench.robot.base_T_flange = stood
    assert len(bench.robot.goals) == before + 2


async def test_a_viewer_brings_no_tip_anywhere(open_page: Opened, cell: Cell) -> None:
    async with open_page("viewer", "verify/touch") as page:
        for button in ("#hold-stand-off", "#hold-nearer"):
            assert await page.locator(button).get_attribute("aria-disabled") == "true"


async def test_a_touch_far_off_is_asked_about_and_each_can_be_taken_back(open_page: Opened, cell: Cell) -> None:
    """5 mm and more (cockpit.md, B26)."""
    bench, _ = cell
    stood = bench.robot.base_T_flange.copy()

    async def touched() -> list[int]:
        tests = (await bench.client.get("/touches")).json()["touches"]
        return [
            touch["id"] for touch in (await bench.client.get(f"/touches/{tests[0]['id']}")).json()["touches"]["touches"]
        ]

    before = await touched()
    bench.robot.base_T_flange = touching(10, (0.0, 16.0, 0.0))
    async with open_page("operator", "verify/touch") as page:
        await press(page.locator(".chip", has_text=re.compile("^10")))
        take = page.get_by_role("button", name="The tip is at point 10")
        await press(take)
        await page.get_by_text("The tip is 16.").wait_for()
        assert await touched() == before, "nothing counts yet"
        await press(page.get_by_role("button", name="Count it all the same: point 10"))
        await page.get_by_text(f"points touched: {len(before) + 1}.").wait_for()
        assert await touched() == [*before, 10]
        await press(page.get_by_role("button", name="Take back point 10").last)
        await page.get_by_text(f"points touched: {len(before)}.").wait_for()
        assert await touched() == before
    bench.robot.base_T_flange = stood

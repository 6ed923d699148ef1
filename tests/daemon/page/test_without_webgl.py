"""A browser without WebGL 2 is shown three flat pictures: the cell, a cloud, the ellipsoids."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench
from tests.daemon.clouds import cloud
from tests.daemon.fakes import ply_of
from tests.daemon.page.conftest import Opened
from tests.support.waiting import LIMIT_S

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow]

NO_WEBGL = """const first = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind) {
  return kind.startsWith('webgl') ? null : first.call(this, kind, { willReadFrequently: true });
};"""

EACH_THIRD_IS_PAINTED = """least => {
  const canvas = document.querySelector('canvas');
  if (!canvas?.width) return false;
  const { data, width } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  const painted = [0, 0, 0];
  for (let at = 3; at < data.length; at += 4) {
    if (data[at]) painted[Math.floor((3 * (((at - 3) / 4) % width)) / width)] += 1;
  }
  return painted.every((count) => count > least);
}"""


@asynccontextmanager
async def opened(open_page: Opened, role: str, place: str) -> AsyncIterator[Any]:
    async with open_page(role, place) as page:
        await page.add_init_script(NO_WEBGL)
        await page.reload()
        yield page


async def test_the_cell_is_drawn_from_the_front_above_and_the_side(open_page: Opened) -> None:
    async with opened(open_page, "viewer", "cell") as page:
        await page.get_by_text("From the front, from above, from the side").wait_for()
        await page.wait_for_function(EACH_THIRD_IS_PAINTED, arg=500)


async def test_a_cloud_is_drawn_and_coloured_by_height(open_page: Opened, cell: tuple[Bench, dict[str, str]]) -> None:
    await apply_calibration(cell[0])
    sent = {"name": "part.ply", "mimeType": "application/x-ply", "buffer": ply_of(cloud(4000, 1))}
    async with opened(open_page, "operator", "scans") as page:
        await page.get_by_label("Name of the part").fill("flap")
        await page.locator("input[type=file]").set_input_files([sent])
        await page.get_by_text("points shown").wait_for()
        await page.wait_for_function(EACH_THIRD_IS_PAINTED, arg=500)
        before = await page.evaluate("document.querySelector('canvas').toDataURL()")
        await page.get_by_role("button", name="By height").click()
        await page.wait_for_function("before => document.querySelector('canvas').toDataURL() !== before", arg=before)


async def test_the_ellipsoids_of_a_result_are_drawn(open_page: Opened, cell: tuple[Bench, dict[str, str]]) -> None:
    bench, keys = cell
    operator = {"Authorization": f"Bearer {keys['operator']}"}
    run = await bench.client.post("/calibrate", json={"count": 5}, params={"wait": LIMIT_S}, headers=operator)
    async with opened(open_page, "viewer", f"result/{run.json()['result']['calibration_id']}") as page:
        await page.get_by_role("button", name="Which way it may be wrong").press("Enter")
        await page.get_by_text("along the axes of the ellipsoid").wait_for()
        await page.wait_for_function(EACH_THIRD_IS_PAINTED, arg=100)

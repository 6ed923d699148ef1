"""The start of a scene in three dimensions: in steps, so that the page answers between them."""

from itertools import combinations
from math import dist

import pytest

from tests.daemon.fakes import poses_around_the_target
from tests.daemon.page.conftest import Opened
from tests.daemon.page.holding import press

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow]

COUNT_IDLE_PERIODS = """
window.idlePeriods = 0;
window.began = {};
const request = window.requestIdleCallback;
window.requestIdleCallback = (act, options) => request((deadline) => {
  window.idlePeriods += 1;
  act(deadline);
}, options);
const first = (step) => (window.began[step] ??= window.idlePeriods);
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (...asked) {
  if (asked[0] === 'webgl2') first('context');
  return getContext.apply(this, asked);
};
for (const [name, step] of [['getContextAttributes', 'renderer'], ['linkProgram', 'shaders']]) {
  const inner = WebGL2RenderingContext.prototype[name];
  WebGL2RenderingContext.prototype[name] = function (...given) {
    first(step);
    return inner.apply(this, given);
  };
}
"""


async def test_context_renderer_and_shaders_are_made_in_idle_periods_of_their_own(open_page: Opened) -> None:
    async with open_page("viewer", "cell") as page:
        await page.add_init_script(COUNT_IDLE_PERIODS)
        await page.reload()
        await page.wait_for_function("() => window.began?.shaders !== undefined")
        began = await page.evaluate("window.began")
        assert 0 < began["context"] < began["renderer"] < began["shaders"]


NOTE_WORKER = """
window.asked = [];
const Before = window.Worker;
window.Worker = class extends Before {
  constructor(address) {
    super(address);
    window.asked.push('worker');
    this.addEventListener('message', () => window.asked.push('started'));
  }
};
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (...given) {
  if (given[0] === 'webgl2') window.asked.push('context');
  return getContext.apply(this, given);
};
"""


async def test_a_worker_waits_for_the_graphics_process_before_the_page_asks_for_a_context(open_page: Opened) -> None:
    async with open_page("viewer", "cell") as page:
        await page.add_init_script(NOTE_WORKER)
        await page.reload()
        await page.wait_for_function("() => window.asked?.includes('context')")
        assert (await page.evaluate("window.asked"))[:3] == ["worker", "started", "context"]


async def test_without_workers_the_scene_is_drawn_all_the_same(open_page: Opened) -> None:
    async with open_page("viewer", "cell") as page:
        await page.add_init_script(f"delete window.Worker; {COUNT_IDLE_PERIODS}")
        await page.reload()
        await page.wait_for_function("() => window.began?.shaders !== undefined")


NUMBERS = """() => [...document.querySelectorAll('svg.numbers text')].map((one) => [
    Number(one.textContent), Number(one.getAttribute('x')), Number(one.getAttribute('y'))])"""


async def test_planned_pictures_are_numbered_in_their_order_and_can_be_told_apart(open_page: Opened) -> None:
    async with open_page("operator", "calibrate") as page:
        await press(page.get_by_role("button", name="Show the poses"))
        await page.locator("svg.numbers text").first.wait_for()
        found = await page.evaluate(NUMBERS)
        assert [number for number, *_ in found] == list(range(1, len(poses_around_the_target()) + 1))
        assert all(dist(one[1:], other[1:]) >= 22 for one, other in combinations(found, 2))

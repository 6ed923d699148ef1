"""The live picture: each with its own corners, an age when old, none in a hidden tab, none beside a run's own."""

import math
from itertools import cycle, pairwise
from typing import Any

import pytest

from daemon.api.live.picture_stream import FAST_S, REST_S, PictureStream, Shown
from tests.daemon.access_keys import bearer
from tests.daemon.cell_under_test import Bench
from tests.daemon.fakes import Gate, poses_around_the_target
from tests.daemon.page.conftest import HIDE, Opened
from tests.support.waiting import eventually

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow]

Cell = tuple[Bench, dict[str, str]]

WATCH = """() => {
  window.shown = [];
  const figure = document.querySelector('#camera figure, section[aria-labelledby=camera] figure');
  const note = () => {
    const corners = [...figure.querySelectorAll('circle.corner')];
    const at = corners.length ? ['cx', 'cy'].map((name) => Number(corners[0].getAttribute(name))) : null;
    window.shown.push([Number(figure.dataset.number), corners.length, at, figure.querySelector('image')?.href.baseVal]);
  };
  new MutationObserver(note).observe(figure, { attributes: true, childList: true, subtree: true });
  note();
}"""
"""Collects what the picture shows after each change: its number, how many corners, where the first is, its address."""


def stream_of(bench: Bench) -> PictureStream:
    stream: PictureStream = bench.server._routes.state.picture_streams["camera"]
    return stream


async def numbers_of(page: Any) -> list[int]:
    """Of the pictures shown so far, each once."""
    return sorted({number for number, *_ in await page.evaluate("window.shown")} - {0})


async def until_shown(page: Any, number: int) -> None:
    await page.wait_for_function("number => window.shown.some(([shown]) => shown >= number)", arg=number)


async def test_the_corners_drawn_are_those_of_the_picture_shown(
    open_page: Opened, cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, _ = cell
    made: dict[int, Shown] = {}
    show = PictureStream._show

    async def note(self: PictureStream, *about: Any, **how: Any) -> tuple[bool, Shown]:
        changed, shown = await show(self, *about, **how)
        made[shown.number] = shown
        return changed, shown

    monkeypatch.setattr(PictureStream, "_show", note)
    poses = poses_around_the_target()
    async with open_page("viewer", "cell") as page:
        await page.locator("figure image").first.wait_for()
        await page.evaluate(WATCH)
        for pose in poses:
            bench.robot.base_T_flange = pose
            await until_shown(page, max(made) + 2)
        shown = await page.evaluate("window.shown")
    of_number: dict[int, set[str]] = {}
    for number, corners, at, address in shown:
        if number not in made:
            continue  # shown before this test began to note
        of_number.setdefault(number, set()).add(address)
        look = made[number].look
        if look is not None and look.detection is not None:
            assert corners == len(look.detection.ids)
            assert math.dist(at, look.detection.corners_px[0]) < 0.01
        else:
            assert corners == 0
    assert len(of_number) >= len(poses)
    assert all(len(addresses) == 1 for addresses in of_number.values())


LEAST_PER_S, MAX_GAP_S = 5, 0.4
"""Of the live picture while the arm moves (cockpit.md, B6)."""


async def test_while_the_arm_moves_the_page_shows_what_the_stream_takes_each_tenth_of_a_second(
    open_page: Opened, cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pictures are counted by their ids: of those taken each FAST_S the page shows enough for LEAST_PER_S."""
    bench, _ = cell
    taken: dict[int, tuple[bool, Shown]] = {}
    show, poses = PictureStream._show, cycle(poses_around_the_target())

    async def note(self: PictureStream, *about: Any, **how: Any) -> tuple[bool, Shown]:
        bench.robot.base_T_flange = next(poses)  # for the next picture the arm is elsewhere
        changed, shown = await show(self, *about, **how)
        taken[shown.number] = changed, shown
        return changed, shown

    async with open_page("viewer", "cell") as page:
        await page.locator("figure image").first.wait_for()
        await page.evaluate(WATCH)
        monkeypatch.setattr(PictureStream, "_show", note)
        await until_shown(page, (await numbers_of(page))[-1] + 40)
        shown = await numbers_of(page)
    moving = [number for number, (changed, _) in taken.items() if changed]
    assert len(moving) >= len(taken) - 2, "a picture of a moving arm is followed by the next one at once"
    seen = [number for number in shown if moving[0] <= number <= shown[-1]]
    assert len(seen) >= LEAST_PER_S * FAST_S * (shown[-1] - moving[0])
    gaps = sorted(after - before for before, after in pairwise(seen))
    assert gaps[int(0.95 * len(gaps))] * FAST_S <= MAX_GAP_S
    assert REST_S <= 1.0, "at rest one a second"


async def test_a_hidden_tab_takes_none_and_a_shown_one_goes_on(open_page: Opened, cell: Cell) -> None:
    bench, _ = cell
    stream = stream_of(bench)
    async with open_page("viewer", "cell") as page:
        await page.locator("figure image").first.wait_for()
        await page.evaluate(WATCH)
        await page.evaluate(HIDE, True)
        await eventually(lambda: not stream.listeners)
        await stream._next.read()  # one that was asked for before
        taken = bench.camera.pictures
        await stream._next.read()
        assert bench.camera.pictures == taken
        await page.evaluate(HIDE, False)
        before = await numbers_of(page)
        await until_shown(page, max(before) + 2)
    await eventually(lambda: not stream.listeners)


async def test_in_a_run_its_own_pictures_are_shown_with_their_age(open_page: Opened, cell: Cell) -> None:
    bench, keys = cell
    bench.robot.before_move = first = Gate(at_move=len(bench.robot.goals) + 1)
    async with open_page("viewer", "cell") as page:
        await page.locator("figure image").first.wait_for()
        await page.evaluate(WATCH)
        location = (await bench.client.post("/calibrate", headers=bearer(keys["operator"]))).headers["location"]
        await first.reached.wait()
        before = bench.camera.pictures
        bench.robot.before_move = third = Gate(at_move=first.at_move + 2)
        first.open.set()
        await third.reached.wait()
        newest = stream_of(bench)._turns.newest[0]
        await until_shown(page, newest)
        await page.get_by_text("s old").wait_for()
        assert (bench.camera.pictures, stream_of(bench)._turns.newest[0]) == (before + 2, newest)
        bench.robot.before_move = None
        third.open.set()
        bench.client.headers.update(bearer(keys["viewer"]))
        assert (await bench.run_over(location))["state"] == "finished"
        await until_shown(page, newest + 4)
        await page.get_by_text("s old").wait_for(state="detached")

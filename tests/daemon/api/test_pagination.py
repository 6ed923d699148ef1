"""Pages by cursor: nothing twice and nothing left out, though there is more meanwhile and the clock jumps."""

from collections.abc import Awaitable, Callable
from dataclasses import replace

import pytest

from daemon.model.records import CalibrationRecord, ScanRecord
from daemon.store.store import Store
from tests.daemon.calibrations import a_calibration
from tests.daemon.cell_under_test import Bench
from tests.daemon.records import a_run

Add = Callable[[Store, int, str], Awaitable[None]]


async def _run(store: Store, k: int, at: str) -> None:
    await store.save_run(replace(a_run(f"x{k}"), created_at=at))


async def _calibration(store: Store, k: int, at: str) -> None:
    await store.save_calibration(CalibrationRecord(f"x{k}", None, at, True, a_calibration(f"x{k}")))


async def _scan(store: Store, k: int, at: str) -> None:
    await store.save_scan(ScanRecord(f"x{k}", at, "door"))


LISTS: list[tuple[str, Add]] = [("runs", _run), ("calibrations", _calibration), ("scans", _scan)]
AN_HOUR_BACK = ["2026-11-21T09:59:00.000Z"] * 4 + ["2026-11-21T08:59:30.000Z"] * 5


@pytest.mark.parametrize(("noun", "add"), LISTS)
async def test_every_page_is_followed_by_the_next_and_the_last_says_so(bench: Bench, noun: str, add: Add) -> None:
    for k, at in enumerate(AN_HOUR_BACK):
        await add(bench.application.store, k, at)
    pages, link = [], f"/{noun}?limit=3"
    while link:
        page = (await bench.client.get(link)).json()
        pages.append([item["id"] for item in page[noun]])
        link = page["next"]
        await add(bench.application.store, 100 + len(pages), AN_HOUR_BACK[0])  # meanwhile
    assert pages == [["x8", "x7", "x6"], ["x5", "x4", "x3"], ["x2", "x1", "x0"]]


@pytest.mark.parametrize("noun", ["runs", "calibrations", "scans"])
async def test_a_cursor_that_names_nothing_is_reported(bench: Bench, noun: str) -> None:
    answer = await bench.client.get(f"/{noun}?before=nothing")
    assert (answer.status_code, answer.json()["code"]) == (422, "cursor-unknown")
    assert await _empty(bench, noun)


async def _empty(bench: Bench, noun: str) -> bool:
    page = (await bench.client.get(f"/{noun}")).json()
    return page[noun] == [] and page["next"] is None

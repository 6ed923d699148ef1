"""Each fault of Robot Web Services and EGM strikes an operator who takes views by hand: what is told, then a view."""

import asyncio
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.stories.fault_rows import SERVICES, VIEW_ROWS, ViewRow
from tests.stories.rws_plant import by_rws
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow


def test_every_fault_of_the_services_has_its_row() -> None:
    assert [row.fault for row in VIEW_ROWS] == list(SERVICES)


@pytest.mark.parametrize("row", VIEW_ROWS, ids=lambda row: row.fault)
async def test_what_a_fault_does(row: ViewRow, tmp_path: Path) -> None:
    async with by_rws(tmp_path, 2) as story:
        run = await story.operator.starts("/calibrate", manual=True)
        story.cell.inject_fault(row.fault)
        async with asyncio.timeout(LIMIT_S):
            told = await _told(story.operator.client, run, row.code)
        if row.code is not None:
            assert row.tells in told["detail"]
            assert row.fix in told["fix"]
        story.cell.clear_faults()
        async with asyncio.timeout(LIMIT_S):
            await _told(story.operator.client, run, None)
        assert story.cell.controller.arm.departures == 0


async def _told(ask: httpx.AsyncClient, run: dict[str, Any], code: str | None) -> dict[str, Any]:
    """Ask for views until the answer is that one; None: until a view was taken from here."""
    wanted = {None, "same-pose"} if code is None else {code}
    while True:
        answer = (await ask.post(run["links"]["stations"])).json()
        if answer.get("code") in wanted:
            return dict(answer)
        await asyncio.sleep(0.1)

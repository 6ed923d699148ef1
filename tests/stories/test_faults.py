"""Each named fault strikes a run: what the operator is told, and that the arm moves on a new start only."""

import asyncio
from pathlib import Path
from re import search
from typing import Any

import pytest

from tests.stories.fault_rows import ROWS, SUMMARIES, Row, page
from tests.stories.plant import Plant, plant, small_pictures
from tests.support.waiting import LIMIT_S, eventually

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"


def test_every_fault_of_the_mock_has_its_row() -> None:
    assert [row.fault for row in ROWS] == list(SUMMARIES)
    assert len(ROWS) >= 50


def test_the_page_of_faults_is_this_table() -> None:
    assert (DOCS / "faults.md").read_text() == page(), "python -m tests.stories.fault_rows > docs/faults.md"


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.fault)
async def test_what_a_fault_does(row: Row, tmp_path: Path) -> None:
    late = row.code == "device-timeout"
    async with plant(
        tmp_path,
        time_scale=40,
        truth=small_pictures(7),
        serial=row.serial,
        robot={"limit_s": 2.0} if row.code == "link-lost" else {},
        camera={"limit_s": 5.0 if late and row.job == "calibrate" else LIMIT_S},
        scanner={"limit_s": 20.0 if late else LIMIT_S},
    ) as story:
        ended = await _struck_by(row, story)
        _told_as_the_row_says(row, ended)
        await _verdict_as_the_row_says(row, ended, story)
        await _arm_stands_until_a_new_start(story)


async def _struck_by(row: Row, story: Plant) -> dict[str, Any]:
    """The run when it has ended; the fault struck after its first station."""
    run = await _begun(row, story)
    await story.operator.waits_until_station(run, 1)
    story.cell.inject_fault(row.fault, after_moves=1 if row.fault.startswith("robot") else 0)
    return await story.operator.waits_for_the_end_of(run)


async def _begun(row: Row, story: Plant) -> dict[str, Any]:
    if row.job == "calibrate":
        return await story.operator.starts("/calibrate", count=4)
    poses = story.cell.announcement.sheet["scan_poses"][:3]
    answer = await story.operator.client.post("/scans", json={"name": "part", "poses": poses})
    assert answer.status_code == 202, answer.text
    return answer.json()["run"]  # type: ignore[no-any-return]


def _told_as_the_row_says(row: Row, ended: dict[str, Any]) -> None:
    if row.code is None:
        assert (ended["state"], ended["cause"]) == ("finished", None)
        return
    assert (ended["state"], ended["cause"]["code"]) == ("failed", row.code), ended["cause"]
    assert search(row.tells, ended["cause"]["what"]), ended["cause"]["what"]
    assert search(row.fix, ended["cause"]["fix"]), ended["cause"]["fix"]
    assert "after picture" in ended["cause"]["what"]


async def _verdict_as_the_row_says(row: Row, ended: dict[str, Any], story: Plant) -> None:
    if row.job == "scan" or row.code is not None:
        return
    calibration = (await story.operator.client.get(ended["links"]["calibration"])).json()
    told = "\n".join(finding["message"] for finding in calibration["verdict"]["findings"])
    assert calibration["verdict"]["accepted"] is row.accepted, told
    assert search(row.finding, told), told


async def _arm_stands_until_a_new_start(story: Plant) -> None:
    """With the fault still there, and when it is mended and everything put right at the pendant."""
    await eventually(lambda: not story.cell.moving)
    await eventually(lambda: not story.cell.controller.armed)
    moves = story.cell.commanded_moves
    story.cell.clear_faults()
    story.cell.controller.recover(story.cell.cell.clock())
    await story.operator.waits_until_ready()
    assert not story.cell.controller.armed
    async with asyncio.timeout(LIMIT_S):
        while not (told := await story.operator.client.get("/robot")).is_success:  # noqa: ASYNC110 - behind HTTP
            await asyncio.sleep(0.02)
    assert not told.json()["armed"]
    assert (story.cell.commanded_moves, story.cell.moving) == (moves, False)

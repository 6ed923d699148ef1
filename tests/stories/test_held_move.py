"""A pose is gone to while a button is held: the arm's true way, and where it stands when the button is let go."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.transforms import Array, difference
from mock_robot.truth.truth import NO_NOISE, CellTruth
from tests.daemon.cell_under_test import pose_json
from tests.stories.plant import Plant, plant
from tests.support.waiting import LIMIT_S, eventually

HOLD = "held-in-a-story"
SIDEWAYS_MM = 3.0
"""A step of 20 mm is a motion of the joints: between its ends it leaves the straight line by less than this."""


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine a word may come late: how long a lease lasts is for other tests."""
    monkeypatch.setattr("daemon.cell.held_button.LEASE_S", LIMIT_S)


def flange(story: Plant) -> Array:
    """base_T_flange (4, 4) of the mock's arm now."""
    return story.cell.cell.flange_at(story.cell.cell.clock())


@asynccontextmanager
async def held(story: Plant, base_T_flange: Array) -> AsyncIterator[tuple[dict[str, Any], list[Array]]]:
    """The run that goes there while the button is held, and where the flange was meanwhile."""
    client, seen = story.operator.client, []
    run: dict[str, Any] = (await client.post("/robot/jog", json={"to": pose_json(base_T_flange), "hold": HOLD})).json()
    assert "id" in run, run

    async def says() -> None:
        while True:
            seen.append(flange(story))
            body = {"hold": HOLD, "at_s": asyncio.get_running_loop().time() % 1e6}
            await client.post(f"/runs/{run['id']}/hold", json=body)
            await asyncio.sleep(0.01)

    saying = asyncio.create_task(says())
    try:
        yield run, seen
    finally:
        saying.cancel()


def along_and_beside_mm(start: Array, end: Array, pose: Array) -> tuple[float, float]:
    """How far a pose is on the straight way from start to end, and how far from it."""
    way = end[:3, 3] - start[:3, 3]
    off = pose[:3, 3] - start[:3, 3]
    along = float(off @ way / np.linalg.norm(way))
    return along, float(np.linalg.norm(off - along * way / np.linalg.norm(way)))


def quiet() -> CellTruth:
    return CellTruth.from_seed(7, noise=NO_NOISE)


async def test_the_arm_goes_straight_and_never_beyond_the_pose(tmp_path: Path) -> None:
    async with plant(tmp_path, time_scale=10.0, truth=quiet()) as story:
        start = flange(story)
        end = start.copy()
        end[:3, 3] += (0.0, 0.0, 110.0)
        async with held(story, end) as (run, seen):
            over = await story.operator.waits_for_the_end_of(run)
        assert over["state"] == "finished", over["cause"]
        assert difference(flange(story), end)[0] < 0.1
        ways = [along_and_beside_mm(start, end, pose) for pose in seen]
        assert sum(1.0 < along < 109.0 for along, _ in ways) > 5, "it was seen on its way"
        assert max(along for along, _ in ways) < 110.1
        assert max(beside for _, beside in ways) < SIDEWAYS_MM
        assert not story.cell.controller.armed


async def test_let_go_it_stands_where_it_is_and_goes_back_when_that_is_asked(tmp_path: Path) -> None:
    async with plant(tmp_path, time_scale=4.0, truth=quiet()) as story:
        start = flange(story)
        end = start.copy()
        end[:3, 3] += (0.0, 0.0, 300.0)
        async with held(story, end) as (run, _):
            await eventually(lambda: along_and_beside_mm(start, end, flange(story))[0] > 50.0)
            body = {"hold": HOLD, "at_s": 0.0, "released": True}
            assert (await story.operator.client.post(f"/runs/{run['id']}/hold", json=body)).status_code == 204
        over = await story.operator.waits_for_the_end_of(run)
        assert over["state"] == "finished", over["cause"]
        await eventually(lambda: not story.cell.moving and not story.cell.controller.armed)
        stands = flange(story)
        assert 50.0 < along_and_beside_mm(start, end, stands)[0] < 250.0
        moves = story.cell.commanded_moves
        word = await story.operator.client.post(f"/runs/{run['id']}/hold", json={"hold": HOLD, "at_s": 1.0})
        assert word.status_code == 409
        assert story.cell.commanded_moves == moves
        assert difference(flange(story), stands)[0] < 1e-9, "mm; the last digits differ by rounding"

        async with held(story, start) as (back, _):
            over = await story.operator.waits_for_the_end_of(back)
        assert over["state"] == "finished", over["cause"]
        assert difference(flange(story), start)[0] < 0.1


async def test_nobody_goes_where_the_box_or_the_arm_ends(tmp_path: Path) -> None:
    async with plant(tmp_path, truth=quiet()) as story:
        moves = story.cell.commanded_moves
        for shift_mm in ((0.0, 0.0, -3000.0), (5000.0, 0.0, 0.0)):
            end = flange(story)
            end[:3, 3] += shift_mm
            body = {"to": pose_json(end), "hold": HOLD}
            refused = await story.operator.client.post("/robot/jog", json=body)
            assert (refused.status_code, refused.json()["code"]) == (422, "pose-refused"), refused.text
        assert (story.cell.commanded_moves, story.cell.controller.armed) == (moves, False)

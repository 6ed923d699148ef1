"""A calibration that plans as it goes, over real sockets: what it finds, when it ends, and that it can be stopped."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.targets import Chessboard
from calibration.transforms import Array, rotation_from_vector, transform
from mock_robot.truth.score import score_calibration
from tests.stories.plant import TEXT, Plant, plant, small_pictures
from tests.support.waiting import LIMIT_S, eventually

pytestmark = pytest.mark.slow

SMALL_PICTURES_MM = 0.4
NOTHING_GUESSED = {"flange_T_camera_guess": None, "base_T_target_guess": None}


def off_by(a_T_b: Array, translation_mm: float, rotation_deg: float) -> dict[str, Any]:
    turn = rotation_from_vector(np.radians(rotation_deg) * np.array([0.6, -0.64, 0.48]))
    wrong = a_T_b @ transform(turn, translation_mm * np.array([0.48, 0.6, -0.64]))
    return PoseDocument.of(wrong).model_dump(mode="json")


async def calibrates(story: Plant, **body: Any) -> tuple[dict[str, Any], float]:
    """The finished run, and how far its X maps points from the truth."""
    run = (await story.operator.client.post("/calibrate", params={"wait": LIMIT_S}, json=body)).json()
    assert run["state"] == "finished", run
    document = (await story.application.store.calibration(run["id"])).document
    assert document.verdict.accepted, document.verdict
    assert document.flange_T_camera is not None
    assert not story.cell.moving
    return run, score_calibration(story.truth, document.flange_T_camera.transform())["point_rms_mm"]


def session_of(story: Plant, run: dict[str, Any]) -> list[dict[str, Any]]:
    views: list[dict[str, Any]] = json.loads((story.folder / "runs" / run["id"] / "session.json").read_text())["views"]
    return views


async def test_with_no_guess_at_all_it_turns_the_flange_a_little_and_finds_out(tmp_path: Path) -> None:
    async with plant(tmp_path, planned=True, truth=small_pictures(3), calibration=NOTHING_GUESSED) as story:
        run, off_mm = await calibrates(story)
        assert off_mm < SMALL_PICTURES_MM
        views = session_of(story, run)
        assert run["stations"] == run["station"] == len(views) - 1 >= 5
        here = np.array(views[0]["base_T_flange"]["translation_mm"])
        for view in views[1 : 1 + run["stations"] - 3]:
            assert np.linalg.norm(here - view["base_T_flange"]["translation_mm"]) < 0.1
        words = (await story.operator.client.get(run["links"]["self"], headers=TEXT)).text
        predicted = re.search(r"predicted U (\d\.\d+) mm", words)
        assert predicted is not None and float(predicted[1]) < 1.5
        assert run["result"]["expanded_mm"] <= run["planning"]["goal"]["tolerance_mm"]


async def test_a_guess_50_mm_and_10_deg_off_is_as_good(tmp_path: Path) -> None:
    truth = small_pictures(4)
    guess = {**NOTHING_GUESSED, "flange_T_camera_guess": off_by(truth.flange_T_camera, 50.0, 10.0)}
    async with plant(tmp_path, planned=True, truth=truth, calibration=guess) as story:
        run, off_mm = await calibrates(story)
        assert off_mm < SMALL_PICTURES_MM
        assert run["result"]["expanded_mm"] <= run["planning"]["goal"]["tolerance_mm"]
        assert run["planning"]["now_mm"] <= run["planning"]["goal"]["tolerance_mm"]


async def test_the_target_is_not_seen_at_first_but_somebody_said_where_it_is(tmp_path: Path) -> None:
    async with plant(tmp_path, planned=True, truth=small_pictures(5)) as story:
        story.cell.inject_fault("camera-target-hidden", strikes=1)
        run, off_mm = await calibrates(story, count=3)
        assert off_mm < 2 * SMALL_PICTURES_MM
        assert 3 <= run["stations"] <= 4, "one view planned by a guess may miss the target, and is taken again"


async def test_it_stops_when_a_mapped_point_is_known_as_well_as_asked(tmp_path: Path) -> None:
    async with plant(tmp_path, planned=True, truth=small_pictures(6)) as story:
        run, _ = await calibrates(story, count=12, uncertainty_mm=0.2)
        document = (await story.application.store.calibration(run["id"])).document
        assert document.uncertainty is not None
        assert document.uncertainty.point_mm <= 0.2
        assert 3 <= run["station"] == run["stations"] < 12


async def test_the_target_leaves_the_picture_on_an_exploring_move_and_the_turn_is_reversed(tmp_path: Path) -> None:
    truth = small_pictures(3, target=Chessboard(11, 8, 20.0))
    aside = truth.camera.matrix + np.array([[0, 0, -280.0], [0, 0, 80.0], [0, 0, 0]])
    truth = replace(truth, camera=replace(truth.camera, matrix=aside))
    async with plant(tmp_path, planned=True, truth=truth, calibration=NOTHING_GUESSED) as story:
        run, off_mm = await calibrates(story, count=5)
        assert off_mm < SMALL_PICTURES_MM
        document = (await story.application.store.calibration(run["id"])).document
        missed = [view.status == "rejected" for view in document.views]
        assert missed == [False, True, False, True, False, *[False] * 5]


@pytest.mark.parametrize("station", [0, 1])
async def test_aborted_while_it_plans_nothing_moves_afterwards(tmp_path: Path, station: int) -> None:
    async with plant(tmp_path, planned=True, truth=small_pictures(7), time_scale=20) as story:
        run = await story.operator.starts("/calibrate", count=5)
        await story.operator.waits_until(run, "planning", station)
        stopped = (await story.operator.client.post(run["links"]["abort"])).json()
        moves = story.cell.commanded_moves
        assert stopped["state"] == "aborted"
        await eventually(lambda: not story.cell.moving)
        assert not (await story.operator.client.get("/robot")).json()["armed"]
        again = (await story.operator.client.get("/health")).status_code
        assert (again, story.cell.commanded_moves) == (200, moves)


@pytest.mark.parametrize("fault", ["link-reset", "link-half-open"])
async def test_a_link_lost_while_it_plans_fails_the_run_and_moves_nothing(tmp_path: Path, fault: str) -> None:
    async with plant(tmp_path, planned=True, truth=small_pictures(7), time_scale=20) as story:
        run = await story.operator.starts("/calibrate", count=5)
        await story.operator.waits_until(run, "planning", 1)
        story.cell.inject_fault(fault)
        ended = await story.operator.waits_for_the_end_of(run)
        moves = story.cell.commanded_moves
        assert ended["state"] == "failed"
        assert ended["cause"]["what"].startswith("link to the controller lost after picture 2 of 6"), ended["cause"]
        story.cell.clear_faults()
        await story.operator.waits_until_ready()
        await eventually(lambda: not story.cell.moving)
        assert story.cell.commanded_moves == moves

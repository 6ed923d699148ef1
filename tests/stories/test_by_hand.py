"""Calibrating with nothing but a joystick: the arm is jogged, the daemon only reads it, and X is the truth's."""

import asyncio
import json
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.pose import PoseDocument
from mock_robot.cabinet.panel import Mode
from mock_robot.truth.score import score_calibration
from tests.stories.jogging import SMALL_PICTURES_MM, jogs, jogs_and_waits, settled, where_next
from tests.stories.plant import Plant, plant, small_pictures
from tests.support.waiting import LIMIT_S, eventually

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
BLIND = ("z", 30.0), ("x", 20.0), ("y", 20.0)


@asynccontextmanager
async def in_manual_mode(folder: Path, time_scale: float = 50, **changes: Any) -> AsyncIterator[Plant]:
    """A cell whose key switch forbids automatic motion, and a daemon beside it."""
    async with plant(folder, planned=True, truth=small_pictures(3), time_scale=time_scale, **changes) as story:
        story.cell.controller.switch_mode(Mode.MANR, story.cell.cell.clock())
        yield story
        assert story.cell.commanded_moves == 0
        assert not story.cell.controller.armed


async def test_jogged_from_nothing_known_to_an_x_that_is_accepted(tmp_path: Path) -> None:
    nothing = {"flange_T_camera_guess": None, "base_T_target_guess": None}
    async with in_manual_mode(tmp_path, calibration=nothing) as story:
        rng, ask = np.random.default_rng(0), story.operator.client
        assert (await ask.post("/calibrate")).json()["code"] == "cell-not-ready"
        run = await story.operator.starts("/calibrate", manual=True, tolerance_mm=0.6)
        told: list[float] = []
        for number in range(1, 9):
            run = (await ask.post(run["links"]["stations"])).json()
            assert (run["state"], run["station"]) == ("waiting", number), run
            told += [run["planning"]["now_mm"]] if run["planning"]["now_mm"] else []
            if run["planning"]["advice"].startswith("that is enough"):
                break
            await jogs_and_waits(story.cell, where_next(story.cell, run["planning"], rng))
        assert told == sorted(told, reverse=True)
        assert told[-1] <= 0.6
        run = (await ask.post(run["links"]["finish"], params={"wait": LIMIT_S})).json()
        assert run["state"] == "finished", run["cause"]
        document = (await story.application.store.calibration(run["id"])).document
        assert document.verdict.accepted, document.verdict
        assert document.flange_T_camera is not None
        off = score_calibration(story.truth, document.flange_T_camera.transform())
        assert off["point_rms_mm"] < SMALL_PICTURES_MM


async def test_a_view_is_not_taken_while_the_operator_still_jogs(tmp_path: Path) -> None:
    async with in_manual_mode(tmp_path, time_scale=4) as story:
        run = await story.operator.starts("/calibrate", manual=True)
        taken = (await story.operator.client.post(run["links"]["stations"])).json()
        jogs(story.cell, PoseDocument.model_validate(taken["planning"]["next_pose"]).transform())
        refused = await story.operator.client.post(run["links"]["stations"])
        assert (refused.status_code, refused.json()["code"]) == (409, "not-still")
        await eventually(lambda: settled(story.cell))
        again = (await story.operator.client.post(run["links"]["stations"])).json()
        assert again["station"] == 2


class Typist:
    """Somebody at the terminal of `handeyed calibrate --manual`."""

    def __init__(self, process: Process) -> None:
        self.process = process

    async def reads(self, says: str) -> str:
        assert self.process.stderr is not None
        async with asyncio.timeout(LIMIT_S):
            while line := (await self.process.stderr.readline()).decode():
                if says in line:
                    return line
        raise AssertionError(f"it never said {says!r}")

    async def types(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n".encode())
        await self.process.stdin.drain()

    async def gets(self) -> tuple[int, str]:
        """Exit status and answer; nobody types any more."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        out, _ = await asyncio.wait_for(self.process.communicate(), LIMIT_S)
        assert self.process.returncode is not None
        return self.process.returncode, out.decode()


@asynccontextmanager
async def at_the_terminal(story: Plant, *options: str) -> AsyncIterator[Typist]:
    command = ["-m", "daemon.cli", "calibrate", "--manual", "--url", story.url, *options]
    process = await asyncio.create_subprocess_exec(
        sys.executable, *command, stdin=PIPE, stdout=PIPE, stderr=PIPE, cwd=ROOT
    )
    try:
        yield Typist(process)
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()


async def test_at_the_terminal_enter_takes_a_view_and_f_finishes(tmp_path: Path) -> None:
    async with in_manual_mode(tmp_path) as story, at_the_terminal(story, "--json", "--uncertainty", "0.3") as person:
        rng = np.random.default_rng(1)
        await person.reads("Enter: take a picture")
        await person.types("")
        assert "picture 1 taken" in await person.reads("taken")
        await person.types("")
        assert "the arm stands where picture 1 was taken" in await person.reads("not taken")
        await person.types("f")
        assert "pictures that show the target: 1; 3 are needed" in await person.reads("not taken")
        for number in range(2, 5):
            run = (await story.operator.client.get("/runs")).json()["runs"][0]
            await jogs_and_waits(story.cell, where_next(story.cell, run["planning"], rng))
            await person.types("")
            assert f"picture {number} taken" in await person.reads("taken")
            assert "turn the flange by" in await person.reads("next:")
        await person.types("f")
        status, out = await person.gets()
        document = CalibrationDocument.model_validate(json.loads(out))
        assert (status, document.verdict.accepted) == (0, True), document.verdict


async def test_who_leaves_the_terminal_leaves_no_run_behind(tmp_path: Path) -> None:
    async with in_manual_mode(tmp_path) as story, at_the_terminal(story) as person:
        await person.reads("Enter: take a picture")
        await person.types("what?")
        await person.reads("Enter: take a picture")
        status, _ = await person.gets()
        run = (await story.operator.client.get("/runs")).json()["runs"][0]
        assert (status, run["state"]) == (1, "aborted")


async def test_a_run_that_was_aborted_meanwhile_ends_the_command(tmp_path: Path) -> None:
    async with in_manual_mode(tmp_path) as story, at_the_terminal(story) as person:
        await person.reads("Enter: take a picture")
        run = (await story.operator.client.get("/runs")).json()["runs"][0]
        await story.operator.client.post(run["links"]["abort"])
        await person.types("")
        await person.reads("has ended already")
        assert (await person.gets())[0] == 1

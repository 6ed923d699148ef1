"""What stops a run, what the operator is told, and that nothing moves afterwards."""

import asyncio
import json
import os
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from protocols.cb.codes import Command
from tests.mock_robot.running_cell import RunningCell, running_cell
from tests.stories.plant import Operator, plant, poses_taught_for, settings_of, small_pictures
from tests.support.waiting import LIMIT_S, eventually

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]


async def assert_nothing_moves(cell: RunningCell, since: int) -> None:
    """The controller has accepted no move since, and the arm comes to rest."""
    await eventually(lambda: not cell.moving)
    assert cell.commanded_moves == since


def after_a_station_under_way(run: dict[str, Any], at_least: int = 1) -> str:
    """Where the run's own record says it ended: past what was waited for, how far is the arm's affair, and not done."""
    assert at_least <= run["station"] < run["stations"]
    return f"after picture {run['station']} of {run['stations']}"


async def test_an_aborted_run_moves_nothing_afterwards(tmp_path: Path) -> None:
    async with plant(tmp_path, time_scale=20, truth=small_pictures(7)) as story:
        run = await story.operator.starts("/calibrate", count=8)
        await story.operator.waits_until_station(run, 1)
        await eventually(lambda: story.cell.moving)
        stopped = (await story.operator.client.post(run["links"]["abort"])).json()
        moves = story.cell.commanded_moves
        assert stopped["state"] == "aborted"
        assert stopped["cause"]["what"].endswith(after_a_station_under_way(stopped))
        await assert_nothing_moves(story.cell, moves)
        assert not (await story.operator.client.get("/robot")).json()["armed"]


async def test_an_abort_at_a_frozen_controller_does_not_wait_for_its_limit(tmp_path: Path) -> None:
    patient = {"limit_s": 20.0}
    async with plant(tmp_path, time_scale=5, truth=small_pictures(7), robot=patient) as story:
        run = await story.operator.starts("/calibrate", count=8)
        await story.operator.waits_until_station(run, 1)
        await eventually(lambda: story.cell.moving)
        story.cell.inject_fault("link-half-open")
        answer = await story.operator.client.post(run["links"]["abort"])
        assert (answer.status_code, answer.json()["code"]) == (502, "stop-unconfirmed"), answer.text
        assert story.application.cell.robot.link.connected, "the limit is not over"
        assert (await story.operator.waits_for_the_end_of(run))["state"] == "aborted"
        story.cell.clear_faults()
        await eventually(lambda: not story.cell.controller.armed)
        await eventually(lambda: story.application.cell.safe_stop.unconfirmed is None)


async def test_a_second_calibrate_is_refused_with_who_holds_the_cell(tmp_path: Path) -> None:
    async with plant(tmp_path, truth=small_pictures(7)) as story:
        run = await story.operator.starts("/calibrate", count=3)
        second = await story.operator.client.post("/calibrate")
        assert (second.status_code, second.json()["holder"]) == (409, run["id"])
        assert (await story.operator.waits_for_the_end_of(run))["state"] == "finished"


@pytest.mark.parametrize(
    ("fault", "code"), [("link-reset", "link-lost"), ("link-half-open", "link-lost"), ("link-restart", "link-lost")]
)
async def test_a_link_lost_between_stations_fails_the_run_and_moves_nothing(
    tmp_path: Path, fault: str, code: str
) -> None:
    async with plant(tmp_path, time_scale=20, truth=small_pictures(7)) as story:
        run = await story.operator.starts("/calibrate", count=5)
        await story.operator.waits_until_station(run, 2)
        await eventually(lambda: story.cell.moving)
        story.cell.inject_fault(fault)
        ended = await story.operator.waits_for_the_end_of(run)
        moves = story.cell.commanded_moves
        assert (ended["state"], ended["cause"]["code"]) == ("failed", code)
        assert ended["cause"]["what"] == f"link to the controller lost {after_a_station_under_way(ended, 2)}"
        story.cell.clear_faults()
        await story.operator.waits_until_ready()
        await assert_nothing_moves(story.cell, moves)


async def test_a_robot_that_answers_garbage_fails_the_run_and_the_next_one_works(tmp_path: Path) -> None:
    async with plant(tmp_path, truth=small_pictures(7)) as story:
        story.cell.inject_fault("link-garbage", only=Command.GET_POSE, after_moves=1)
        run = await story.operator.starts("/calibrate", count=3)
        ended = await story.operator.waits_for_the_end_of(run)
        assert ended["state"] == "failed"
        assert ended["cause"]["fix"]
        story.cell.clear_faults()
        await story.operator.waits_until_ready()
        again = await story.operator.starts("/calibrate", count=3)
        assert (await story.operator.waits_for_the_end_of(again))["state"] == "finished"


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ("camera-target-hidden", "the target was seen in"),
        ("camera-empty-file", "the answer is empty"),
        ("camera-half-file", "the PNG ends early"),
        ("camera-wrong-size", "480×300, expected 960×600"),
    ],
)
async def test_what_the_camera_does_wrong_is_said(tmp_path: Path, fault: str, says: str) -> None:
    async with plant(tmp_path, truth=small_pictures(7)) as story:
        story.cell.inject_fault(fault)
        run = await story.operator.starts("/calibrate", count=3)
        ended = await story.operator.waits_for_the_end_of(run)
        assert ended["state"] == "failed"
        assert says in ended["cause"]["what"]
        assert ended["cause"]["fix"]
        assert (await story.operator.client.get("/health")).status_code == 200


async def test_an_emergency_stop_ends_the_run(tmp_path: Path) -> None:
    async with plant(tmp_path, time_scale=20, truth=small_pictures(7)) as story:
        run = await story.operator.starts("/calibrate", count=5)
        await story.operator.waits_until_station(run, 1)
        await eventually(lambda: story.cell.moving)
        story.cell.presses_emergency_stop()
        ended = await story.operator.waits_for_the_end_of(run)
        moves = story.cell.commanded_moves
        assert ended["state"] == "failed"
        refused = await story.operator.client.post("/calibrate")
        assert refused.json()["code"] == "cell-not-ready"
        assert "emergency stop" in refused.json()["detail"]
        await assert_nothing_moves(story.cell, moves)


class Process:
    """The daemon as a process of its own, as systemd would run it."""

    def __init__(self, process: asyncio.subprocess.Process, url: str) -> None:
        self.process, self.url = process, url
        self.operator = Operator(httpx.AsyncClient(base_url=url, verify=False, timeout=2 * LIMIT_S))

    async def ends(self, within_s: float = LIMIT_S) -> int:
        return await asyncio.wait_for(self.process.wait(), within_s)


def taught_settings(cell: RunningCell, folder: Path) -> dict[str, Any]:
    poses = poses_taught_for(cell.truth.seed)
    return settings_of(cell.announcement, folder, calibration={"poses": poses}).model_dump(mode="json")


def _heed_signals() -> None:
    """What starts the tests may ignore signals (nohup, a job in the background), and the daemon inherits that."""
    for number in (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT):
        signal.signal(number, signal.SIG_DFL)


@asynccontextmanager
async def daemon_process(folder: Path, settings: dict[str, Any]) -> AsyncIterator[Process]:
    ready, config = folder / f"ready-{os.urandom(4).hex()}.json", folder / "settings.json"
    config.write_text(json.dumps(settings))
    program = (
        "from daemon.cell import safe_stop; safe_stop.MAX_ATTEMPT_S = 60.0;"  # a busy machine's stop takes long
        "from daemon import application; application.MAX_LAST_EVENT_S = 60.0;"
        "import json, sys, pathlib; from daemon.composition import serve; from daemon.config.settings import Settings;"
        "serve(Settings.model_validate(json.loads(pathlib.Path(sys.argv[1]).read_text())),"
        " ready_file=pathlib.Path(sys.argv[2]))"
    )
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", program, str(config), str(ready), cwd=ROOT, stdout=asyncio.subprocess.DEVNULL,
        preexec_fn=_heed_signals,
    )  # fmt: skip
    try:
        await eventually(lambda: ready.exists() or process.returncode is not None)
        running = Process(process, json.loads(ready.read_text())["url"])
        try:
            yield running
        finally:
            await running.operator.client.aclose()
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()


async def test_killed_in_mid_run_the_daemon_says_so_after_its_restart_and_the_arm_stays(tmp_path: Path) -> None:
    async with running_cell(time_scale=20, truth=small_pictures(7), apart=True) as cell:
        settings = taught_settings(cell, tmp_path)
        async with daemon_process(tmp_path, settings) as daemon:
            await daemon.operator.waits_until_ready()
            run = await daemon.operator.starts("/calibrate", count=6)
            await daemon.operator.waits_until_station(run, 2)
            daemon.process.kill()
            await daemon.ends()
        async with daemon_process(tmp_path, settings) as daemon:
            seen = await daemon.operator.sees(run)
            assert (seen["state"], seen["cause"]["code"]) == ("failed", "interrupted")
            assert "the daemon stopped while the run was in progress, after picture" in seen["cause"]["what"]
            assert "start the run again" in seen["cause"]["fix"]
            session = json.loads((tmp_path / "runs" / run["id"] / "session.json").read_text())
            assert len(session["views"]) >= 2
            await daemon.operator.waits_until_ready()
            await assert_nothing_moves(cell, cell.commanded_moves)


async def test_sigterm_in_mid_run_aborts_it_ends_event_streams_and_leaves_the_arm_disarmed(tmp_path: Path) -> None:
    async with running_cell(time_scale=20, truth=small_pictures(7), apart=True) as cell:
        settings = taught_settings(cell, tmp_path)
        async with daemon_process(tmp_path, settings) as daemon:
            await daemon.operator.waits_until_ready()
            run = await daemon.operator.starts("/calibrate", count=6)
            await daemon.operator.waits_until_station(run, 1)
            async with daemon.operator.client.stream("GET", "/events") as events:
                lines = events.aiter_lines()
                assert (await anext(lines)).startswith(":")
                daemon.process.send_signal(signal.SIGTERM)
                async with asyncio.timeout(LIMIT_S):
                    last = [line async for line in lines if line.startswith("data:")][-1]
            assert await daemon.ends() == 0
            moves = cell.commanded_moves
        assert '"state": "aborted"' in last
        assert run["id"] in last
        await assert_nothing_moves(cell, moves)
        assert not cell.controller.armed
        async with daemon_process(tmp_path, settings) as daemon:
            seen = await daemon.operator.sees(run)
            assert seen["state"] == "aborted"
            assert "SIGTERM" in seen["cause"]["what"]


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1], ids=lambda number: number.name)
async def test_any_signal_that_ends_the_daemon_stops_and_disarms_the_arm_in_mid_move(
    tmp_path: Path, number: signal.Signals
) -> None:
    async with running_cell(time_scale=20, truth=small_pictures(7), apart=True) as cell:
        settings = taught_settings(cell, tmp_path)
        async with daemon_process(tmp_path, settings) as daemon:
            await daemon.operator.waits_until_ready()
            run = await daemon.operator.starts("/calibrate", count=6)
            await daemon.operator.waits_until_station(run, 1)
            await eventually(lambda: cell.moving)
            daemon.process.send_signal(number)
            assert await daemon.ends() == 0
            assert not cell.controller.armed
            await assert_nothing_moves(cell, cell.commanded_moves)
        async with daemon_process(tmp_path, settings) as daemon:
            seen = await daemon.operator.sees(run)
            assert (seen["state"], number.name in seen["cause"]["what"]) == ("aborted", True)

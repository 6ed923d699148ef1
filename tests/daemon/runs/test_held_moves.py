"""Moves that last while a button is held: none before it, a stop when it is let go or silent, never beyond the pose."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.transforms import difference, rotation_from_vector, transform
from daemon.cell.held_button import HeldButton
from daemon.errors import NotHeld
from daemon.runs.jog import MAX_STEP_MM, MAX_STEP_RAD, steps_between
from tests.daemon.access_keys import bearer, with_keys
from tests.daemon.cell_under_test import Bench, Parts, pose_json, serving, settings_for
from tests.daemon.fakes import Gate
from tests.support.waiting import LIMIT_S, eventually

HOLD = "held-by-a-test"


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine a word may come late; these tests are not about that."""
    monkeypatch.setattr("daemon.cell.held_button.LEASE_S", LIMIT_S)


def to(base_T_flange: Any, **others: Any) -> dict[str, Any]:
    return {"to": pose_json(base_T_flange), "hold": HOLD, **others}


def beside(bench: Bench, x_mm: float = 90.0, turn_deg: float = 0.0) -> Any:
    """A pose from where the arm stands, shifted in the base and turned about the flange's x axis."""
    stood = bench.robot.base_T_flange
    turned = stood @ transform(rotation_from_vector(np.radians([turn_deg, 0, 0])), [0, 0, 0])
    turned[0, 3] += x_mm
    return turned


class Screen:
    """What a page does while a button on it is held, with a clock of its own."""

    def __init__(self, bench: Bench, run_id: str, **headers: str) -> None:
        self._bench, self._path, self._headers, self._at_s = bench, f"/runs/{run_id}/hold", headers, 0.0

    async def says(self, hold: str = HOLD, **others: Any) -> int:
        """The status of one word, sent 0.1 s after the last one by the screen's clock."""
        self._at_s += 0.1
        body = {"hold": hold, "at_s": self._at_s, **others}
        return (await self._bench.client.post(self._path, json=body, headers=self._headers)).status_code

    @asynccontextmanager
    async def holds(self) -> AsyncIterator[None]:
        """Say so all the time."""
        began_s = asyncio.get_running_loop().time()

        async def go_on() -> None:
            while True:
                self._at_s = asyncio.get_running_loop().time() - began_s
                await self.says()
                await asyncio.sleep(0.05)

        saying = asyncio.create_task(go_on())
        try:
            yield
        finally:
            saying.cancel()


async def begins(bench: Bench, body: dict[str, Any]) -> dict[str, Any]:
    answer = await bench.client.post("/robot/jog", json=body)
    assert answer.status_code == 202, answer.text
    run: dict[str, Any] = answer.json()
    return run


@pytest.mark.usefixtures("patient")
async def test_held_to_the_end_the_arm_comes_there_by_short_steps_and_is_disarmed(bench: Bench) -> None:
    stood, there = bench.robot.base_T_flange.copy(), beside(bench, 90.0, 9.0)
    run = await begins(bench, to(there))
    async with Screen(bench, run["id"]).holds():
        over = await bench.run_over(run["links"]["self"])
    assert over["state"] == "finished", over["cause"]
    np.testing.assert_allclose(bench.robot.base_T_flange, there, atol=1e-9)
    ways = [stood, *(goal.base_T_flange for goal in bench.robot.goals)]
    for before, after in pairwise(ways):
        off_mm, off_rad = difference(before, after)
        assert (off_mm <= MAX_STEP_MM + 1e-9, off_rad <= MAX_STEP_RAD + 1e-9) == (True, True)
    assert {goal.speed_mm_s for goal in bench.robot.goals} == {50.0}
    assert not bench.robot.armed
    assert "hold" not in over["request"], "its name is of no use to others"


async def test_a_request_that_nobody_holds_arms_and_moves_nothing(bench: Bench) -> None:
    stood = bench.robot.base_T_flange.copy()
    run = await begins(bench, to(beside(bench)))
    over = await bench.run_over(run["links"]["self"])
    assert (over["state"], bench.robot.goals, bench.robot.stops) == ("finished", [], 0)
    np.testing.assert_array_equal(bench.robot.base_T_flange, stood)


@pytest.mark.parametrize("how", ["released", "silent"])
async def test_let_go_or_lost_during_a_step_the_arm_is_stopped_and_goes_no_farther(
    tmp_path: Path, how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("daemon.cell.held_button.LEASE_S", LIMIT_S if how == "released" else 3.0)
    parts = Parts()
    parts.robot.before_move = gate = Gate(2)
    async with serving(settings_for(tmp_path), parts) as bench:
        stood = bench.robot.base_T_flange.copy()
        run = await begins(bench, to(beside(bench)))
        screen = Screen(bench, run["id"])
        async with screen.holds():
            await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        if how == "released":
            assert await screen.says(released=True) == 204
        over = await bench.run_over(run["links"]["self"])
        assert (over["state"], len(bench.robot.goals), bench.robot.armed) == ("finished", 2, False)
        assert bench.robot.base_T_flange[0, 3] - stood[0, 3] <= MAX_STEP_MM, "the second step was not done"
        assert bench.robot.stops >= 1
        assert await screen.says() == 409, "it is not taken up again"
        assert len(bench.robot.goals) == 2


@pytest.mark.usefixtures("patient")
async def test_an_abort_ends_it_though_the_button_is_held(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(2)
    async with serving(settings_for(tmp_path), parts) as bench:
        run = await begins(bench, to(beside(bench)))
        async with Screen(bench, run["id"]).holds():
            await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
            ended = (await bench.client.post(run["links"]["abort"])).json()
        assert (ended["state"], bench.robot.armed, len(bench.robot.goals)) == ("aborted", False, 2)


@pytest.mark.usefixtures("patient")
async def test_a_robot_that_comes_elsewhere_than_it_was_sent_is_not_sent_on(bench: Bench) -> None:
    bench.robot.drift_mm = 3.0
    run = await begins(bench, to(beside(bench)))
    async with Screen(bench, run["id"]).holds():
        over = await bench.run_over(run["links"]["self"])
    bench.robot.drift_mm = 0.0
    assert (over["state"], over["cause"]["code"]) == ("failed", "elsewhere-than-sent")
    assert (len(bench.robot.goals), bench.robot.armed) == (1, False)


async def test_what_is_refused_moves_nothing(bench: Bench) -> None:
    far = beside(bench, 5000.0)
    for body, why in (
        (to(far), "outside the box"),
        (to(beside(bench), speed_mm_s=51.0), "at most 50 mm/s"),
        ({"to": pose_json(far)}, "one of the four"),
        ({"hold": HOLD}, "one of the four"),
        (to(beside(bench), axis=1, by_deg=1.0), "one of the four"),
        (to(beside(bench)) | {"hold": "short"}, "hold"),
    ):
        refused = await bench.client.post("/robot/jog", json=body)
        assert (refused.status_code, why in refused.text) == (422, True), refused.text
    assert (bench.robot.goals, bench.robot.stops) == ([], 0)
    assert not (await bench.client.get("/runs")).json()["runs"]


async def test_only_who_asked_for_the_motion_holds_it_and_only_by_its_name(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(1)
    async with with_keys(tmp_path, parts) as (bench, keys):
        headers = bearer(keys["operator"])
        viewer = await bench.client.post("/robot/jog", json=to(beside(bench)), headers=bearer(keys["viewer"]))
        assert viewer.status_code == 403
        run = (await bench.client.post("/robot/jog", json=to(beside(bench)), headers=headers)).json()
        mine = Screen(bench, run["id"], **headers)
        await eventually(lambda: HOLD in bench.application.cell.buttons)
        assert await Screen(bench, run["id"], **bearer(keys["viewer"])).says() == 403
        assert await Screen(bench, run["id"], **bearer(keys["admin"])).says() == 409
        assert await mine.says("another-button") == 409
        assert await Screen(bench, "another-run", **headers).says() == 409
        assert not bench.robot.armed
        async with mine.holds():
            await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        over = await bench.client.get(run["links"]["self"], params={"wait": LIMIT_S}, headers=headers)
        assert (over.json()["state"], bench.robot.armed) == ("finished", False)


@pytest.mark.usefixtures("patient")
async def test_in_a_run_by_hand_a_held_move_comes_between_two_views(bench: Bench) -> None:
    run = (await bench.client.post("/calibrate", json={"manual": True})).json()
    there = beside(bench, 30.0)
    moving = asyncio.create_task(bench.client.post(f"/runs/{run['id']}/jog", json=to(there)))
    async with Screen(bench, run["id"]).holds():
        answer = await moving
    assert (answer.status_code, answer.json()["state"]) == (200, "waiting"), answer.text
    np.testing.assert_allclose(bench.robot.base_T_flange, there, atol=1e-9)
    await bench.client.post(f"/runs/{run['id']}/abort")


async def test_words_that_were_kept_on_the_way_extend_nothing() -> None:
    over = asyncio.Event()
    button = HeldButton("Ann")
    button.watch(over.set)
    for at_s in (10.0, 1000.0, 2000.0):
        button.renew("Ann", at_s)
    await asyncio.wait_for(over.wait(), LIMIT_S)  # as one word: a lease from the last one's clock would last 2000 s
    with pytest.raises(NotHeld):
        button.renew("Ann", 2000.1)


def test_steps_are_short_on_a_straight_line_and_end_at_the_pose() -> None:
    start = transform(rotation_from_vector(np.array([0.1, 2.0, -0.4])), [500.0, -200.0, 900.0])
    end = transform(rotation_from_vector(np.array([-1.0, 1.0, 0.3])), [620.0, 100.0, 700.0])
    for a, b in ((start, end), (end, start), (start, start)):
        ways = [a, *steps_between(a, b)]
        np.testing.assert_array_equal(ways[-1], b)
        for before, after in pairwise(ways):
            off_mm, off_rad = difference(before, after)
            assert (off_mm <= MAX_STEP_MM + 1e-6, off_rad <= MAX_STEP_RAD + 1e-6) == (True, True)
        left_mm = [np.linalg.norm(pose[:3, 3] - b[:3, 3]) for pose in ways]
        assert left_mm == sorted(left_mm, reverse=True)

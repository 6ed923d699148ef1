"""Runs without a driver: the operator jogs and asks for each view, and is told where to go; only jogs move the arm."""

import asyncio
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.transforms import rotation_from_vector, transform
from daemon.model.records import RunRecord
from daemon.model.run_states import RunState
from daemon.store.store import Store
from drivers.errors import DeviceTimeout
from tests.daemon.by_hand import COLUMNS, FRAME_PX, POSES, ROWS, by_hand
from tests.daemon.cell_under_test import Bench, Parts, pose_json, serving, settings_for
from tests.daemon.fakes import FLANGE_T_CAMERA, Gate
from tests.support.waiting import LIMIT_S

TEXT = {"accept": "text/plain"}


async def test_the_operator_jogs_takes_views_and_finishes_and_nothing_ever_moves_the_arm(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.status = {"motors_on": False, "automatic": False, "program_running": False}
    async with by_hand(tmp_path, parts, flange_T_camera_guess=pose_json(FLANGE_T_CAMERA)) as hand:
        for number, pose in enumerate(POSES, start=1):
            taken = (await hand.takes(pose)).json()
            assert (taken["state"], taken["station"]) == ("waiting", number)
            assert taken["planning"]["advice"]
        assert taken["planning"]["now_mm"] is not None
        ended = await hand.finishes()
        assert (ended.status_code, ended.json()["state"], ended.json()["station"]) == (200, "finished", 6)
        calibration = (await hand.bench.client.get(ended.json()["links"]["calibration"])).json()
        assert len(calibration["views"]) == 6
        assert (parts.robot.goals, parts.robot.stops, parts.robot.armed) == ([], 0, False)
        assert (await hand.bench.client.post("/scans", json={"name": "free again"})).status_code == 201


async def test_advice_leads_on_from_nothing_known_to_enough(tmp_path: Path) -> None:
    async with by_hand(tmp_path) as hand:
        first = (await hand.takes(POSES[0])).json()["planning"]
        assert first["advice"].startswith("turn the flange by about 30 deg about its z")
        assert first["advice_steps"][0] == {"turn_axis": "z", "deg": 30.0}
        assert first["next_pose"] is None
        second = (await hand.takes(POSES[0] @ transform(rotation_from_vector([0, 0, 0.4]), [0, 0, 0]))).json()
        assert "about its z" not in second["planning"]["advice"]
        third = (await hand.takes(POSES[2])).json()["planning"]
        assert third["next_pose"] is not None
        target = PoseDocument.model_validate(third["next_pose"]).transform()
        fourth = await hand.takes(target)
        assert fourth.status_code == 200, "the advice leads to where the target is in the picture"
        views = (await hand.bench.client.get(f"/runs/{hand.run['id']}/views")).json()["views"]
        corners = {number: (u, v) for number, u, v, *_ in views[-1]["corners"]}
        outline = [corners[number] for number in (0, COLUMNS - 1, COLUMNS * ROWS - 1, COLUMNS * (ROWS - 1))]
        np.testing.assert_allclose(third["next_outline_px"], outline, atol=FRAME_PX)
        assert first["next_outline_px"] is None
        assert fourth.json()["planning"]["now_mm"] == pytest.approx(third["planned_mm"], rel=0.5)
        steps = fourth.json()["planning"]["advice_steps"]
        assert {*map(frozenset, steps)} <= {frozenset(("turn_axis", "deg")), frozenset(("shift_mm",))}
        history = fourth.json()["planning"]["history"]
        assert [row["station"] for row in history] == [1, 2, 3, 4]
        assert [row["now_mm"] for row in history[2:]] == [third["now_mm"], fourth.json()["planning"]["now_mm"]]
        await hand.bench.application.events.flush()
        last = [event.data for event in hand.bench.application.events._kept if event.kind == "run"][-1]
        assert (last["now_mm"], last["station"]) == (history[-1]["now_mm"], 4)
        words = (await hand.bench.client.get(hand.run["links"]["self"], headers=TEXT)).text
        assert f"next: {fourth.json()['planning']['advice']}" in words
        assert "stations" in words


async def test_it_says_when_enough_is_known(tmp_path: Path) -> None:
    """These views roll the camera too little for fewer than six to be enough, however small U is."""
    settings = {"flange_T_camera_guess": pose_json(FLANGE_T_CAMERA), "tolerance_mm": 1.0}
    async with by_hand(tmp_path, **settings) as hand:
        advice = [(await hand.takes(pose)).json()["planning"]["advice"] for pose in POSES]
        enough = "that is enough: finish the run; or go on: turn the flange by "
        assert [words.startswith(enough) for words in advice] == [False] * 5 + [True]


async def test_an_arm_that_moves_is_refused_at_once_and_the_run_goes_on_waiting(tmp_path: Path) -> None:
    async with by_hand(tmp_path) as hand:
        hand.bench.robot.drift_mm = 0.03
        refused = await hand.takes(POSES[0])
        assert (refused.status_code, refused.json()["code"]) == (409, "not-still")
        assert "it moved by 0.030 mm" in refused.json()["detail"]
        assert "joystick" in refused.json()["fix"]
        assert hand.bench.camera.pictures == 0
        hand.bench.robot.drift_mm = 0.0
        assert (await hand.takes()).json()["station"] == 1


async def test_an_arm_jogged_away_while_the_picture_was_taken_is_refused(tmp_path: Path) -> None:
    async with by_hand(tmp_path) as hand:
        hand.bench.camera.blind = lambda _: bool(hand.bench.robot.base_T_flange.__setitem__((0, 3), 700.0))
        refused = await hand.takes(POSES[0])
        assert (refused.status_code, refused.json()["code"]) == (409, "not-still")
        assert (await hand.sees())["state"] == "waiting"


async def test_a_picture_without_the_target_is_kept_to_look_at_but_does_not_count(tmp_path: Path) -> None:
    async with by_hand(tmp_path) as hand:
        await hand.takes(POSES[0])
        hand.bench.camera.blind = lambda k: k == 2
        refused = await hand.takes(POSES[1])
        assert (refused.status_code, refused.json()["code"]) == (422, "target-not-seen")
        frame = f"/runs/{hand.run['id']}/frames/1"
        assert frame in refused.json()["fix"]
        assert (await hand.bench.client.get(frame)).status_code == 200
        assert ((await hand.sees())["state"], (await hand.sees())["station"]) == ("waiting", 1)
        for pose in POSES[1:3]:
            assert (await hand.takes(pose)).status_code == 200
        assert "picture 3 was taken" in (await hand.takes(POSES[1])).json()["detail"], "the refused one is picture 2"
        ended = (await hand.finishes()).json()
        assert (ended["state"], ended["station"]) == ("finished", 3)


async def test_the_same_pose_again_is_refused(tmp_path: Path) -> None:
    async with by_hand(tmp_path) as hand:
        await hand.takes(POSES[0])
        again = await hand.takes(POSES[0] @ transform(np.eye(3), [0.3, 0, 0]))
        assert (again.status_code, again.json()["code"]) == (409, "same-pose")
        assert "picture 1" in again.json()["detail"]
        assert "turn the flange" in again.json()["fix"]
        made = again.json()["details"]["what"]
        assert (made["id"], made["params"]["number"]) == ("stands-at-view", 1)
        assert made["params"]["off_mm"] == pytest.approx(0.3, abs=0.01)
        assert hand.bench.camera.pictures == 1


@pytest.mark.parametrize("views", [0, 2])
async def test_it_cannot_be_finished_with_fewer_than_three_views(tmp_path: Path, views: int) -> None:
    async with by_hand(tmp_path) as hand:
        for pose in POSES[:views]:
            await hand.takes(pose)
        refused = await hand.finishes()
        assert (refused.status_code, refused.json()["code"]) == (409, "too-few-views")
        assert f"pictures that show the target: {views}; 3 are needed" in refused.json()["detail"]
        assert (await hand.sees())["state"] == "waiting"


async def test_nothing_more_is_taken_after_the_end(tmp_path: Path) -> None:
    async with by_hand(tmp_path) as hand:
        for pose in POSES[:3]:
            await hand.takes(pose)
        await hand.finishes()
        for answer in (await hand.takes(POSES[3]), await hand.finishes()):
            assert (answer.status_code, answer.json()["code"]) == (409, "run-over")
        unknown = await hand.bench.client.post("/runs/no-such-run/stations")
        assert (unknown.status_code, unknown.json()["code"]) == (404, "not-found")


@pytest.mark.parametrize(
    ("body", "status", "detail"),
    [
        (b'{"count": 3}', 422, "count: unknown key"),
        (b"[]", 422, "[] is not possible"),
        (b"{", 400, "not JSON"),
    ],
)
async def test_a_body_where_none_is_taken_is_refused(tmp_path: Path, body: bytes, status: int, detail: str) -> None:
    async with by_hand(tmp_path) as hand:
        hand.jogs_to(POSES[0])
        refused = await hand.bench.client.post(hand.run["links"]["stations"], content=body)
        assert (refused.status_code, detail in refused.json()["detail"]) == (status, True), refused.text
        assert (await hand.sees())["station"] == 0
        taken = await hand.bench.client.post(hand.run["links"]["stations"], json={})
        assert taken.status_code == 200, taken.text


async def test_a_run_that_drives_itself_takes_no_views_by_hand(bench: Bench) -> None:
    run = (await bench.client.post("/calibrate")).json()
    refused = await bench.client.post(f"/runs/{run['id']}/stations")
    assert (refused.status_code, refused.json()["code"]) == (409, "not-waiting")
    assert "stations" not in run["links"]
    await bench.run_over(run["links"]["self"])


async def test_two_requests_at_once_take_one_view(tmp_path: Path) -> None:
    async with by_hand(tmp_path) as hand:
        answers = await asyncio.gather(*(hand.takes(POSES[0]) for _ in range(4)))
        assert sorted(answer.status_code for answer in answers) == [200, 409, 409, 409]
        assert {answer.json()["code"] for answer in answers if answer.status_code == 409} <= {"cell-busy", "same-pose"}
        assert (await hand.sees())["station"] == 1


async def test_a_device_that_fails_is_reported_and_the_run_goes_on_waiting(tmp_path: Path) -> None:
    async with by_hand(tmp_path) as hand:
        hand.bench.robot.lost = True
        assert (await hand.takes(POSES[0])).status_code == 503
        hand.bench.robot.lost = False
        hand.bench.camera.failing = DeviceTimeout("camera", "no picture in time", "look at the camera")
        assert (await hand.takes()).status_code == 504
        hand.bench.camera.failing = None
        assert (await hand.takes()).json()["station"] == 1


async def test_an_operator_who_does_not_come_back_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """But for as long as the settings say: waiting is no step that hangs."""
    monkeypatch.setattr("daemon.runs.supervisor.MAX_STEP_S", 0.05)
    async with by_hand(tmp_path, manual_wait_s=0.3) as hand:
        run = await hand.bench.run_over(hand.run["links"]["self"])
        assert (run["state"], run["cause"]["code"]) == ("failed", "operator-gone")
        assert "manual_wait_s" in run["cause"]["fix"]


async def test_aborted_it_frees_the_cell_and_commands_nothing(tmp_path: Path) -> None:
    async with by_hand(tmp_path) as hand:
        await hand.takes(POSES[0])
        held = await hand.bench.client.post("/calibrate")
        assert (held.status_code, held.json()["holder"]) == (409, hand.run["id"])
        stopped = (await hand.bench.client.post(hand.run["links"]["abort"])).json()
        assert (stopped["state"], hand.bench.robot.stops) == ("aborted", 0)
        assert stopped["cause"]["what"].startswith("aborted by a request over REST after picture 1 of")
        again = await hand.bench.client.post("/calibrate", json={"manual": True})
        assert again.status_code == 202


async def test_aborted_in_the_middle_of_a_view_both_who_asked_get_an_answer(tmp_path: Path) -> None:
    async with by_hand(tmp_path) as hand:
        looked, go_on = asyncio.Event(), asyncio.Event()
        grab = hand.bench.camera.grab

        async def slowly(newer_than_s: float) -> Any:
            looked.set()
            await go_on.wait()
            return await grab(newer_than_s)

        hand.bench.camera.grab = slowly  # type: ignore[method-assign]
        taking = asyncio.create_task(hand.takes(POSES[0]))
        await asyncio.wait_for(looked.wait(), LIMIT_S)
        assert (await hand.bench.client.post(hand.run["links"]["abort"])).json()["state"] == "aborted"
        told = await taking
        assert (told.status_code, told.json()["code"]) == (409, "run-over")


async def test_a_daemon_that_stopped_says_so_after_its_restart(tmp_path: Path) -> None:
    store = Store(tmp_path)
    run = RunRecord("20261121-090000-aaaaaa", "calibration", RunState.WAITING, 2, 3, "t", "t", None, {"manual": True})
    await store.save_run(run)
    await store.close()
    async with serving(settings_for(tmp_path)) as bench:
        seen = (await bench.client.get(f"/runs/{run.id}")).json()
        assert (seen["state"], seen["cause"]["code"]) == ("failed", "interrupted")
        assert (await bench.client.post(f"/runs/{run.id}/stations")).json()["code"] == "run-over"


@pytest.mark.parametrize(
    ("body", "status", "says"),
    [
        ({"manual": True, "poses": [pose_json(pose) for pose in POSES[:3]]}, 422, "nothing moves the arm"),
        ({"manual": "perhaps"}, 422, "manual"),
    ],
)
async def test_requests_that_contradict_themselves_are_refused(
    bench: Bench, body: dict[str, Any], status: int, says: str
) -> None:
    refused = await bench.client.post("/calibrate", json=body)
    assert refused.status_code == status
    assert says in refused.text


async def test_without_a_robot_to_read_no_manual_run_begins(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.lost = True
    async with serving(settings_for(tmp_path), parts) as bench:
        refused = await bench.client.post("/calibrate", json={"manual": True})
        assert (refused.status_code, refused.json()["code"]) == (503, "cell-not-ready")
        parts.robot.lost = False


async def test_taught_poses_do_not_keep_an_operator_from_jogging(tmp_path: Path) -> None:
    taught = [pose_json(pose) for pose in POSES]
    async with by_hand(tmp_path, poses=taught) as hand:
        taken = (await hand.takes(POSES[0])).json()
        assert taken["station"] == 1
        assert not hand.bench.robot.goals


# --- jogs that the operator asks the run for ---

UP = {"shift_mm": [0.0, 0.0, 20.0]}


async def test_the_operator_jogs_in_the_run_which_keeps_the_cell(tmp_path: Path) -> None:
    async with by_hand(tmp_path) as hand:
        robot, ask = hand.bench.robot, hand.bench.client
        assert (await hand.takes(POSES[0])).status_code == 200
        start = robot.base_T_flange.copy()
        jogged = await ask.post(hand.run["links"]["jog"], json=UP)
        assert (jogged.status_code, jogged.json()["state"], jogged.json()["station"]) == (200, "waiting", 1)
        np.testing.assert_allclose(robot.base_T_flange[:3, 3] - start[:3, 3], [0, 0, 20], atol=1e-9)
        assert (len(robot.goals), robot.armed) == (1, False)
        outside = await ask.post("/robot/jog", json=UP)
        assert (outside.status_code, outside.json()["code"]) == (409, "run-in-progress")
        assert (await hand.takes(POSES[1])).json()["station"] == 2


async def test_a_jog_that_is_refused_moves_nothing_and_the_run_goes_on_waiting(tmp_path: Path) -> None:
    async with by_hand(tmp_path) as hand:
        ask, link = hand.bench.client, hand.run["links"]["jog"]
        fast = await ask.post(link, json={**UP, "speed_mm_s": 101})
        assert (fast.status_code, "faster than the settings' 100 mm/s" in fast.text) == (422, True)
        hand.bench.robot.status = {"automatic": False}
        by_hand_only = await ask.post(link, json=UP)
        assert (by_hand_only.status_code, by_hand_only.json()["code"]) == (503, "cell-not-ready")
        assert ((await hand.sees())["state"], hand.bench.robot.goals) == ("waiting", [])
        hand.bench.robot.status = {}
        assert (await hand.takes(POSES[0])).json()["station"] == 1


async def test_while_the_arm_is_jogged_there_is_no_view_and_an_abort_stops_it(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(1)
    async with by_hand(tmp_path, parts) as hand:
        jogging = asyncio.create_task(hand.bench.client.post(hand.run["links"]["jog"], json=UP))
        await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        assert (await hand.sees())["state"] == "moving"
        busy = await hand.takes()
        assert (busy.status_code, "the move in progress" in busy.text) == (409, True)
        aborted = await hand.bench.client.post(hand.run["links"]["abort"])
        assert (aborted.status_code, aborted.json()["state"]) == (200, "aborted")
        assert (await jogging).json()["code"] == "run-over"
        assert (parts.robot.stops, parts.robot.armed) == (1, False)


async def test_a_jog_without_a_manual_run_is_refused(tmp_path: Path) -> None:
    async with by_hand(tmp_path) as hand:
        assert (await hand.bench.client.post(hand.run["links"]["abort"])).status_code == 200
        over = await hand.bench.client.post(hand.run["links"]["jog"], json=UP)
        assert (over.status_code, over.json()["code"]) == (409, "run-over")
        assert not hand.bench.robot.goals

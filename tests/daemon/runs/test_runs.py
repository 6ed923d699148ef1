"""Runs, as an operator sees them over REST, with devices that misbehave on purpose."""

import asyncio
import errno
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest

from daemon.errors import StorageFull
from daemon.model.records import RunRecord
from daemon.model.run_states import RunState
from daemon.runs.run_modules import load_run_modules
from daemon.runtime.durable_files import write_durably
from daemon.sessions.session_reader import load_problem, open_session
from daemon.store.store import Store
from drivers.errors import DeviceTimeout, GarbledAnswer, LinkLost, MoveRefused
from tests.daemon.cell_under_test import Bench, Parts, pose_json, serving, settings_for
from tests.daemon.fakes import Gate, poses_around_the_target
from tests.support.waiting import LIMIT_S

TEXT = {"accept": "text/plain"}


@pytest.mark.slow
@pytest.mark.parametrize(("path", "module"), [("/calibrate", "calibration_run"), ("/verify", "verification_run")])
async def test_detectors_and_solver_are_loaded_before_the_arm_is_armed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, path: str, module: str
) -> None:
    armed: list[bool] = []
    async with serving(settings_for(tmp_path, calibration={"policy": "auto", "tolerance_mm": 20.0})) as bench:
        await bench.run_over((await bench.client.post("/calibrate")).headers["location"])
        monkeypatch.setattr(f"daemon.runs.{module}.load_run_modules", lambda: armed.append(bench.robot.armed))
        goals = len(bench.robot.goals)
        await bench.run_over((await bench.client.post(path)).headers["location"])
        assert armed == [False]
        assert len(bench.robot.goals) > goals


async def test_a_calibration_runs_from_the_first_move_to_the_stored_result(bench: Bench) -> None:
    started = await bench.client.post("/calibrate")
    assert started.status_code == 202
    assert started.headers["retry-after"]
    run = await bench.run_over(started.headers["location"])
    assert (run["state"], run["station"], run["stations"]) == ("finished", 5, 5)
    calibration = (await bench.client.get(run["links"]["calibration"])).json()
    assert calibration["id"] == run["id"]
    assert len(bench.robot.goals) == 5
    assert not bench.robot.armed
    assert all(settled_s <= newer_than_s for settled_s, newer_than_s in bench.camera.asked)
    frame = await bench.client.get(f"/runs/{run['id']}/frames/4")
    assert frame.content.startswith(b"\x89PNG")


async def test_with_wait_the_answer_is_the_finished_run_and_a_person_can_read_it(bench: Bench) -> None:
    answer = await bench.client.post("/calibrate", params={"wait": LIMIT_S})
    assert (answer.status_code, answer.json()["state"]) == (200, "finished")
    words = await bench.client.get(answer.headers["location"], headers=TEXT)
    assert words.headers["content-type"].startswith("text/plain")
    assert "flange_T_camera" in words.text or "refused" in words.text


async def test_the_folder_of_a_run_is_a_session_that_shows_the_target(bench: Bench, tmp_path: Path) -> None:
    run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
    problem = load_problem(open_session(tmp_path / "runs" / run["id"]))
    assert [view.detection is not None for view in problem.views] == [True] * 5


async def test_a_second_calibrate_learns_who_holds_the_cell(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(2)
    async with serving(settings_for(tmp_path), parts) as bench:
        first = (await bench.client.post("/calibrate")).json()
        await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        for path in ("/calibrate", "/verify", "/calibrate?wait=5"):
            second = await bench.client.post(path)
            if path != "/verify":
                assert (second.status_code, second.json()["holder"]) == (409, first["id"])
                assert first["id"] in second.json()["fix"]
        assert (await bench.client.get("/ready")).json()["calibrate"]["reasons"] == [
            f"calibration run {first['id']} is in progress"
        ]
        gate.open.set()
        assert (await bench.run_over(f"/runs/{first['id']}"))["state"] == "finished"


@pytest.mark.parametrize("hangs", ["move", "picture"])
async def test_a_device_that_never_answers_ends_the_run_though_its_driver_has_no_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hangs: str
) -> None:
    load_run_modules()  # which takes the first run of a process longer than a second where the machine is busy
    monkeypatch.setattr("daemon.runs.supervisor.MAX_STEP_S", 1.0)
    parts = Parts()
    never = asyncio.Event()

    async def waits_for_ever(*_: object) -> Any:
        await never.wait()

    if hangs == "move":
        parts.robot.before_move = waits_for_ever
    else:
        monkeypatch.setattr(parts.camera, "grab", waits_for_ever)
    async with serving(settings_for(tmp_path), parts) as bench:
        run = (await bench.client.post("/calibrate?wait=200")).json()
        assert (run["state"], run["cause"]["code"]) == ("failed", "run-stalled")
        assert f"while {'moving' if hangs == 'move' else 'capturing'}" in run["cause"]["what"]
        assert (bench.robot.armed, bench.robot.stops) == (False, 1)
        never.set()
        monkeypatch.undo()
        parts.robot.before_move = None
        assert (await bench.client.post("/calibrate?wait=200")).json()["state"] == "finished"


async def test_two_calibrates_in_the_same_moment_start_one_run(bench: Bench) -> None:
    answers = await asyncio.gather(*(bench.client.post("/calibrate") for _ in range(5)))
    assert sorted(answer.status_code for answer in answers) == [202, 409, 409, 409, 409]


async def test_a_link_lost_between_stations_fails_the_run_and_moves_nothing(tmp_path: Path) -> None:
    parts = Parts()

    async def break_at_4(move: int) -> None:
        parts.robot.lost = move == 4

    parts.robot.before_move = break_at_4
    async with serving(settings_for(tmp_path), parts) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert run["state"] == "failed"
        assert run["cause"]["what"] == "link to the controller lost after picture 3 of 5"
        assert run["cause"]["fix"]
        assert len(bench.robot.goals) == 4
        ready = (await bench.client.get("/ready")).json()
        assert not ready["calibrate"]["ready"]
        assert (await bench.client.post("/calibrate")).status_code == 503
        parts.robot.lost = False
        parts.robot.before_move = None
        assert len(bench.robot.goals) == 4


@pytest.mark.parametrize(
    ("break_it", "code", "says"),
    [
        (lambda p: setattr(p.robot, "drift_mm", 1.0), "not-still", "did not come to rest"),
        (lambda p: setattr(p.camera, "blind", lambda _: p.robot.base_T_flange.__setitem__((0, 3), 0.0)),
         "not-still", "during the capture (before picture 1 of 5)"),
        (lambda p: setattr(p.camera, "size", (320, 240)) or setattr(p.camera, "blind", lambda _: True),
         "picture-unusable", "320 x 240 pixels where 640 x 480"),
        (lambda p: setattr(p.camera, "blind", lambda _: True), "target-not-seen", "seen in 0 of 5 pictures"),
        (lambda p: setattr(p.camera, "blind", lambda k: k in {1, 3, 5}), "target-not-seen", "not in picture 1, 3, 5"),
    ],
)  # fmt: skip
async def test_what_went_wrong_is_said(
    tmp_path: Path, break_it: Callable[[Parts], object], code: str, says: str
) -> None:
    parts = Parts()
    break_it(parts)
    async with serving(settings_for(tmp_path), parts) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert (run["state"], run["cause"]["code"]) == ("failed", code)
        assert says in run["cause"]["what"]
        assert run["cause"]["fix"]
        assert not bench.robot.armed
        words = (await bench.client.get(f"/runs/{run['id']}", headers=TEXT)).text
        assert says in words


async def test_a_camera_by_any_name_that_fails_is_not_taken_for_the_robot(tmp_path: Path) -> None:
    parts = Parts()

    async def unplug(move: int) -> None:
        parts.camera.failing = LinkLost("GenICam 10.0.0.7", "no more frames come", "look at the cable")

    parts.robot.before_move = unplug
    async with serving(settings_for(tmp_path), parts) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert (run["cause"]["code"], run["cause"]["what"].partition(":")[0]) == ("link-lost", "GenICam 10.0.0.7")


async def test_a_robot_that_answers_garbage_fails_the_run_and_the_daemon_stays(tmp_path: Path) -> None:
    parts = Parts()

    async def garble(move: int) -> None:
        if move == 2:
            raise GarbledAnswer("robot fake", "bytes that are no frame: 00 01", "look who else uses the line")

    parts.robot.before_move = garble
    async with serving(settings_for(tmp_path), parts) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert run["cause"]["code"] == "garbled-answer"
        assert "no frame" in run["cause"]["what"]
        assert (await bench.client.get("/health")).status_code == 200


@pytest.mark.parametrize("path", ["/robot", "/ready"])
async def test_a_robot_that_is_not_there_is_reported(tmp_path: Path, path: str) -> None:
    parts = Parts()
    parts.robot.broken_with = DeviceTimeout("robot tcp://r:1", "no answer within 2 s", "look at the cable")
    async with serving(settings_for(tmp_path), parts) as bench:
        answer = await bench.client.get(path)
        assert answer.status_code in {503, 504}
        assert "no answer within 2 s" in answer.text


async def test_a_refused_move_is_reported_with_the_controllers_reason(tmp_path: Path) -> None:
    parts = Parts()

    async def refuse(move: int) -> None:
        raise MoveRefused(
            "robot fake", "the controller refused the move: UNREACHABLE", "choose another pose", "UNREACHABLE"
        )

    parts.robot.before_move = refuse
    async with serving(settings_for(tmp_path), parts) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert (run["cause"]["code"], "UNREACHABLE" in run["cause"]["what"]) == ("move-refused", True)


@pytest.mark.parametrize(
    ("status", "says"),
    [
        ({"emergency_stop": True}, "emergency stop"),
        ({"motors_on": False}, "motors are off"),
        ({"automatic": False}, "automatic"),
        ({"program_running": False}, "program"),
    ],
)
async def test_a_cell_that_is_not_ready_refuses_to_start(tmp_path: Path, status: dict[str, bool], says: str) -> None:
    parts = Parts()
    parts.robot.status = status
    async with serving(settings_for(tmp_path), parts) as bench:
        answer = await bench.client.post("/calibrate")
        assert (answer.status_code, answer.json()["code"]) == (503, "cell-not-ready")
        assert says in answer.json()["reasons"][0]
        assert (await bench.client.get("/runs")).json()["runs"] == []
        assert not bench.robot.goals


async def test_a_pose_outside_the_box_is_refused_before_anything_moves(tmp_path: Path) -> None:
    poses = [pose_json(pose) for pose in poses_around_the_target(4)]
    poses[2]["translation_mm"][2] = 2600.0
    async with serving(settings_for(tmp_path)) as bench:
        answer = await bench.client.post("/calibrate", json={"poses": poses})
        assert (answer.status_code, answer.json()["code"]) == (422, "pose-refused")
        assert "pose 3" in answer.json()["detail"]
        assert not bench.robot.goals


async def test_a_pose_out_of_reach_of_a_known_arm_is_refused_before_anything_moves(tmp_path: Path) -> None:
    poses = [pose_json(pose) for pose in poses_around_the_target(3)]
    poses[1]["translation_mm"][0] = 1900.0
    settings = settings_for(tmp_path, robot={"model": "IRB 1600-6/1.45"})
    async with serving(settings) as bench:
        answer = await bench.client.post("/calibrate", json={"poses": poses})
        assert (answer.status_code, answer.json()["code"]) == (422, "pose-refused")
        assert "beyond the reach" in answer.json()["detail"]
        assert not bench.robot.goals


async def test_the_postures_of_a_known_arm_are_computed_and_taught_ones_kept(tmp_path: Path) -> None:
    taught: list[dict[str, Any]] = [pose_json(pose) for pose in poses_around_the_target(3)]
    settings = settings_for(tmp_path, robot={"model": "IRB 1600-6/1.45"}, calibration={"poses": taught})
    async with serving(settings) as bench:
        await bench.client.post("/calibrate", params={"wait": LIMIT_S})
        assert len({goal.posture for goal in bench.robot.goals} - {(0, 0, 0, 0)}) >= 1
    taught[1]["configuration"] = [0, 0, 0, 1]
    async with serving(settings_for(tmp_path, calibration={"poses": taught})) as bench:
        await bench.client.post("/calibrate", params={"wait": LIMIT_S})
        assert [goal.posture for goal in bench.robot.goals] == [(0, 0, 0, 0), (0, 0, 0, 1), (0, 0, 0, 0)]


async def test_more_poses_than_are_taught_and_nothing_to_plan_with_are_reported(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        answer = await bench.client.post("/calibrate", json={"count": 9})
        assert (answer.status_code, answer.json()["code"]) == (409, "no-poses")
    parts = Parts()
    parts.camera.blind = lambda _: True
    async with serving(settings_for(tmp_path, calibration={"poses": []}), parts) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert (run["state"], run["cause"]["code"]) == ("failed", "target-not-seen")
        assert "not seen from where the arm stands" in run["cause"]["what"]
        assert not bench.robot.goals


async def test_a_full_disk_fails_the_run_keeps_what_was_stored_and_the_daemon_up(tmp_path: Path) -> None:
    full = asyncio.Event()

    def disk(path: Path, blocks: Iterable[bytes]) -> None:
        if full.is_set() and path.name == "view_002.png":
            raise OSError(errno.ENOSPC, "No space left on device")
        write_durably(path, blocks)

    async with serving(settings_for(tmp_path), store=Store(tmp_path, disk)) as bench:
        before = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        full.set()
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert (run["state"], run["cause"]["code"]) == ("failed", "storage-full")
        assert "disk" in run["cause"]["what"]
        assert not bench.robot.armed
        session = json.loads((tmp_path / "runs" / run["id"] / "session.json").read_text())
        assert [view["image"] for view in session["views"]] == ["view_000.png", "view_001.png"]
        assert (await bench.client.get(f"/calibrations/{before['id']}")).status_code == 200
        full.clear()
        assert (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()["state"] == "finished"


async def test_a_database_that_cannot_take_a_run_does_not_start_it(tmp_path: Path) -> None:
    store = Store(tmp_path)
    async with serving(settings_for(tmp_path), store=store) as bench:
        before = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        database = store._database
        pages = await database.read(lambda db: db.execute("PRAGMA page_count").fetchone()[0])
        await database.read(lambda db: db.execute(f"PRAGMA max_page_count = {pages}").fetchone())
        body = {"poses": [pose_json(pose) for pose in poses_around_the_target(60)]}
        answer = await bench.client.post("/calibrate", json=body)
        assert (answer.status_code, answer.json()["code"]) == (507, "storage-full")
        assert len(bench.robot.goals) == 5
        assert (await bench.client.get(f"/runs/{before['id']}")).status_code == 200


class DiskThatFills(Store):
    """A store whose rows cannot be written while `full`."""

    full = False

    async def save_run(self, run: RunRecord) -> None:
        if self.full:
            raise StorageFull("the disk is full", "free some space")
        await super().save_run(run)


async def test_a_run_whose_end_cannot_be_stored_is_reported_from_memory_and_stored_later(tmp_path: Path) -> None:
    parts, store = Parts(), DiskThatFills(tmp_path)

    async def fill(move: int) -> None:
        store.full = move == 2

    parts.robot.before_move = fill
    async with serving(settings_for(tmp_path), parts, store) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert (run["state"], run["cause"]["code"]) == ("failed", "storage-full")
        assert (await store.run(run["id"])).state == "moving"
        assert (await bench.client.post("/calibrate")).status_code == 507
        assert (await bench.client.get(run["links"]["self"])).json()["state"] == "failed"
        assert (await bench.client.get("/runs")).json()["runs"][0]["state"] == "failed"
        store.full = False
        parts.robot.before_move = None
        assert (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()["state"] == "finished"
        assert (await store.run(run["id"])).state == "failed"


async def test_a_daemon_whose_disk_is_full_starts_and_reports_what_was_interrupted(tmp_path: Path) -> None:
    store = DiskThatFills(tmp_path)
    await store.save_run(RunRecord("r1", "calibration", RunState.MOVING, 1, 3, "2026", "2026"))
    store.full = True
    async with serving(settings_for(tmp_path), store=store) as bench:
        run = (await bench.client.get("/runs/r1")).json()
        assert (run["state"], run["cause"]["code"]) == ("failed", "interrupted")


async def test_policy_auto_applies_what_the_verdict_accepts(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, calibration={"policy": "auto", "tolerance_mm": 20.0})) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert run["result"]["applied"] == run["result"]["accepted"]
        current = await bench.client.get("/calibrations/current")
        assert current.status_code == (200 if run["result"]["accepted"] else 404)


async def test_a_tolerance_decides_over_acceptance_and_is_kept_with_the_calibration(tmp_path: Path) -> None:
    calibration = {"policy": "auto", "tolerance_mm": 20.0, "verdict": {"possible_hold_out_mm": 30.0}}
    async with serving(settings_for(tmp_path, calibration=calibration)) as bench:
        for body, tolerance_mm, accepted in (({}, 20.0, True), ({"tolerance_mm": 1e-7}, 1e-7, False)):
            run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S}, json=body)).json()
            assert (run["result"]["accepted"], run["result"]["applied"]) == (accepted, accepted)
            verdict = (await bench.client.get(run["links"]["calibration"])).json()["verdict"]
            assert verdict["limits"]["tolerance_mm"] == tolerance_mm
            assert verdict["limits"]["possible_hold_out_mm"] == 30.0
        assert "point-uncertain" in {found["code"] for found in verdict["findings"] if found["severity"] == "error"}


async def test_the_uncertainty_counts_at_the_part(tmp_path: Path) -> None:
    part = {"points": [{"name": "far away", "position_mm": [0.0, 0.0, 1e12], "frame": "camera"}]}
    async with serving(settings_for(tmp_path, calibration={"tolerance_mm": 20.0}, part=part)) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        findings = (await bench.client.get(run["links"]["calibration"])).json()["verdict"]["findings"]
        assert not run["result"]["accepted"]
        assert any("far away" in found["message"] for found in findings)

"""Jogs over REST: small moves under the rules of every run, in a stated frame or by axis, and nothing else."""

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from calibration.documents.pose import PoseDocument
from calibration.transforms import rotation_angle_rad, rotation_from_vector
from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.fakes import Gate
from tests.support.waiting import LIMIT_S

UP = {"shift_mm": [0.0, 0.0, 20.0]}


async def jogs(bench: Bench, **body: Any) -> dict[str, Any]:
    """The finished run of a jog."""
    answer = await bench.client.post("/robot/jog", params={"wait": LIMIT_S}, json=body)
    run: dict[str, Any] = answer.json()
    assert (answer.status_code, run.get("state")) == (200, "finished"), run
    return run


async def test_the_flange_moves_in_the_frame_that_is_stated_and_says_where_it_stands(bench: Bench) -> None:
    robot = bench.robot
    start = robot.base_T_flange.copy()
    await jogs(bench, **UP)
    np.testing.assert_allclose(robot.base_T_flange[:3, 3] - start[:3, 3], [0, 0, 20], atol=1e-9)
    np.testing.assert_allclose(robot.base_T_flange[:3, :3], start[:3, :3], atol=1e-12)

    run = await jogs(bench, frame="flange", shift_mm=[0.0, 0.0, -20.0], turn_deg=[0.0, 10.0, 0.0], speed_mm_s=25.0)
    moved = np.linalg.inv(start) @ robot.base_T_flange
    along = start[:3, :3].T @ [0.0, 0.0, 20.0] - [0.0, 0.0, 20.0]
    np.testing.assert_allclose(moved[:3, 3], along, atol=1e-9)
    np.testing.assert_allclose(moved[:3, :3], rotation_from_vector(np.radians([0, 10, 0])), atol=1e-12)

    turned_at, turned_from = robot.base_T_flange[:3, 3].copy(), robot.base_T_flange[:3, :3].copy()
    await jogs(bench, turn_deg=[5.0, 0.0, 0.0])
    np.testing.assert_allclose(robot.base_T_flange[:3, 3], turned_at, atol=1e-9)
    np.testing.assert_allclose(
        robot.base_T_flange[:3, :3], rotation_from_vector(np.radians([5, 0, 0])) @ turned_from, atol=1e-12
    )
    assert [goal.speed_mm_s for goal in robot.goals] == [50.0, 25.0, 50.0]
    assert not robot.armed
    stands = PoseDocument.model_validate(run["result"]["base_T_flange"]).transform()
    assert rotation_angle_rad(stands[:3, :3].T @ turned_from) < 1e-9
    listed = (await bench.client.get("/runs", params={"kind": "jog"})).json()["runs"]
    assert [each["request"].get("shift_mm") for each in listed] == [None, [0.0, 0.0, -20.0], [0.0, 0.0, 20.0]]
    assert (await bench.client.get(run["links"]["self"], headers={"accept": "text/plain"})).text.startswith(
        f"jog run {run['id']}: finished\nthe axes stand at"
    )


REFUSALS: list[tuple[dict[str, Any], int, str]] = [
    ({}, 422, "one of the four"),
    ({"axis": 1}, 422, "one of the four"),
    ({"axis": 1, "by_deg": 5, **UP}, 422, "one of the four"),
    ({"axis": 1, "by_deg": 31}, 422, "by_deg"),
    ({"shift_mm": [80.0, 80.0, 0.0]}, 422, "take several steps"),
    ({"turn_deg": [0.0, 25.0, 25.0]}, 422, "take several steps"),
    ({"frame": "world", **UP}, 422, "frame"),
    ({**UP, "speed_mm_s": 101}, 422, "faster than the settings' 100 mm/s"),
    ({"axis": 7, "by_deg": 5}, 422, "axes are moved over the CB link only"),
    ({"shift_mm": [0.0, 0.0, -100.0]}, 422, "outside the box"),
]


async def test_what_is_refused_moves_nothing(tmp_path: Path) -> None:
    parts = Parts()
    bottom = float(parts.robot.base_T_flange[2, 3]) - 50.0
    box = {"box_mm": [[-2000, -2000, bottom], [2000, 2000, 2500]]}
    async with serving(settings_for(tmp_path, robot=box), parts) as bench:
        for body, status, why in REFUSALS:
            refused = await bench.client.post("/robot/jog", json=body)
            assert (refused.status_code, why in refused.text) == (status, True), refused.text
        assert not bench.robot.goals
        assert bench.robot.stops == 0
        assert not (await bench.client.get("/runs")).json()["runs"]


async def test_during_a_run_a_jog_is_refused_and_during_a_jog_every_run(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(1)
    async with serving(settings_for(tmp_path), parts) as bench:
        manual = (await bench.client.post("/calibrate", json={"manual": True})).json()
        refused = await bench.client.post("/robot/jog", json=UP)
        assert (refused.status_code, refused.json()["holder"]) == (409, manual["id"])
        await bench.client.post(f"/runs/{manual['id']}/abort")

        jog = (await bench.client.post("/robot/jog", json=UP)).json()
        await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        for path in ("/robot/jog", "/calibrate"):
            body = UP if path == "/robot/jog" else {}
            assert (await bench.client.post(path, json=body)).json()["holder"] == jog["id"]
        assert (await bench.client.get("/camera/frame")).status_code == 200
        aborted = (await bench.client.post(f"/runs/{jog['id']}/abort")).json()
        assert (aborted["state"], bench.robot.armed) == ("aborted", False)


async def test_jogs_do_not_hide_the_last_calibration_run(bench: Bench) -> None:
    run = await bench.run_over((await bench.client.post("/calibrate")).headers["location"])
    old = await bench.application.store.run(run["id"])
    for number in range(25):
        await bench.application.store.save_run(replace(old, id=f"jog-{number}", kind="jog", result=None))
    assert (await bench.client.get("/calibrate")).json()["last_run"]["id"] == run["id"]


async def test_a_repeated_request_moves_once_and_the_audit_log_names_it(bench: Bench) -> None:
    key = {"idempotency-key": "one"}
    first = await bench.client.post("/robot/jog", params={"wait": LIMIT_S}, json=UP, headers=key)
    again = await bench.client.post("/robot/jog", params={"wait": LIMIT_S}, json=UP, headers=key)
    assert again.json()["id"] == first.json()["id"]
    assert len(bench.robot.goals) == 1
    rows = (await bench.client.get("/audit")).json()["rows"]
    (row,) = [row for row in rows if row["action"] == "run"]
    assert (row["subject"], "jog" in str(row)) == (first.json()["id"], True)

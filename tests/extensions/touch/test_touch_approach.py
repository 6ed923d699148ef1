"""POST /touch/approach: the arm brings the tip before a point, then nearer by steps, one request for each move."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, nullcontext
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.external_axis import ExternalAxisDocument
from calibration.errors import DocumentError
from calibration.kinematics.external_axis import reading_of
from calibration.transforms import Array, inverse, map_points
from daemon.model.records import AppliedCalibration, CalibrationRecord
from daemon.runtime.clock import Clock
from extensions.touch.requests import ApproachRequest
from extensions.touch.touch_tests import TouchTests
from tests.daemon.calibrations import beside as beside_axis
from tests.daemon.calibrations import document_with_covariance
from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.fakes import Gate
from tests.extensions.touch.touches import TIP, TIP_MM, json_of, pose_at, touching
from tests.support.waiting import LIMIT_S

SEEN_MM = np.array([800.0, 60.0, 300.0])


base_R_flange = pose_at(SEEN_MM)[:3, :3]
"""Of all poses here: the tool points down, slightly tilted."""


def beside(x_mm: float, y_mm: float, before_mm: float) -> Array:
    """base_T_flange (4, 4) with the tip so far beside the point, and before it, along the flange's axes."""
    return pose_at(SEEN_MM + base_R_flange @ [x_mm, y_mm, -before_mm])


FROM = beside(0.0, 0.0, 400.0)
"""Where the camera saw the point from."""


def point_to_touch(seen_from: Array = FROM) -> dict[str, Any]:
    document = document_with_covariance()
    assert document.mount_T_camera is not None
    camera_mm = map_points(np.linalg.inv(seen_from @ document.mount_T_camera.transform()), SEEN_MM[None])[0]
    return {"camera_mm": camera_mm.tolist(), "seen_from": json_of(seen_from)}


async def apply_with_covariance(bench: Bench, calibration_id: str = "cal-1") -> None:
    document = document_with_covariance().model_copy(update={"id": calibration_id})
    store = bench.application.store
    await store.save_calibration(CalibrationRecord(calibration_id, None, document.created_at, True, document))
    await store.apply(AppliedCalibration(calibration_id, document.created_at, "test"))


async def approaches(bench: Bench, **body: Any) -> dict[str, Any]:
    """The answer: the finished run, or why not."""
    asked = {"tip": TIP, "touch": point_to_touch(), **body}
    answer = await bench.client.post("/touch/approach", params={"wait": LIMIT_S}, json=asked)
    found: dict[str, Any] = answer.json()
    return found


def tips_of(bench: Bench) -> Array:
    """At the end of each move: how far the tip was beside the point (x, y), and before it."""
    tips = [map_points(goal.base_T_flange, TIP_MM[None])[0] - SEEN_MM for goal in bench.robot.goals]
    return np.array(tips) @ base_R_flange * [1, 1, -1]


async def test_to_the_stand_off_then_by_steps_and_never_beyond_the_point(bench: Bench) -> None:
    await apply_with_covariance(bench)
    bench.robot.base_T_flange = beside(30.0, -20.0, 90.0)
    run = await approaches(bench)
    assert (run["kind"], run["state"]) == ("jog", "finished"), run
    np.testing.assert_allclose(tips_of(bench), [[0, 0, 20]], atol=1e-6)
    assert run["result"]["touch"]["left_mm"] == pytest.approx(20.0, abs=1e-3)
    for expected_mm in (15.0, 10.0, 5.0, 0.0):
        stepped = await approaches(bench, step_mm=5.0)
        assert stepped["result"]["touch"]["left_mm"] == pytest.approx(expected_mm, abs=1e-3)
    refused = await approaches(bench, step_mm=0.5)
    assert (refused["status"], "no step goes beyond it" in refused["detail"]) == (422, True), refused
    np.testing.assert_allclose(tips_of(bench)[-1], [0, 0, 0], atol=1e-6)
    assert {goal.path for goal in bench.robot.goals} == {"linear"}
    assert [goal.speed_mm_s for goal in bench.robot.goals] == [50.0, *[5.0] * 4]
    assert not bench.robot.armed

    turned = bench.robot.goals[0].base_T_flange[:3, :3]
    assert all(np.allclose(goal.base_T_flange[:3, :3], turned, atol=1e-12) for goal in bench.robot.goals)
    rows = (await bench.client.get("/audit")).json()["rows"]
    assert [row["action"] for row in rows].count("run") == len(bench.robot.goals)


async def test_the_last_step_is_as_long_as_what_is_left(bench: Bench) -> None:
    await apply_with_covariance(bench)
    bench.robot.base_T_flange = beside(0.0, 0.0, 1.5)
    assert (await approaches(bench, step_mm=4.0))["result"]["touch"]["left_mm"] == pytest.approx(0.0, abs=1e-3)


async def test_from_a_touched_point_the_tip_goes_back_before_it_crosses(bench: Bench) -> None:
    """No way between the two leads nearer than the stand-off."""
    await apply_with_covariance(bench)
    bench.robot.base_T_flange = beside(60.0, 0.0, -0.3)
    assert (await approaches(bench, stand_off_mm=30.0))["state"] == "finished"
    np.testing.assert_allclose(tips_of(bench), [[60, 0, 30], [0, 0, 30]], atol=1e-6)


async def test_along_a_surfaces_normal(bench: Bench) -> None:
    await apply_with_covariance(bench)
    bench.robot.base_T_flange = beside(-50.0, 10.0, 40.0)
    assert (await approaches(bench, along=(3 * base_R_flange @ [0.6, 0.0, 0.8]).tolist()))["state"] == "finished"
    np.testing.assert_allclose(tips_of(bench), [[-12, 0, 16]], atol=1e-6)


async def test_no_direction_drives_the_tip_through_the_part(bench: Bench) -> None:
    """Where `along` leads away from the camera's look, "back" would be forward."""
    await apply_with_covariance(bench)
    for before_mm in (0.3, 20.0, 100.0):
        bench.robot.base_T_flange = beside(0.0, 0.0, before_mm)
        for along in (-base_R_flange[:, 2], base_R_flange[:, 0], base_R_flange @ [0.9, 0.0, 0.4]):
            refused = await approaches(bench, along=along.tolist())
            assert (refused["status"], "line of sight" in refused["detail"]) == (422, True), refused
    assert not bench.robot.goals


async def test_a_tip_in_metres_is_refused_and_a_short_one_is_stated_to_be_so(bench: Bench) -> None:
    await apply_with_covariance(bench)
    for flange_tip_mm in ((TIP_MM / 1000).tolist(), [0.0, 0.0, 0.0], [0.0, 3.0, 3.9]):
        refused = await approaches(bench, tip=TIP | {"flange_tip_mm": flange_tip_mm})
        assert (refused["status"], "short_tip" in str(refused)) == (422, True), refused
        before = await approaches(bench, tip=TIP | {"flange_tip_mm": flange_tip_mm}, short_tip=True)
        assert (before["status"], "the camera would come" in before["detail"]) == (422, True), before
    assert not bench.robot.goals


async def test_carried_points_are_held_against_the_point(tmp_path: Path) -> None:
    """A bracket that reaches further than the tip would meet the part before it."""
    for end_mm, refused in ((199.0, False), (201.0, True)):
        carried = {"carried_mm": [[0.0, 0.0, 50.0], [60.0, 40.0, end_mm]]}
        async with serving(settings_for(tmp_path / str(end_mm), robot=carried), Parts()) as bench:
            await apply_with_covariance(bench)
            bench.robot.base_T_flange = AWAY
            answer = await approaches(bench)
            assert ("carried_mm[1] would come 1.0 mm nearer" in answer.get("detail", "")) == refused, answer
            assert bool(bench.robot.goals) != refused


async def test_a_step_has_a_speed_of_its_own(bench: Bench) -> None:
    await apply_with_covariance(bench)
    bench.robot.base_T_flange = beside(0.0, 0.0, 15.0)
    refused = await approaches(bench, step_mm=1.0, speed_mm_s=11)
    assert (refused["status"], "of a step is at most 10" in str(refused)) == (422, True), refused
    assert (await approaches(bench, step_mm=1.0, speed_mm_s=10))["state"] == "finished"
    assert (await approaches(bench, speed_mm_s=60))["state"] == "finished"
    assert [goal.speed_mm_s for goal in bench.robot.goals] == [10.0, 60.0]


async def test_a_point_of_an_old_verification_is_refused(bench: Bench) -> None:
    await apply_with_covariance(bench)
    await bench.verify()
    run = (await bench.client.get("/runs")).json()["runs"][0]["id"]
    asked = ApproachRequest.model_validate({"tip": TIP, "verification": run, "touch": {"id": 10}})
    application = bench.application
    for hours, refused in ((0.1, False), (7.9, False), (8.1, True), (-8.1, True)):
        clock = Clock(utc_now=lambda: datetime.now(UTC) + timedelta(hours=hours))  # noqa: B023 - used in this turn
        tests = TouchTests(
            application.store, application.cell, application.service_workers, clock, application.settings
        )
        with pytest.raises(DocumentError, match="verify anew") if refused else nullcontext():
            await tests.find(asked)


async def test_a_point_of_a_calibration_that_is_no_longer_in_force_is_refused(bench: Bench) -> None:
    await apply_with_covariance(bench)
    await bench.verify()
    run = (await bench.client.get("/runs")).json()["runs"][0]["id"]
    test_id = (await touched(bench, run))["id"]
    await apply_with_covariance(bench, "cal-2")
    moved = len(bench.robot.goals)
    bench.robot.base_T_flange = touching(10, (0.0, 0.0, 100.0))
    for of in ({"verification": run, "touch": {"id": 10}}, {"tip": None, "adds_to": test_id}):
        refused = await approaches(bench, **of)
        assert (refused["status"], "cal-2 is active" in str(refused)) == (422, True), refused
    assert len(bench.robot.goals) == moved


async def touched(bench: Bench, run: str) -> dict[str, Any]:
    """A touch test of one point."""
    touch = {"id": 10, "base_T_flange": json_of(touching(10))}
    answer = await bench.client.post("/touch", json={"tip": TIP, "verification": run, "touches": [touch]})
    found: dict[str, Any] = answer.json()
    return found


AWAY = beside(30.0, 0.0, 90.0)
REFUSALS: list[tuple[Array, dict[str, Any], int, str]] = [
    (AWAY, {"step_mm": 1.0}, 422, "go to the stand-off first"),
    (beside(5.0, 0.0, 10.0), {"step_mm": 1.0}, 422, "beside the approach"),
    (beside(0.0, 0.0, -200.0), {}, 422, "beyond the point"),
    (AWAY, {"step_mm": 5.1}, 422, "step_mm"),
    (AWAY, {"stand_off_mm": 1.0}, 422, "stand_off_mm"),
    (AWAY, {"along": [0.0, 0.0, 0.0]}, 422, "no direction"),
    (AWAY, {"along": [1e200, 0.0, 0.0]}, 422, "no direction"),
    (AWAY, {"speed_mm_s": 101}, 422, "faster than the settings"),
    (AWAY, {"tip": None}, 422, "tip"),
    (AWAY, {"touch": {"id": 0}}, 422, "point 0 was not seen"),
    (AWAY, {"touch": point_to_touch() | {"camera_mm": [0.0, 0.0, -300.0]}}, 422, "behind the camera"),
    (AWAY, {"touch": point_to_touch() | {"miss_mm": [0, 0, 1]}}, 422, "names the point only"),
    (AWAY, {"verification": "nowhere"}, 404, "nowhere"),
]


async def test_what_is_refused_moves_nothing(bench: Bench) -> None:
    await apply_with_covariance(bench)
    for stands, body, status, why in REFUSALS:
        bench.robot.base_T_flange = stands
        refused = await approaches(bench, **body)
        assert (refused["status"], why in str(refused)) == (status, True), refused
    assert not bench.robot.goals
    assert not (await bench.client.get("/runs")).json()["runs"]


async def test_a_stand_off_outside_the_box_is_refused(tmp_path: Path) -> None:
    flange_mm = beside(0.0, 0.0, 20.0)[2, 3]
    box = {"box_mm": [[-2000, -2000, float(flange_mm) + 5.0], [2000, 2000, 2500]]}
    async with serving(settings_for(tmp_path, robot=box), Parts()) as bench:
        await apply_with_covariance(bench)
        bench.robot.base_T_flange = AWAY
        assert "outside the box" in (await approaches(bench))["detail"]
        assert not bench.robot.goals


async def test_an_abort_ends_the_approach_and_nothing_moves_until_it_is_asked_for_again(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(1)
    async with serving(settings_for(tmp_path), parts) as bench:
        await apply_with_covariance(bench)
        bench.robot.base_T_flange = beside(60.0, 0.0, 0.0)
        run = (await bench.client.post("/touch/approach", json={"tip": TIP, "touch": point_to_touch()})).json()
        await asyncio.wait_for(gate.reached.wait(), LIMIT_S)
        aborted = (await bench.client.post(f"/runs/{run['id']}/abort")).json()
        assert (aborted["state"], bench.robot.armed) == ("aborted", False)
        gate.open.set()
        goals = len(bench.robot.goals)
        assert goals <= 1, "of the way back and the way across only the first was begun"
        assert (await bench.client.get("/runs")).json()["runs"][0]["id"] == run["id"]
        assert len(bench.robot.goals) == goals


async def test_a_repeated_request_moves_once(bench: Bench) -> None:
    await apply_with_covariance(bench)
    bench.robot.base_T_flange = beside(0.0, 0.0, 20.0)
    body, key = {"tip": TIP, "touch": point_to_touch(), "step_mm": 2.0}, {"idempotency-key": "one"}
    first, again = [
        (await bench.client.post("/touch/approach", params={"wait": LIMIT_S}, json=body, headers=key)).json()
        for _ in range(2)
    ]
    assert first["id"] == again["id"]
    assert len(bench.robot.goals) == 1


async def test_points_of_a_verification_by_their_id(bench: Bench) -> None:
    await apply_with_covariance(bench)
    await bench.verify()
    run = (await bench.client.get("/runs")).json()["runs"][0]["id"]
    bench.robot.base_T_flange = touching(10, (0.0, 0.0, 100.0))
    moved = len(bench.robot.goals)
    found = await approaches(bench, verification=run, touch={"id": 10}, along=[0.0, 0.0, -1.0])
    assert found["state"] == "finished", found
    assert len(bench.robot.goals) == moved + 1
    np.testing.assert_allclose(bench.robot.base_T_flange[:3, 3], touching(10, (0.0, 0.0, 20.0))[:3, 3], atol=0.2)


TRACK = ExternalAxisDocument(kind="track", direction=(0.0, 1.0, 0.0), zero=100.0)
TURNTABLE = ExternalAxisDocument(kind="turntable", direction=(0.0, 0.0, 1.0), point_mm=(800.0, 0.0, 200.0))


@asynccontextmanager
async def beside_an_axis(
    folder: Path, axis: ExternalAxisDocument, reading: float
) -> AsyncIterator[tuple[Bench, Array]]:
    """The cell with the axis there, and the motion (4, 4) of its base, which the arm's poses leave out."""
    document = beside_axis(document_with_covariance(), axis)
    async with serving(settings_for(folder, robot={"external_axis": axis.model_dump()}), Parts()) as bench:
        store = bench.application.store
        await store.save_calibration(CalibrationRecord("cal-1", None, document.created_at, True, document))
        await store.apply(AppliedCalibration("cal-1", document.created_at, "test"))
        bench.robot.external_axes = (reading, *bench.robot.external_axes[1:])
        yield bench, axis.axis().motion(reading_of(axis.kind, reading))


@pytest.mark.parametrize(("axis", "reading"), [(TRACK, 250.0), (TURNTABLE, 25.0)], ids=["track", "turntable"])
async def test_the_tip_comes_before_the_point_wherever_the_axis_stands(
    tmp_path: Path, axis: ExternalAxisDocument, reading: float
) -> None:
    seen = point_to_touch() | {"seen_external_axes": [axis.zero]}
    normal = base_R_flange @ [0.0, 0.0, 1.0]
    async with beside_an_axis(tmp_path, axis, reading) as (bench, motion):
        bench.robot.base_T_flange = inverse(motion) @ beside(30.0, -20.0, 90.0)
        run = await approaches(bench, touch=seen, along=(motion[:3, :3].T @ normal).tolist())
        assert run["state"] == "finished", run
        (goal,) = bench.robot.goals
        tip_mm = map_points(motion @ goal.base_T_flange, TIP_MM[None])[0] - SEEN_MM
        np.testing.assert_allclose(tip_mm @ base_R_flange, [0, 0, -20], atol=1e-6)
        assert run["result"]["touch"]["left_mm"] == pytest.approx(20.0, abs=1e-3)

        touched = (await bench.client.post("/touch", json={"tip": TIP, "touches": [seen]})).json()
        (point,) = touched["result"]["points"]
        assert point["miss_mm"] == pytest.approx((-20 * normal).tolist(), abs=0.01)


async def test_an_approach_ends_where_the_axis_moves_meanwhile(tmp_path: Path) -> None:
    async with beside_an_axis(tmp_path, TRACK, 100.0) as (bench, _):
        bench.robot.base_T_flange = beside(60.0, 0.0, -0.3)  # two moves: back, then across

        async def push_the_track(_: int) -> None:
            bench.robot.external_axes = (120.0, *bench.robot.external_axes[1:])

        bench.robot.before_move = push_the_track
        run = await approaches(bench, touch=point_to_touch() | {"seen_external_axes": [100.0]})
        assert (run["state"], "external axis 1 moved" in run["cause"]["what"]) == ("failed", True), run
        assert len(bench.robot.goals) == 1


async def test_what_was_seen_beside_an_axis_needs_its_reading(tmp_path: Path) -> None:
    async with beside_an_axis(tmp_path, TRACK, 100.0) as (bench, _):
        bench.robot.base_T_flange = beside(0.0, 0.0, 50.0)
        refused = await approaches(bench)
        assert (refused["status"], "external axis 1" in refused["detail"]) == (422, True), refused
        assert bench.robot.goals == []

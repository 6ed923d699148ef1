"""POST /touch: points that a verification saw, touched with a known tip; nothing moves."""

from pathlib import Path
from typing import Any

import pytest

from daemon.model.records import AppliedCalibration, CalibrationRecord
from daemon.model.run_states import RunState
from tests.daemon.calibrations import document_with_covariance
from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.fakes import FLANGE_T_CAMERA, FakeCamera
from tests.daemon.named_cameras import WRIST, wrist
from tests.extensions.touch.touches import TIP, json_of, touching


async def apply_with_covariance(bench: Bench) -> None:
    document = document_with_covariance()
    store = bench.application.store
    await store.save_calibration(CalibrationRecord("cal-1", None, document.created_at, True, document))
    await store.apply(AppliedCalibration("cal-1", document.created_at, "test"))


async def test_an_operator_touches_what_a_verification_saw_point_by_point(bench: Bench) -> None:
    await apply_with_covariance(bench)
    await bench.verify()
    run = (await bench.client.get("/runs")).json()["runs"][0]["id"]
    goals = len(bench.robot.goals)
    body = {"tip": TIP, "verification": run, "touches": [{"id": 0, "base_T_flange": json_of(touching(0))}]}
    first = await bench.client.post("/touch", json=body | {"tolerance_mm": 1.0})
    assert first.status_code == 201, first.text
    assert first.json()["result"]["conformance"] == "within"

    bench.robot.base_T_flange = touching(10, (2.0, 0.0, 0.0))
    asked = {"adds_to": first.json()["id"], "touches": [{"id": 10}], "tolerance_mm": 1.0}
    second = await bench.client.post("/touch", json=asked)
    assert second.status_code == 201, second.text
    found = second.json()
    assert [point["name"] for point in found["result"]["points"]] == ["point 0", "point 10"]
    assert found["result"]["points"][1]["miss_mm"] == pytest.approx([2.0, 0.0, 0.0], abs=0.1)
    assert found["result"]["conformance"] == "beyond"
    assert (found["verification"], found["result"]["calibration_id"], found["created_by"]) == (run, "cal-1", "local")
    assert len(bench.robot.goals) == goals

    assert (await bench.client.get(second.headers["location"])).json() == found
    listed = (await bench.client.get("/touches")).json()
    assert listed == {"touches": [found, first.json()], "next": None, "damaged": []}
    words = await bench.client.get(second.headers["location"], headers={"accept": "text/plain"})
    assert "beyond the tolerance of 1 mm" in words.text
    charted = (await bench.client.get("/drift")).json()["touch_tests"]
    assert [(test["id"], test["accepted"]) for test in charted] == [(first.json()["id"], True), (found["id"], False)]
    assert charted[1]["largest_mm"] == pytest.approx(2.0, abs=0.1)
    audited = (await bench.client.get("/audit")).json()["rows"]
    assert [row["action"] for row in audited].count("touch") == 2


POSE = json_of(touching(0))
SEEN = {"camera_mm": [0.0, 0.0, 500.0], "seen_from": POSE}


@pytest.mark.parametrize(("body", "status", "says"), [
    ({"touches": [SEEN | {"base_T_flange": POSE}]}, 422, "tip"),
    ({"tip": TIP, "touches": []}, 422, "touches"),
    ({"tip": TIP, "touches": [SEEN | {"base_T_flange": POSE, "name": "\x1b[2J"}]}, 422, "cannot be printed"),
    ({"tip": TIP, "touches": [SEEN, SEEN]}, 422, "adds_to"),
    ({"tip": TIP, "touches": [{"id": 0, "base_T_flange": POSE}]}, 422, "point 0 was not seen"),
    ({"tip": TIP, "touches": [SEEN | {"base_T_flange": POSE, "camera_mm": [1e308] * 3}]}, 422, "not finite"),
    ({"tip": TIP | {"flange_tip_mm": [1e308] * 3}, "touches": [SEEN | {"base_T_flange": POSE}]}, 422, "not finite"),
    ({"tip": TIP, "verification": "nowhere", "touches": [{"id": 0, "base_T_flange": POSE}]}, 404, "nowhere"),
    ({"tip": TIP, "adds_to": "nowhere", "touches": [{"id": 0, "base_T_flange": POSE}]}, 404, "nowhere"),
    ({"tip": TIP | {"covariance": [[1, 2, 0], [0, 1, 0], [0, 0, 1]]}, "touches": [SEEN]}, 422, "symmetric"),
])  # fmt: skip
async def test_what_cannot_be_judged_is_refused(bench: Bench, body: dict[str, Any], status: int, says: str) -> None:
    await apply_with_covariance(bench)
    answer = await bench.client.post("/touch", json=body)
    assert answer.status_code == status, answer.text
    assert says in answer.text
    assert (await bench.client.get("/touches")).json()["touches"] == []


async def test_an_added_touch_keeps_tolerance_and_verification(bench: Bench) -> None:
    await apply_with_covariance(bench)
    await bench.verify()
    run = (await bench.client.get("/runs")).json()["runs"][0]["id"]
    touch = {"id": 0, "base_T_flange": json_of(touching(0, (0.4, 0.0, 0.0)))}
    body = {"tip": TIP, "verification": run, "touches": [touch], "tolerance_mm": 0.1}
    first = (await bench.client.post("/touch", json=body)).json()
    assert first["result"]["conformance"] != "within"
    second = (await bench.client.post("/touch", json={"adds_to": first["id"], "touches": [touch]})).json()
    assert second["result"]["tolerance_mm"] == 0.1
    assert not second["result"]["accepted"]

    await bench.verify()
    other = (await bench.client.get("/runs")).json()["runs"][0]["id"]
    mixed = await bench.client.post("/touch", json={"adds_to": first["id"], "verification": other, "touches": [touch]})
    assert (mixed.status_code, "begin a new test" in mixed.text) == (422, True)


async def test_a_pose_is_read_in_nobodys_use_only_and_a_given_one_needs_no_arm(bench: Bench) -> None:
    await apply_with_covariance(bench)
    async with bench.application.cell.hold("somebody"):
        read = await bench.client.post("/touch", json={"tip": TIP, "touches": [SEEN]})
        assert (read.status_code, read.json()["code"]) == (409, "cell-busy")
        given = await bench.client.post("/touch", json={"tip": TIP, "touches": [SEEN | {"base_T_flange": POSE}]})
        assert given.status_code == 201, given.text


async def test_without_a_calibration_nothing_can_be_judged(bench: Bench) -> None:
    answer = await bench.client.post("/touch", json={"tip": TIP, "touches": [SEEN | {"base_T_flange": POSE}]})
    assert (answer.status_code, answer.json()["code"]) == (409, "no-calibration")


async def test_a_run_that_is_no_verification_has_no_points(bench: Bench) -> None:
    await apply_with_covariance(bench)
    started = await bench.client.post("/calibrate")
    run = await bench.run_over(started.headers["location"])
    assert run["state"] == RunState.FINISHED
    body = {"tip": TIP, "verification": run["id"], "touches": [{"id": 0, "base_T_flange": POSE}]}
    answer = await bench.client.post("/touch", json=body)
    assert answer.status_code == 422
    assert "no finished verification" in answer.text


async def test_without_a_tolerance_the_settings_hold(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, calibration={"tolerance_mm": 1.5})) as bench:
        await apply_with_covariance(bench)
        body = {"tip": TIP, "touches": [SEEN | {"base_T_flange": POSE}]}
        found = (await bench.client.post("/touch", json=body)).json()["result"]
        assert found["tolerance_mm"] == 1.5
        stated = (await bench.client.post("/touch", json=body | {"tolerance_mm": 3.0})).json()["result"]
        assert stated["tolerance_mm"] == 3.0


async def test_a_larger_tolerance_is_refused_where_the_settings_forbid_it(tmp_path: Path) -> None:
    strict = {"tolerance_mm": 1.0, "requests_may_loosen": False}
    async with serving(settings_for(tmp_path, calibration=strict)) as bench:
        await apply_with_covariance(bench)
        body = {"tip": TIP, "touches": [SEEN | {"base_T_flange": POSE}], "tolerance_mm": 1.2}
        refused = await bench.client.post("/touch", json=body)
        assert refused.json()["code"] == "tolerance-loosened"
        assert (await bench.client.get("/touches")).json()["touches"] == []
        assert (await bench.client.post("/touch", json=body | {"tolerance_mm": 0.8})).status_code == 201


async def test_a_touch_test_goes_by_the_camera_that_saw_the_points(tmp_path: Path) -> None:
    strict = wrist(calibration={**wrist()["calibration"], "tolerance_mm": 0.25})
    calibration = {"policy": "auto", "tolerance_mm": 2.0, "requests_may_loosen": False}
    parts = Parts()
    parts.cameras["wrist"] = FakeCamera(parts.robot, flange_T_camera=WRIST)
    settings = settings_for(tmp_path, cameras={"wrist": strict}, calibration=calibration)
    async with serving(settings, parts) as bench:
        document, store = document_with_covariance(), bench.application.store
        await store.save_calibration(CalibrationRecord("cal-1", None, document.created_at, True, document, "wrist"))
        await store.apply(AppliedCalibration("cal-1", document.created_at, "test", camera="wrist"))
        seen_from, touched = json_of(FLANGE_T_CAMERA), json_of(touching(0))
        touch = {"camera_mm": [0.0, 0.0, 500.0], "seen_from": seen_from, "base_T_flange": touched}
        body: dict[str, Any] = {"tip": TIP, "touches": [touch]}
        stored = await bench.client.post("/touch", json=body | {"camera": "wrist"})
        assert (stored.status_code, stored.json()["result"]["calibration_id"]) == (201, "cal-1"), stored.text
        assert stored.json()["result"]["tolerance_mm"] == 0.25
        more = body | {"adds_to": stored.json()["id"]}
        refused = {
            "no calibration": await bench.client.post("/touch", json=body),
            "is of 'wrist'": await bench.client.post("/touch", json=more | {"camera": "camera"}),
            "no camera 'nowhere'": await bench.client.post("/touch", json=body | {"camera": "nowhere"}),
            "0.25": await bench.client.post("/touch", json=body | {"camera": "wrist", "tolerance_mm": 1.0}),
        }
        assert {says: answer.status_code for says, answer in refused.items()} == {
            "no calibration": 409, "is of 'wrist'": 422, "no camera 'nowhere'": 404, "0.25": 422,
        }  # fmt: skip
        assert all(says in answer.text for says, answer in refused.items())

"""Two cameras by name: each with its own runs, pictures, active calibration and chart."""

import asyncio
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.errors import DocumentError
from calibration.transforms import difference
from daemon.drift.schedule import DriftSchedule
from drivers.errors import DeviceUnreachable
from tests.daemon.cell_under_test import Bench, Parts, pose_json, serving, settings_for
from tests.daemon.clouds import PLY, POSE, cloud
from tests.daemon.fakes import FLANGE_T_CAMERA, FakeCamera, ply_of
from tests.daemon.named_cameras import WRIST, calibrate, two_cameras, wrist
from tests.support.waiting import LIMIT_S

OF_A_STAND = {"base_T_camera_guess": pose_json(np.eye(4))}


async def test_each_camera_has_its_own_calibration_in_force_and_chart(tmp_path: Path) -> None:
    async with two_cameras(tmp_path, calibration={"policy": "auto", "tolerance_mm": 20.0}) as bench:
        ask = bench.client
        of_wrist = await calibrate(ask, camera="wrist")
        none = await ask.get("/calibrations/current")
        assert (none.status_code, none.json()["code"]) == (404, "not-found")
        of_camera = await calibrate(ask)
        assert "camera" not in of_camera["request"]
        for name, run, true in (("wrist", of_wrist, WRIST), ("camera", of_camera, FLANGE_T_CAMERA)):
            current = (await ask.get("/calibrations/current", params={"camera": name})).json()
            assert (current["applied"]["camera"], current["calibration"]["id"]) == (name, run["id"])
            pose = PoseDocument.model_validate(current["calibration"]["flange_T_camera"]).transform()
            assert difference(true, pose)[0] < 1.0
        assert (await ask.get("/calibrations/current")).json()["calibration"]["id"] == of_camera["id"]

        verified = (await ask.post("/verify", json={"camera": "wrist"}, params={"wait": LIMIT_S})).json()
        assert verified["result"]["calibration_id"] == of_wrist["id"]
        charts = [(await ask.get("/drift", params={"camera": name})).json() for name in ("camera", "wrist")]
        assert [(chart["calibration_id"], chart["verifications"]) for chart in charts] == [
            (of_camera["id"], 0), (of_wrist["id"], 1),
        ]  # fmt: skip
        metrics = (await ask.get("/metrics")).text
        assert 'handeyed_drift_verifications{camera="wrist"} 1' in metrics
        assert metrics.count("# TYPE handeyed_drift_verifications") == 1

        again = await ask.post(f"/calibrations/{of_wrist['id']}/solve", json={"without": [0]})
        insist = {"despite_verdict": True, "reason": "four views"}
        applied = (await ask.post(f"/calibrations/{again.json()['id']}/apply", json=insist)).json()
        assert applied["camera"] == "wrist"


async def test_ready_says_of_each_schedule_why_it_waits_and_of_all_once(tmp_path: Path) -> None:
    async with two_cameras(
        tmp_path, calibration={"policy": "auto", "tolerance_mm": 20.0}, drift={"every_h": 1}
    ) as bench:
        (warning,) = (await bench.client.get("/ready")).json()["warnings"]
        assert warning.startswith("the drift schedule makes no quick checks until somebody starts a run")
        run = await calibrate(bench.client)
        assert (await bench.client.get("/ready")).json()["warnings"] == []
        schedules = [each for each in bench.application.services if isinstance(each, DriftSchedule)]
        schedules[1]._withdraw(run["id"], "camera wrist: no picture")
        (warning,) = (await bench.client.get("/ready")).json()["warnings"]
        assert warning.endswith("camera wrist: no picture")


async def test_pictures_and_devices_are_told_apart(tmp_path: Path) -> None:
    async with two_cameras(tmp_path) as bench:
        ask, pictures = bench.client, bench.camera.pictures
        assert (await ask.get("/camera/frame", params={"camera": "wrist"})).status_code == 200
        assert (await ask.get("/camera/frame.png", params={"camera": "wrist"})).status_code == 200
        assert (await ask.get("/camera/look", params={"camera": "wrist"})).status_code == 200
        assert bench.camera.pictures == pictures
        names = [device["name"] for device in (await ask.get("/devices")).json()]
        assert names == ["robot", "camera", "wrist", "scanner"]
        checked = [result["name"] for result in (await ask.post("/check")).json()["results"]]
        assert checked == ["storage", "robot", "camera", "wrist", "scanner"]


@pytest.mark.parametrize(("method", "path", "sent"), [
    ("GET", "/camera/frame?camera=nose", None), ("GET", "/drift?camera=nose", None),
    ("GET", "/calibrate?camera=nose", None), ("POST", "/calibrate", {"camera": "nose"}),
    ("POST", "/verify", {"camera": "nose"}), ("POST", "/scans", {"scanner": "nose"}),
    ("GET", "/ready?scanner=nose", None),
])  # fmt: skip
async def test_a_name_that_is_not_there_is_answered_with_those_that_are(
    bench: Bench, method: str, path: str, sent: dict[str, Any] | None
) -> None:
    answer = await bench.client.request(method, path, json=sent)
    assert (answer.status_code, answer.json()["code"]) == (404, "not-found")
    assert "'nose'" in answer.json()["detail"]


async def test_a_scanner_is_placed_by_the_calibration_of_its_camera_only(tmp_path: Path) -> None:
    scanner = {"address": "http://door/cloud.ply", "camera": "wrist", "camera_T_scanner": pose_json(np.eye(4))}
    async with two_cameras(
        tmp_path, scanners={"door": scanner}, calibration={"policy": "auto", "tolerance_mm": 20.0}
    ) as bench:
        wrong = (await calibrate(bench.client))["id"]
        right = (await calibrate(bench.client, camera="wrist"))["id"]
        query = {"pose": POSE, "scanner": "door"}
        content = ply_of(cloud(10))
        answer = await bench.client.post("/register", params=query, content=content, headers=PLY)
        assert answer.headers["handeyed-calibration"] == right
        refused = await bench.client.post(
            "/register", params={**query, "calibration": wrong}, content=content, headers=PLY
        )
        assert (refused.status_code, refused.json()["code"]) == (409, "calibration-unusable")


async def test_each_scanner_is_ready_by_what_places_its_clouds(tmp_path: Path) -> None:
    by_camera = {"address": "http://door/cloud.ply", "camera": "wrist", "camera_T_scanner": pose_json(np.eye(4))}
    by_rig = {"address": "http://roof/cloud.ply"}
    scanners = {"door": by_camera, "roof": by_rig}
    async with two_cameras(tmp_path, scanners=scanners, calibration={"policy": "auto", "tolerance_mm": 20.0}) as bench:

        async def register(name: str) -> Any:
            return (await bench.client.get("/ready", params={"scanner": name})).json()["register"]

        assert [(await register(name))["ready"] for name in scanners] == [False, False]
        await calibrate(bench.client, camera="wrist")
        assert (await register("door"))["ready"]
        both = await bench.client.get("/ready", params={"scanner": "door", "camera": "wrist"})
        assert both.status_code == 422
        assert "name its camera" in both.text


async def test_what_an_extension_solves_and_places_is_refused_without_it(tmp_path: Path) -> None:
    settings = settings_for(tmp_path, scanners={"roof": {"address": "http://roof/cloud.ply"}})
    async with serving(settings, extensions=()) as bench:
        ask, query = bench.client, {"pose": POSE, "scanner": "roof"}
        ready = (await ask.get("/ready?scanner=roof")).json()["register"]
        for refused in (
            await ask.post("/calibrate", json={"together": ["roof"]}),
            await ask.post("/register", params=query, content=ply_of(cloud(10)), headers=PLY),
        ):
            assert (refused.status_code, refused.json()["code"]) == (404, "not-found"), refused.text
            assert ready["reasons"] == [refused.json()["detail"]]
        assert "no extension is installed" in ready["reasons"][0]
        assert (await ask.get("/runs")).json()["runs"] == []


@pytest.mark.parametrize(("changes", "says"), [
    ({"cameras": {"scanner": wrist()}}, "two devices are called 'scanner'"),
    ({"scanners": {"door": {"address": "http://d/c.ply", "camera": "nose"}}}, "'nose' is none of"),
    ({"cameras": {"wrist": wrist(calibration=OF_A_STAND)}}, "belongs to eye-to-hand"),
    ({"cameras": {"Wrist": wrist()}}, "cameras.Wrist"),
])  # fmt: skip
def test_settings_that_do_not_tell_devices_apart_are_refused(
    tmp_path: Path, changes: dict[str, Any], says: str
) -> None:
    with pytest.raises(DocumentError, match=says):
        settings_for(tmp_path, **changes)


async def test_readiness_and_uncertainty_are_of_the_camera_asked_for(tmp_path: Path) -> None:
    parts = Parts()
    of_wrist = parts.cameras["wrist"] = FakeCamera(parts.robot, flange_T_camera=WRIST)
    settings = settings_for(tmp_path, cameras={"wrist": wrist()}, calibration={"policy": "auto", "tolerance_mm": 20.0})
    async with serving(settings, parts) as bench:
        ask = bench.client
        before = (await ask.get("/ready", params={"camera": "wrist"})).json()
        assert before["register"]["reasons"] == ["no calibration of wrist is active"]
        await calibrate(ask, camera="wrist")
        assert (await ask.get("/ready", params={"camera": "wrist"})).json()["register"]["ready"]
        assert (await ask.get("/ready")).json()["register"]["reasons"] == ["no calibration is active"]
        assert 'handeyed_calibration_expanded_meters{camera="wrist"}' in (await ask.get("/metrics")).text
        of_wrist.failing = DeviceUnreachable("camera wrist", "no cable", "plug it in")
        reasons: list[str] = []
        async with asyncio.timeout(LIMIT_S):  # a reading is shared for 0.1 s
            while not reasons:
                of_wrist_now = (await ask.get("/ready", params={"camera": "wrist"})).json()
                reasons = of_wrist_now["calibrate"]["reasons"]
        assert "no cable" in reasons[0]
        assert (await ask.get("/ready")).json()["calibrate"]["ready"]
        assert (await ask.get("/ready", params={"camera": "nowhere"})).status_code == 404

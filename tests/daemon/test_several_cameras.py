"""Two cameras by name: each with its own runs, pictures, calibration in force and chart."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.documents.session import CameraDocument
from calibration.errors import DocumentError
from calibration.transforms import difference, rotation_from_vector, transform
from protocols.plc.codes import ControlBit, StatusBit
from protocols.plc.registers import BY_NAME
from tests.daemon.cell_under_test import Bench, Parts, pose_json, serving, settings_for
from tests.daemon.clouds import PLY, POSE, cloud
from tests.daemon.fakes import CAMERA, FLANGE_T_CAMERA, FakeCamera, ply_of, poses_around_the_target
from tests.daemon.plcs import MOVING, ladder
from tests.support.waiting import LIMIT_S

WRIST = FLANGE_T_CAMERA @ transform(rotation_from_vector([0.01, -0.02, 0.3]), [12.0, -7.0, 4.0])

OF_A_STAND = {"base_T_camera_guess": pose_json(np.eye(4))}


def wrist(**changes: Any) -> dict[str, Any]:
    poses = [pose_json(pose) for pose in poses_around_the_target()]
    return {"address": "http://wrist/frame.png", "intrinsics": CameraDocument.of(CAMERA).model_dump(),
            "calibration": {"poses": poses, "policy": "auto"}, **changes}  # fmt: skip


@asynccontextmanager
async def two_cameras(folder: Path, **changes: Any) -> AsyncIterator[Bench]:
    parts = Parts()
    parts.cameras["wrist"] = FakeCamera(parts.robot, flange_T_camera=WRIST)
    async with serving(settings_for(folder, cameras={"wrist": wrist()}, **changes), parts) as bench:
        yield bench


async def calibrate(client: httpx.AsyncClient, **body: Any) -> dict[str, Any]:
    run: dict[str, Any] = (await client.post("/calibrate", json=body, params={"wait": LIMIT_S})).json()
    assert run["state"] == "finished", run["cause"]
    return run


async def test_each_camera_has_its_own_calibration_in_force_and_chart(tmp_path: Path) -> None:
    async with two_cameras(tmp_path, calibration={"policy": "auto"}) as bench:
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


async def test_one_run_calibrates_both_and_solves_them_together(tmp_path: Path) -> None:
    async with two_cameras(tmp_path, calibration={"policy": "auto"}) as bench:
        run = await calibrate(bench.client, together=["wrist"])
        together = run["result"]["together"]
        assert together["calibrations"]["wrist"]["calibration_id"] == f"{run['id']}-wrist"
        assert "accepted" in together["rig"]  # how exactly: tests/stories/test_several_sensors.py
        assert (tmp_path / "runs" / f"{run['id']}-wrist" / "view_004.png").is_file()
        assert (await bench.client.get(f"/calibrations/{run['id']}-wrist/report")).status_code == 200


async def test_a_camera_that_sees_nothing_is_named_and_fails_nothing_else(tmp_path: Path) -> None:
    parts = Parts()
    parts.cameras["wrist"] = FakeCamera(parts.robot, blind=lambda picture: True)
    async with serving(settings_for(tmp_path, cameras={"wrist": wrist()}), parts) as bench:
        together = (await calibrate(bench.client, together=["wrist"]))["result"]["together"]
        assert together["rig_id"] is None
        assert "rig" in together["refused"]


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
    ("POST", "/calibrate", {"together": ["nose"]}), ("POST", "/verify", {"camera": "nose"}),
    ("POST", "/scans", {"scanner": "nose"}),
])  # fmt: skip
async def test_a_name_that_is_not_there_is_answered_with_those_that_are(
    bench: Bench, method: str, path: str, sent: dict[str, Any] | None
) -> None:
    answer = await bench.client.request(method, path, json=sent)
    assert (answer.status_code, answer.json()["code"]) == (404, "not-found")
    assert "'nose'" in answer.json()["detail"]


async def test_a_scanner_is_placed_by_the_calibration_of_its_camera_only(tmp_path: Path) -> None:
    scanner = {"address": "http://door/cloud.ply", "camera": "wrist", "camera_T_scanner": pose_json(np.eye(4))}
    async with two_cameras(tmp_path, scanners={"door": scanner}, calibration={"policy": "auto"}) as bench:
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


async def test_a_plc_names_the_camera_by_its_number(tmp_path: Path) -> None:
    async with two_cameras(tmp_path, plc=MOVING) as bench, ladder(bench) as plc:
        camera = BY_NAME["camera_wanted"].address
        await plc.sets(ControlBit(0))
        await plc.waits(StatusBit.READY)
        await plc.client.write_register(camera, 1)
        await plc.triggers(ControlBit.TRIGGER_CALIBRATE)
        await plc.result()
        assert (await bench.client.get("/calibrations/current?camera=wrist")).status_code == 200
        await plc.client.write_register(camera, 2)
        assert await plc.triggers(ControlBit.TRIGGER_CALIBRATE) & StatusBit.ERROR


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

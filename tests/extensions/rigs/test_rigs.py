"""Several sensors by name: rig.json stored, and POST /register?scanner=NAME by the pose of one of them."""

from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.transforms import map_points
from tests.daemon.access_keys import bearer, with_keys
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.clouds import PLY, POSE, cloud
from tests.daemon.fakes import FLANGE_T_CAMERA, ply_of, points_of
from tests.daemon.rig_files import SCANNER, a_rig


async def register(bench: Bench, **query: str) -> Any:
    return await bench.client.post("/register", params={"pose": POSE, **query}, content=ply_of(CLOUD), headers=PLY)


CLOUD = cloud(100)


async def test_a_cloud_is_registered_by_the_sensor_that_took_it(bench: Bench) -> None:
    stored = await bench.client.post("/rigs", json=a_rig(shift_mm=5.0))
    assert stored.status_code == 201, stored.text
    newest = await bench.client.post("/rigs", json=a_rig())
    await apply_calibration(bench)
    numbers = [float(number) for number in POSE.split(",")]
    flange = PoseDocument(translation_mm=tuple(numbers[:3]), quaternion_wxyz=tuple(numbers[3:])).transform()
    for name, pose in (("camera", FLANGE_T_CAMERA), ("scanner", SCANNER)):
        answer = await register(bench, scanner=name)
        assert answer.status_code == 200, answer.text
        assert answer.headers["handeyed-rig"] == newest.json()["id"]
        assert "handeyed-calibration" not in answer.headers
        np.testing.assert_allclose(points_of(answer.content), map_points(flange @ pose, CLOUD), atol=1e-3)
    assert "handeyed-rig" not in (await register(bench)).headers
    assert (await bench.client.get(newest.headers["location"])).json() == newest.json()
    listed = (await bench.client.get("/rigs")).json()
    assert listed == {"rigs": [newest.json(), stored.json()], "next": None, "damaged": []}


async def test_every_screen_hears_of_a_new_rig(bench: Bench) -> None:
    stored = (await bench.client.post("/rigs", json=a_rig())).json()
    await bench.application.events.flush()
    event = (await bench.application.store.stored_events.last())[-1]
    assert event.kind == "rig"
    assert event.data == {"rig_id": stored["id"], "setup": "eye-in-hand", "at": stored["created_at"]}


@pytest.mark.parametrize(("rig", "says"), [
    (a_rig(accepted=False), "U is 3 mm"), (a_rig(setup="eye-to-hand"), "[camera] setup is eye-in-hand"),
])  # fmt: skip
async def test_a_rig_that_must_not_be_used_is_refused(bench: Bench, rig: dict[str, Any], says: str) -> None:
    answer = await bench.client.post("/rigs", json=rig)
    assert (answer.status_code, answer.json()["code"]) == (409, "calibration-unusable")
    assert says in answer.json()["detail"]
    assert (await register(bench, scanner="scanner")).status_code == 404


@pytest.mark.parametrize(("change", "place"), [
    ({"sensors": []}, "sensors"), ({"sensors": [a_rig()["sensors"][0]] * 2}, "sensors"), ({"mount": "base"}, "mount"),
])  # fmt: skip
async def test_a_rig_that_does_not_tell_its_sensors_apart_is_refused(
    bench: Bench, change: dict[str, Any], place: str
) -> None:
    answer = await bench.client.post("/rigs", json=a_rig() | change)
    assert (answer.status_code, answer.json()["problems"][0]["place"]) == (422, place)
    assert (await bench.client.get("/rigs")).json()["rigs"] == []


async def test_a_rejected_rig_is_stored_when_somebody_insists_and_the_log_says_so(bench: Bench) -> None:
    params = {"despite_verdict": "true"}
    for accepted in (True, False):
        stored = await bench.client.post("/rigs", json=a_rig(accepted=accepted), params=params)
        assert stored.status_code == 201
    overruled, regular = (await bench.client.get("/audit?limit=2")).json()["rows"]
    assert overruled["subject"] == stored.json()["id"]
    assert overruled["detail"] == {"setup": "eye-in-hand", "despite_verdict": True}
    assert regular["detail"] == {"setup": "eye-in-hand"}


async def test_a_sensor_that_is_not_there_is_named_with_those_that_are(bench: Bench) -> None:
    none = await register(bench, scanner="scanner")
    assert (none.status_code, none.json()["detail"]) == (404, "no rig is active")
    await bench.client.post("/rigs", json=a_rig())
    other = await register(bench, scanner="profiler")
    assert other.status_code == 404
    assert "camera, scanner" in other.json()["fix"]
    both = await register(bench, scanner="scanner", calibration="cal-1")
    assert both.status_code == 422


async def test_a_rig_that_was_not_accepted_is_put_in_force_by_an_admin_only(tmp_path: Path) -> None:
    async with with_keys(tmp_path) as (bench, keys):

        async def stores(role: str) -> httpx.Response:
            rig, query = a_rig(accepted=False), {"despite_verdict": "true"}
            return await bench.client.post("/rigs", json=rig, params=query, headers=bearer(keys[role]))

        assert (await stores("operator")).json()["code"] == "role-too-low"
        assert (await bench.client.get("/rigs", headers=bearer(keys["viewer"]))).json()["rigs"] == []
        assert (await stores("admin")).status_code == 201


async def test_a_scanner_of_the_rig_is_ready_when_a_rig_is_active(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, scanners={"roof": {"address": "http://roof/cloud.ply"}})) as bench:

        async def registers() -> Any:
            return (await bench.client.get("/ready", params={"scanner": "roof"})).json()["register"]

        assert (await registers())["reasons"] == ["no rig is active"]
        rig = a_rig()
        rig["sensors"][1]["name"] = "roof"
        assert (await bench.client.post("/rigs", json=rig)).status_code == 201
        assert (await registers())["ready"]

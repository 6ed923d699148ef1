"""Several sensors of one mount in one calibration run: each alone, then all in one estimate."""

import json
from pathlib import Path

import pytest

from drivers.errors import DeviceTimeout, LinkLost, NothingMeasured
from drivers.interfaces import CameraFrame, ScannedCloud
from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.fakes import FakeCamera, FakeScanner
from tests.daemon.named_cameras import WRIST, calibrate, two_cameras, wrist


async def test_one_run_calibrates_both_and_solves_them_together(tmp_path: Path) -> None:
    async with two_cameras(tmp_path, calibration={"policy": "auto", "tolerance_mm": 20.0}) as bench:
        await bench.client.post("/arm/temperature", json={"temperature_c": 31.5})
        run = await calibrate(bench.client, together=["wrist"])
        together = run["result"]["together"]
        assert together["calibrations"]["wrist"]["calibration_id"] == f"{run['id']}-wrist"
        assert "accepted" in together["rig"]  # how exactly: tests/stories/test_several_sensors.py
        folders = [tmp_path / "runs" / name for name in (run["id"], f"{run['id']}-wrist")]
        for folder in folders:
            views = json.loads((folder / "session.json").read_bytes())["views"]
            assert [view["arm_temperature_c"] for view in views] == [31.5] * 5
            assert (folder / "view_004.png").is_file()
        assert (await bench.client.get(f"/calibrations/{run['id']}-wrist/report")).status_code == 200


async def test_a_camera_that_sees_nothing_is_named_and_fails_nothing_else(tmp_path: Path) -> None:
    parts = Parts()
    parts.cameras["wrist"] = FakeCamera(parts.robot, blind=lambda picture: True)
    async with serving(settings_for(tmp_path, cameras={"wrist": wrist()}), parts) as bench:
        together = (await calibrate(bench.client, together=["wrist"]))["result"]["together"]
        assert together["rig_id"] is None
        assert "rig" in together["refused"]


class FailsOnce(FakeCamera):
    """A camera whose second picture does not come."""

    looks = 0

    async def grab(self, newer_than_s: float) -> CameraFrame:
        self.looks += 1
        if self.looks == 2:
            raise LinkLost("wrist", "the cable is off", "plug it in")
        return await super().grab(newer_than_s)


async def test_looks_that_fail_are_said_beside_the_calibration_without_them(tmp_path: Path) -> None:
    parts = Parts()
    parts.cameras["wrist"] = FailsOnce(parts.robot, flange_T_camera=WRIST)
    async with serving(settings_for(tmp_path, cameras={"wrist": wrist()}), parts) as bench:
        together = (await calibrate(bench.client, together=["wrist"]))["result"]["together"]
        assert together["calibrations"]["wrist"]["calibration_id"]
        assert "of 5 looks failed, the last: wrist: the cable is off" in together["missed"]["wrist"]


class EmptyScanner(FakeScanner):
    """Answers with a cloud without points."""

    async def scan(self, newer_than_s: float) -> ScannedCloud:
        raise NothingMeasured("scanner", "the cloud has no points", "look at what it sees")


async def test_a_scanner_whose_clouds_are_empty_is_named_and_fails_nothing_else(tmp_path: Path) -> None:
    parts = Parts(scanner=EmptyScanner())
    parts.cameras["wrist"] = FakeCamera(parts.robot, flange_T_camera=WRIST)
    async with serving(settings_for(tmp_path, cameras={"wrist": wrist()}), parts) as bench:
        together = (await calibrate(bench.client, together=["wrist", "scanner"]))["result"]["together"]
        assert together["refused"]["scanner"] == "scanner: the cloud has no points: look at what it sees"
        assert together["calibrations"]["wrist"]["calibration_id"]
        assert "accepted" in together["rig"]  # of the two cameras


@pytest.mark.parametrize("manual", [False, True])
async def test_nothing_moves_for_sensors_of_which_one_cannot_look(tmp_path: Path, manual: bool) -> None:
    parts = Parts()
    parts.cameras["wrist"] = FakeCamera(parts.robot, failing=DeviceTimeout("wrist", "no answer", "look at the cable"))
    async with serving(settings_for(tmp_path, cameras={"wrist": wrist()}, scanner=None), parts) as bench:
        for name, reason in (("wrist", "wrist: wrist: no answer: look at the cable"), ("scanner", "no scanner")):
            refused = await bench.client.post("/calibrate", json={"together": [name], "manual": manual})
            assert (refused.status_code, refused.json()["code"]) == (503, "cell-not-ready"), refused.text
            assert reason in refused.text
        assert bench.robot.goals == []
        assert (await bench.client.get("/runs")).json()["runs"] == []


async def test_a_sensor_that_is_not_there_is_named(bench: Bench) -> None:
    answer = await bench.client.post("/calibrate", json={"together": ["nose"]})
    assert (answer.status_code, answer.json()["code"]) == (404, "not-found")
    assert "'nose'" in answer.json()["detail"]

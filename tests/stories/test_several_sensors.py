"""Two cameras and a scanner on one flange: calibrated together in one run, each in force and charted by its name."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.transforms import difference, map_points, rotation_from_vector, transform
from mock_robot.truth.score import score_calibration
from mock_robot.truth.truth import CellTruth
from tests.daemon.fakes import ply_of, points_of
from tests.mock_robot.running_cell import running_cell
from tests.stories.plant import daemon_for, poses_taught_for, small_pictures
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

SEED = 7
POINT_MM = 0.4
CAMERA_T_WRIST = transform(rotation_from_vector([0.10, -0.06, 0.5]), [35.0, -20.0, 5.0])
CAMERA_T_DOOR = transform(rotation_from_vector([-0.08, 0.05, -0.3]), [-40.0, 15.0, -10.0])


def cell_truth() -> CellTruth:
    truth = small_pictures(SEED)
    return replace(
        truth,
        further_cameras={"wrist": truth.mount_T_camera @ CAMERA_T_WRIST},
        further_scanners={"door": truth.mount_T_camera @ CAMERA_T_DOOR},
    )


async def test_two_cameras_and_a_scanner_are_calibrated_together(tmp_path: Path) -> None:
    truth = cell_truth()
    async with running_cell(SEED, 100.0, truth=truth) as cell:
        at, sheet = cell.announcement.devices_url, cell.announcement.sheet
        named = {"address": f"{at}/cameras/wrist/snapshot.png", "limit_s": LIMIT_S, "intrinsics": sheet["camera"],
                 "calibration": {"poses": poses_taught_for(SEED)}}  # fmt: skip
        changes = {
            "calibration": {"poses": poses_taught_for(SEED)},
            "cameras": {"wrist": named},
            "scanners": {"door": {"address": f"{at}/scanners/door/cloud.pcd", "limit_s": LIMIT_S}},
        }
        async with daemon_for(cell, tmp_path, **changes) as story:
            ask = story.operator.client
            body = {"together": ["wrist", "door"]}
            run = (await ask.post("/calibrate", json=body, params={"wait": LIMIT_S})).json()
            assert run["state"] == "finished", run["cause"]
            together = run["result"]["together"]
            assert together["refused"] == {}, together
            assert run["result"]["applied"] and together["calibrations"]["wrist"]["applied"]

            for name, of in (("camera", truth), ("wrist", truth.of_camera("wrist"))):
                current = (await ask.get("/calibrations/current", params={"camera": name})).json()
                assert current["applied"]["camera"] == name
                found = PoseDocument.model_validate(current["calibration"]["flange_T_camera"]).transform()
                assert score_calibration(of, found)["point_rms_mm"] < POINT_MM

            (rig,) = (await ask.get("/rigs")).json()["rigs"]
            assert rig["id"] == together["rig_id"] == run["id"]
            assert rig["rig"]["shared_stations"] >= 7
            true = {"camera": np.eye(4), "wrist": CAMERA_T_WRIST, "door": CAMERA_T_DOOR}
            for pair in rig["rig"]["relative"]:
                expected = np.linalg.inv(true[pair["a"]]) @ true[pair["b"]]
                off_mm, off_rad = difference(expected, PoseDocument.model_validate(pair["a_T_b"]).transform())
                print("story:", pair["a"], pair["b"], round(off_mm, 4), off_rad, pair["uncertainty"]["expanded_mm"])
                assert off_mm < POINT_MM
                assert off_rad < 1e-3
            for sensor in rig["rig"]["sensors"]:
                print("story:", sensor["name"], sensor["uncertainty"]["expanded_mm"], sensor["alone_expanded_mm"])
                assert sensor["uncertainty"]["expanded_mm"] < 1.05 * sensor["alone_expanded_mm"]

            points = np.array([[0.0, 0, 600], [50, -20, 580], [-80, 40, 620]])
            answer = await ask.post(
                "/register", params={"pose": "now", "scanner": "door"}, content=ply_of(points),
                headers={"content-type": "application/x-ply"},
            )  # fmt: skip
            assert answer.status_code == 200, answer.text
            flange = cell.cell.flange_at(cell.cell.clock())
            off_mm = np.linalg.norm(
                points_of(answer.content) - map_points(flange @ truth.further_scanners["door"], points), axis=1
            )
            print("story: registered", off_mm)
            assert off_mm.max() < 2 * POINT_MM

            verified = (await ask.post("/verify", json={"camera": "wrist"}, params={"wait": LIMIT_S})).json()
            assert verified["state"] == "finished", verified["cause"]
            assert verified["result"]["calibration_id"] == together["calibrations"]["wrist"]["calibration_id"]
            assert (await ask.get("/drift", params={"camera": "wrist"})).json()["verifications"] == 1
            assert (await ask.get("/drift")).json()["verifications"] == 0
            assert [device["name"] for device in (await ask.get("/devices")).json()] == [
                "robot", "camera", "wrist", "scanner", "door",
            ]  # fmt: skip

"""Clouds where the errors of an arm are active: joints that are wrong, threads, and frames."""

import threading
from typing import Any

import numpy as np
import pytest

from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.documents.pose import PoseDocument
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.joint_check import JointsDisagree
from calibration.kinematics.stance import Stance
from calibration.transforms import Array
from daemon.model.records import AppliedCalibration, CalibrationRecord
from tests.daemon.calibrations import a_calibration, an_arm, apply_with_arm, document_with_covariance
from tests.daemon.cell_under_test import Bench
from tests.daemon.clouds import PLY, cloud
from tests.daemon.fakes import FLANGE_T_CAMERA, ply_of, points_of
from tests.daemon.scans.scan_folders import a_scan

ARM = find_arm("IRB 1600-6/1.45")
JOINTS = np.radians([[0.0, 20, 10, 0, 40, 0], [10.0, 20, 10, 5, 40, 0], [20.0, 25, 5, 5, 45, 10]])
POSES = ARM.forward(JOINTS)


def query_at(joints_rad: Array) -> dict[str, str]:
    """Pose and joints of the arm as drawn."""
    pose = PoseDocument.of(ARM.forward(joints_rad))
    numbers = {"pose": (*pose.translation_mm, *pose.quaternion_wxyz), "joints": np.degrees(joints_rad).tolist()}
    return {name: ",".join(map(repr, values)) for name, values in numbers.items()}


def query_of(row: int, joints_rad: Array | None = None) -> dict[str, str]:
    pose = PoseDocument.of(POSES[row])
    at = {"pose": ",".join(map(repr, (*pose.translation_mm, *pose.quaternion_wxyz)))}
    given = None if joints_rad is None else ",".join(map(repr, np.degrees(joints_rad).tolist()))
    return at if given is None else {**at, "joints": given}


def test_joints_of_one_view_of_three_are_not_outvoted() -> None:
    given = CalibrationInUse.of(a_calibration("cal-1"), an_arm())
    wrong = JOINTS[2] + np.radians([90.0, 0, 0, 0, 0, 0])
    with pytest.raises(JointsDisagree):
        given.base_T_flange([*map(Stance, POSES, [JOINTS[0], JOINTS[1], wrong])])


@pytest.mark.slow
async def test_a_view_that_is_stored_is_answered_so_even_if_its_scan_cannot_be_refined(bench: Bench) -> None:
    await apply_with_arm(bench)
    scan, content = await a_scan(bench, refine=True), ply_of(cloud(100))
    wrong = JOINTS[0] + np.radians([0.0, 30, 0, 0, 0, 0])
    added = await bench.client.post(scan["links"]["views"], params=query_of(0, wrong), content=content, headers=PLY)
    assert added.status_code == 201, added.text
    assert (await bench.client.get(scan["links"]["report"])).status_code == 422


async def test_a_single_view_has_the_warning_of_its_own_pose(bench: Bench) -> None:
    await apply_with_arm(bench)
    scan, content = await a_scan(bench), ply_of(cloud(100))
    for params in (query_of(0, JOINTS[0]), query_of(1)):
        await bench.client.post(scan["links"]["views"], params=params, content=content, headers=PLY)
    warned = [
        "handeyed-warning" in (await bench.client.get(scan["links"]["cloud"], params={"view": view})).headers
        for view in (0, 1)
    ]
    assert warned == [False, True]


async def test_an_arm_grows_by_the_temperature_that_is_stated_and_is_warned_of_without(bench: Bench) -> None:
    await apply_with_arm(bench, at_c=20.0, expansion=1e-5)
    content = ply_of(np.array([[0.0, 0.0, 500.0]], np.float32))

    async def registered() -> tuple[float, bool]:
        """Farthest coordinate from the base, mm, and whether the answer warns."""
        answer = await bench.client.post("/register", params=query_of(0, JOINTS[0]), content=content, headers=PLY)
        return float(np.linalg.norm(points_of(answer.content))), "handeyed-warning" in answer.headers

    at_20, warned = await registered()
    assert warned
    for celsius in (20.0, 70.0):
        await bench.client.post("/arm/temperature", json={"temperature_c": celsius})
    grown, warned = await registered()
    assert not warned
    assert grown - at_20 == pytest.approx(0.7, abs=0.3)  # 50 K of 1e-5 over 1 to 2 m


async def test_the_event_loop_computes_no_kinematics(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    await apply_with_arm(bench)
    place, threads = CalibrationInUse.base_T_flange, set[int]()

    def placed(given: CalibrationInUse, *poses: Any) -> Array:
        threads.add(threading.get_ident())
        return place(given, *poses)

    monkeypatch.setattr(CalibrationInUse, "base_T_flange", placed)
    scan, content = await a_scan(bench), ply_of(cloud(100))
    for link in ("/register", scan["links"]["views"]):
        answer = await bench.client.post(link, params=query_at(JOINTS[0]), content=content, headers=PLY)
        assert answer.status_code in (200, 201), answer.text
    assert (await bench.client.get(scan["links"]["cloud"])).status_code == 200
    assert threads
    assert threading.get_ident() not in threads


async def test_a_verification_states_the_uncertainty_of_the_x_that_it_used(bench: Bench) -> None:
    """That of the X identified with the arm, not of the one without in the same calibration (0.2 mm)."""
    await apply_with_arm(bench, x_sigma_mm=0.5)
    await bench.verify()
    run = (await bench.client.get("/runs")).json()["runs"][0]
    assert run["result"]["verification"]["expected_point_mm"] == pytest.approx(0.5 * np.sqrt(3))


async def test_a_cloud_says_how_well_it_is_placed_at_its_joints(bench: Bench) -> None:
    """A zero of axis 2 known to 1 mrad moves the camera by its distance from that axis, beside scatter (an_arm)."""
    await apply_with_arm(bench, zero_2_sigma_rad=1e-3)
    stretched, content = np.radians([0.0, 80, -70, 0, 40, 0]), ply_of(cloud(100))
    for joints, seen in (
        (JOINTS[0], "true"),
        (stretched, "true"),
        (JOINTS[0] + np.radians([95.0, 0, 0, 0, 0, 0]), "false"),
    ):
        turned = joints + 1e-3 * np.eye(6)[1]
        there, moved = (ARM.forward(one) @ FLANGE_T_CAMERA for one in (joints, turned))
        by_scatter = 3 * 0.05**2 + 2 * (np.radians(0.002) * np.linalg.norm(FLANGE_T_CAMERA[:3, 3])) ** 2
        expected = np.sqrt(np.sum((moved - there)[:3, 3] ** 2) + by_scatter)
        answer = await bench.client.post("/register", params=query_at(joints), content=content, headers=PLY)
        assert answer.status_code == 200, answer.text
        assert float(answer.headers["handeyed-point-sigma-mm"]) == pytest.approx(expected, rel=2e-3)
        assert answer.headers["handeyed-joints-seen"] == seen


async def test_whoever_asks_how_well_points_are_placed_hears_of_the_x_identified_with_the_arm(bench: Bench) -> None:
    """Not of the one without in the same calibration (0.2 mm): status, list and gauge."""
    await apply_with_arm(bench, x_sigma_mm=0.5)
    expected = pytest.approx(2 * 0.5 * np.sqrt(3))
    assert (await bench.client.get("/calibrate")).json()["current"]["expanded_mm"] == expected
    assert (await bench.client.get("/calibrations/current")).json()["expanded_mm"] == expected
    assert [row["expanded_mm"] for row in (await bench.client.get("/calibrations")).json()["calibrations"]] == [
        expected
    ]
    assert await gauge_mm(bench) == expected


async def test_an_arm_json_that_cannot_be_used_hides_no_gauge(bench: Bench) -> None:
    document, arm = document_with_covariance(), an_arm()
    assert document.uncertainty is not None
    record = CalibrationRecord(document.id, None, document.created_at, True, document)
    await bench.application.store.save_calibration(record, arm.model_copy(update={"covariance": [[1.0]]}))
    await bench.application.store.apply(AppliedCalibration(document.id, document.created_at, "test"))
    assert await gauge_mm(bench) == pytest.approx(document.accuracy.expanded_mm)


async def gauge_mm(bench: Bench) -> float:
    lines = (await bench.client.get("/metrics")).text.splitlines()
    (value,) = (line.split()[1] for line in lines if line.startswith("handeyed_calibration_expanded_meters "))
    return 1e3 * float(value)

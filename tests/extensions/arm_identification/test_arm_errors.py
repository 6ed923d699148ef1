"""The arm's own errors over REST: identified with a calibration, stored and in force with it."""

import asyncio
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.pose import PoseDocument
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import Arm
from calibration.kinematics.arm_errors import Postures
from calibration.transforms import Array, map_points
from daemon.api.extension import Extension
from daemon.model.records import AppliedCalibration
from daemon.runs.calibration_run import IdentifyArm
from mock_robot.arm.built_arm import build_arm
from protocols.plc.codes import ControlBit, StatusBit
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.cli.running import handeyed
from tests.daemon.fakes import ply_of, points_of
from tests.extensions.plc.plcs import MOVING, ladder, value_of
from tests.simulated.arms import ArmCell, arm_cell, least_travel, reachable_views, session_document, target_before
from tests.support.waiting import LIMIT_S

ARM = find_arm("IRB 2600-20/1.65")
FAKE = {"model": "IRB 1600-6/1.45"}
"""[robot] of the arm that the fake one is."""

C, S = ControlBit, StatusBit


@pytest.fixture(scope="module")
def cell() -> ArmCell:
    """Twelve views of a standard arm, which goes from one to the next with the least travel."""
    rng, target = np.random.default_rng(0), target_before(ARM)
    poses = ARM.forward(reachable_views(rng, ARM, target, 12, any_posture=False))
    joints = least_travel(ARM, poses)
    return arm_cell(rng, build_arm(ARM, "standard", 0), [joints], [target])


def session_of(cell: ArmCell, **changes: Any) -> dict[str, Any]:
    return {**session_document(cell.problems[0]), "arm": True, **changes}


def codes(calibration: dict[str, Any]) -> set[str]:
    return {finding["code"] for finding in calibration["verdict"]["findings"] if finding["code"].startswith("arm-")}


async def posted(bench: Bench, body: dict[str, Any]) -> dict[str, Any]:
    made = await bench.client.post("/calibrations", json=body)
    assert made.status_code == 201, made.text
    found: dict[str, Any] = made.json()
    return found


@pytest.mark.slow
async def test_the_arms_errors_are_identified_stored_and_in_force_with_the_calibration(
    tmp_path: Path, cell: ArmCell
) -> None:
    with_confdata, poses_only = session_of(cell), session_of(cell)
    for stated, bare in zip(with_confdata["views"], poses_only["views"], strict=True):
        stated["confdata"] = list(ARM.configuration(np.radians(stated.pop("joints_deg"))))
        del bare["joints_deg"]
    async with serving(settings_for(tmp_path, robot={"model": ARM.name})) as bench:
        calibration = await posted(bench, session_of(cell))
        assert codes(calibration) == {"arm-errors"}
        answer = await bench.client.get(f"/calibrations/{calibration['id']}/arm")
        found = ArmErrorsDocument.model_validate_json(answer.content)
        assert found.taken_up
        assert (found.views, found.joints_from_poses) == (12, 0)
        off = found.estimate().mount_T_camera[:3, 3] - cell.mount_T_camera[:3, 3]
        assert np.linalg.norm(off) < 2.0

        assert (await bench.client.get("/calibrations/current/arm")).json()["code"] == "no-calibration"
        applied = await bench.client.post(f"/calibrations/{calibration['id']}/apply", json={"despite_verdict": True})
        assert applied.status_code == 200, applied.text
        assert (await bench.client.get("/calibrations/current/arm")).content == answer.content
        words = (await bench.client.get("/calibrations/current/arm", headers={"accept": "text/plain"})).text
        assert "errors of the arm are taken up" in words

        without = await posted(bench, poses_only)
        assert codes(without) == {"arm-not-identified"}
        assert (await bench.client.get(f"/calibrations/{without['id']}/arm")).status_code == 404
        stated = await posted(bench, with_confdata)
        assert codes(stated) == {"arm-errors"}
        again = (await bench.client.get(f"/calibrations/{stated['id']}/arm")).json()
        assert again["joints_from_poses"] == 12
        values = [one["value"] for one in again["parameters"]]
        np.testing.assert_allclose(values, [one.value for one in found.parameters], atol=1e-6)


async def test_the_error_field_is_given_over_a_box_before_and_after(tmp_path: Path, cell: ArmCell) -> None:
    """Its errors are those of the built arm, to what the field says is left of them."""
    async with serving(settings_for(tmp_path, robot={"model": ARM.name})) as bench:
        calibration = await posted(bench, session_of(cell))
        route = f"/calibrations/{calibration['id']}/arm/field"
        box = "850,-300,500,1150,300,900"
        answer = await bench.client.get(route, params={"steps": 3, "box": box})
        field = answer.json()
        assert (field["steps"], field["taken_up"], len(field["points"])) == (3, True, 27)
        assert field["after_rms_mm"] < field["before_rms_mm"]
        words = await bench.client.get(route, headers={"accept": "text/plain"})
        assert f"{ARM.name}, " in words.text

        x, point = np.array(calibration["flange_T_camera"]["translation_mm"]), np.array(field["point_in_flange_mm"])
        assert 200 < np.linalg.norm(point - x) < 1000
        off = np.array([one["error_mm"] for one in field["points"]])
        assert np.linalg.norm(off, axis=1) == pytest.approx(
            [np.sqrt(one["before_mm"] ** 2 - one["after_mm"] ** 2) for one in field["points"]], abs=1e-4
        )
        around = (await bench.client.get(route)).json()
        seen = [one["seen"] for one in around["points"]]
        assert any(seen)
        assert not all(seen)
        for bad in ({"steps": 10}, {"box": "1,2,3"}, {"box": "9,0,0,1,1,1"}):
            refused = await bench.client.get(route, params=bad)
            assert refused.status_code == 422, refused.text
        far = (await bench.client.get(route, params={"box": "9000,0,0,9001,1,1"})).json()
        assert (far["points"], far["before_rms_mm"]) == ([], None)


POINTS_MM = np.array([[0.0, 0.0, 400.0], [60.0, -40.0, 450.0], [-50.0, 30.0, 380.0]])
PLY = {"content-type": "application/x-ply"}
SIX = ",".join


@pytest.mark.slow
async def test_clouds_are_placed_by_the_arm_as_built(tmp_path: Path, cell: ArmCell) -> None:
    """At postures that the session has not seen; the truth is the built arm's flange."""
    rng, zero = np.random.default_rng(9), np.zeros(6)
    joints = reachable_views(rng, ARM, target_before(ARM), 6, any_posture=False)
    joints = least_travel(ARM, ARM.forward(joints))
    true = cell.built.base_T_flange(Postures(joints, sides=np.tile(zero, (6, 1)))) @ cell.mount_T_camera
    async with serving(settings_for(tmp_path, robot={"model": ARM.name})) as bench:
        with_arm, drawn = await posted(bench, session_of(cell)), await posted(bench, session_of(cell, arm=False))

        async def mapped(calibration: dict[str, Any], row: int, **more: str) -> httpx.Response:
            pose = PoseDocument.of(ARM.forward(joints[row]))
            at = SIX(map(repr, (*pose.translation_mm, *pose.quaternion_wxyz)))
            params = {"pose": at, "calibration": calibration["id"], **more}
            return await bench.client.post("/register", params=params, content=ply_of(POINTS_MM), headers=PLY)

        def given(row: int) -> str:
            return SIX(map(repr, np.degrees(joints[row]).tolist()))

        errors: dict[str, list[Array]] = {"as drawn": [], "as built": [], "without joints": []}
        for row in range(6):
            expected = map_points(true[row], POINTS_MM)
            before, after = await mapped(drawn, row, joints=given(row)), await mapped(with_arm, row, joints=given(row))
            without = await mapped(with_arm, row)
            assert "handeyed-arm" not in before.headers
            assert (after.headers["handeyed-arm"], "handeyed-warning" in after.headers) == ("as-built", False)
            assert without.headers["handeyed-warning"] == "pose-without-joints"
            for name, answer in zip(errors, (before, after, without), strict=True):
                errors[name].append(points_of(answer.content) - expected)
        rms = {name: float(np.sqrt(np.mean(np.square(found)))) for name, found in errors.items()}
        assert rms["as built"] < rms["as drawn"] / 1.5, rms
        assert rms["without joints"] == pytest.approx(rms["as built"], rel=0.05), rms

        other = await mapped(with_arm, 0, joints=given(1))
        assert other.status_code == 422
        assert "joints" in other.json()["detail"]
        assert (await mapped(with_arm, 0, joints="1,2,3")).json()["problems"][0]["place"] == "query.joints"
        await scans_are_placed_alike(bench, (drawn, with_arm), ARM.forward(joints[:2]), given(0), true[:2])


async def scans_are_placed_alike(
    bench: Bench, calibrations: tuple[dict[str, Any], dict[str, Any]], poses: Array, joints: str, true: Array
) -> None:
    """As drawn, then as built: nearer, within 1.5 of its own U. Only the first view brings its joints."""
    scan = (await bench.client.post("/scans", json={})).json()["links"]
    for pose, more in zip(poses, ({"joints": joints}, {}), strict=True):
        document = PoseDocument.of(pose)
        at = SIX(map(repr, (*document.translation_mm, *document.quaternion_wxyz)))
        added = await bench.client.post(
            scan["views"], params={"pose": at, **more}, content=ply_of(POINTS_MM), headers=PLY
        )
        assert added.status_code == 201, added.text
    views = (await bench.client.get(scan["self"])).json()["views"]
    assert [view["joints_deg"] is None for view in views] == [False, True]
    assert (await bench.client.get("/scans")).json()["scans"][0]["views"] == views
    expected = np.concatenate([map_points(pose, POINTS_MM) for pose in true])
    off_mm = []
    for calibration in calibrations:
        used = {"calibration": calibration["id"]}
        cloud = await bench.client.get(scan["cloud"], params=used, headers={"accept": "application/json"})
        assert cloud.headers.get("handeyed-warning") == ("pose-without-joints" if off_mm else None)
        off_mm.append(np.linalg.norm(np.array(cloud.json()["points"]) - expected, axis=1).max())
    u_mm = 2 * float(cloud.headers["handeyed-point-sigma-mm"])
    assert off_mm[1] < min(1.5 * u_mm, off_mm[0] / 1.5), (off_mm, u_mm)
    report = (await bench.client.get(scan["report"], params=used)).json()
    assert "pose-without-joints" in {finding["code"] for finding in report["verdict"]["findings"]}


async def test_a_verification_sees_the_target_by_the_arm_as_built(tmp_path: Path) -> None:
    """An arm whose axis 2 is 5 mm further out: every point is found so much further out, at five millimetres."""
    async with serving(settings_for(tmp_path, robot=FAKE)) as bench:
        store, clock = bench.application.store, bench.application.clock
        run = (await bench.client.post("/calibrate", json={"arm": True}, params={"wait": LIMIT_S})).json()
        record = await store.calibration(run["result"]["calibration_id"])
        found = await store.arm(record.id)
        assert found is not None
        shifted = [
            one.model_copy(update={"value": 5.0 if one.name == "link_1_tx" else 0.0}) for one in found.parameters
        ]
        other = replace(record, id="further-out")
        document = record.document.model_copy(update={"id": other.id})
        built = found.model_copy(update={"taken_up": True, "parameters": shifted})
        await store.save_calibration(replace(other, document=document), built)
        middles = []
        for one in (record.id, other.id):
            await store.apply(AppliedCalibration(one, clock.timestamp(), "test"))
            verified = (await bench.client.post("/verify", params={"wait": LIMIT_S})).json()["result"]["verification"]
            middles.append(np.mean([point["base_mm"] for point in verified["points"]], axis=(0, 1)))
            assert verified.get("arm") == ("as-built" if one == other.id else None)
        assert np.linalg.norm(middles[1] - middles[0]) == pytest.approx(5.0, abs=0.2)


async def test_joints_of_another_arm_leave_the_calibration_and_say_why(tmp_path: Path, cell: ArmCell) -> None:
    async with serving(settings_for(tmp_path, robot={"model": "IRB 6700-200/2.60"})) as bench:
        calibration = await posted(bench, session_of(cell))
        (refusal,) = (one for one in calibration["verdict"]["findings"] if one["code"].startswith("arm-"))
        assert refusal["code"] == "arm-not-identified"
        assert "the session is of an IRB 2600-" in refusal["message"]
        missing = await bench.client.get(f"/calibrations/{calibration['id']}/arm")
        assert missing.status_code == 404, missing.text


async def test_a_run_identifies_the_arm_that_it_moves_and_solves_again_with_it(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, robot=FAKE)) as bench:
        run = (await bench.client.post("/calibrate", json={"arm": True}, params={"wait": LIMIT_S})).json()
        assert run["state"] == "finished", run["cause"]
        link = run["links"]["calibration"]
        found = (await bench.client.get(f"{link}/arm")).json()
        assert (found["views"], found["joints_from_poses"], found["taken_up"]) == (5, 0, False)
        assert codes((await bench.client.get(link)).json()) == {"arm-as-drawn"}
        again = (await bench.client.post(f"{link}/solve", json={"without": [1]})).json()
        assert (await bench.client.get(f"/calibrations/{again['id']}/arm")).json()["views"] == 4


async def test_runs_identify_the_arm_where_the_settings_say_so_and_the_request_does_not(tmp_path: Path) -> None:
    asked = {"robot": FAKE, "calibration": {"arm": True}}
    async with serving(settings_for(tmp_path, **asked)) as bench:
        assert (await bench.client.get("/arm")).json()["identifies_arm"]
        for body, status in (({}, 200), ({"arm": False}, 404)):
            run = (await bench.client.post("/calibrate", json=body, params={"wait": LIMIT_S})).json()
            assert run["state"] == "finished", run["cause"]
            assert (await bench.client.get(f"{run['links']['calibration']}/arm")).status_code == status


async def test_calibrate_says_what_was_found_of_the_arms_errors_and_leaves_them_out_where_asked(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, robot=FAKE, calibration={"arm": True})) as bench:
        for option, codes_found, status in (("--arm", {"arm-as-drawn"}, 200), ("--no-arm", set(), 404)):
            ran = await asyncio.to_thread(handeyed, "calibrate", "--url", bench.url, option, "--json")
            assert codes(json.loads(ran.out)) == codes_found, ran.err
            link = f"/calibrations/{json.loads(ran.out)['id']}/arm"
            assert (await bench.client.get(link)).status_code == status


async def test_a_plc_s_calibration_identifies_the_arm_where_the_settings_say_so(tmp_path: Path) -> None:
    settings = {"arm": True, "policy": "auto", "tolerance_mm": 20.0}
    cell = settings_for(tmp_path, plc=MOVING, robot=FAKE, calibration=settings)
    async with serving(cell) as bench, ladder(bench) as plc:
        await plc.sets(C(0))
        await plc.waits(S.READY | S.ONLINE)
        assert not await plc.triggers(C.TRIGGER_CALIBRATE) & S.ERROR
        found = await bench.client.get(f"/calibrations/{value_of(await plc.result(), 'run_id')}/arm")
        assert (found.status_code, found.json()["arm"]) == (200, FAKE["model"])


async def test_the_identification_is_loaded_by_a_run_that_asks_for_it_before_the_arm_moves(tmp_path: Path) -> None:
    goals: list[int] = []

    def load(arm: Arm) -> IdentifyArm:
        goals.append(len(bench.robot.goals))
        return lambda problem, created_at: (None, ())

    async with serving(settings_for(tmp_path, robot=FAKE), extensions=(Extension("a", identification=load),)) as bench:
        for arm, loaded in ((False, []), (True, [5])):
            run = (await bench.client.post("/calibrate", json={"arm": arm}, params={"wait": LIMIT_S})).json()
            assert (run["state"], goals[:1]) == ("finished", loaded)


async def test_where_it_is_not_installed_it_is_refused_before_anything_moves(tmp_path: Path, cell: ArmCell) -> None:
    async with serving(settings_for(tmp_path, robot=FAKE), extensions=()) as bench:
        for path, body in (("/calibrate", {"arm": True}), ("/calibrations", session_of(cell))):
            refused = await bench.client.post(path, json=body)
            assert (refused.status_code, refused.json()["code"]) == (409, "not-installed")
            assert refused.json()["fix"] == 'leave "arm" out'
        assert not bench.robot.goals
        await posted(bench, session_of(cell, arm=False))


async def test_distances_to_other_sessions_are_refused_where_there_is_one(tmp_path: Path, cell: ArmCell) -> None:
    known = {"to": "another", "distance_mm": 990.0, "sigma_mm": 0.1}
    async with serving(settings_for(tmp_path, robot={"model": ARM.name})) as bench:
        refused = await bench.client.post("/calibrations", json=session_of(cell, distances=[known]))
    assert refused.status_code == 422, refused.text
    assert [problem["place"] for problem in refused.json()["problems"]] == ["distances"]


async def test_without_a_known_arm_it_is_refused_before_anything_moves(bench: Bench, cell: ArmCell) -> None:
    for path, body in (("/calibrate", {"arm": True}), ("/calibrations", session_of(cell))):
        refused = await bench.client.post(path, json=body)
        assert (refused.status_code, refused.json()["code"]) == (409, "arm-unknown")
        assert "[robot] model" in refused.json()["fix"]
    assert not bench.robot.goals
    assert not (await bench.client.get("/runs")).json()["runs"]

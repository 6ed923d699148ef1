"""The arm's own errors over REST: identified with a calibration, stored and in force with it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.arm import ArmErrorsDocument
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.joints_of_poses import joints_of_poses
from mock_robot.arm.built_arm import build_arm
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.simulated.arms import ArmCell, arm_cell, reachable_views, session_document, target_before
from tests.support.waiting import LIMIT_S

ARM = find_arm("IRB 2600-20/1.65")


@pytest.fixture(scope="module")
def cell() -> ArmCell:
    """Twelve views of a standard arm, in the postures that poses without joints are taken to have."""
    rng, target = np.random.default_rng(0), target_before(ARM)
    poses = ARM.forward(reachable_views(rng, ARM, target, 12, any_posture=False))
    joints = joints_of_poses(ARM, list(poses), [None] * len(poses))
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


async def test_the_arms_errors_are_identified_stored_and_in_force_with_the_calibration(
    tmp_path: Path, cell: ArmCell
) -> None:
    poses_only = session_of(cell)
    for view in poses_only["views"]:
        del view["joints_deg"]
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
        assert codes(without) == {"arm-errors", "arm-joints-from-poses"}
        again = (await bench.client.get(f"/calibrations/{without['id']}/arm")).json()
        assert again["joints_from_poses"] == 12
        values = [one["value"] for one in again["parameters"]]
        np.testing.assert_allclose(values, [one.value for one in found.parameters], atol=1e-6)


async def test_joints_of_another_arm_leave_the_calibration_and_say_why(tmp_path: Path, cell: ArmCell) -> None:
    async with serving(settings_for(tmp_path, robot={"model": "IRB 6700-200/2.60"})) as bench:
        calibration = await posted(bench, session_of(cell))
        (refusal,) = (one for one in calibration["verdict"]["findings"] if one["code"].startswith("arm-"))
        assert refusal["code"] == "arm-not-identified"
        assert "the session is of an IRB 2600-" in refusal["message"]
        missing = await bench.client.get(f"/calibrations/{calibration['id']}/arm")
        assert missing.status_code == 404, missing.text


async def test_a_run_identifies_the_arm_that_it_moves_and_solves_again_with_it(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, robot={"model": "IRB 1600-6/1.45"})) as bench:
        run = (await bench.client.post("/calibrate", json={"arm": True}, params={"wait": LIMIT_S})).json()
        assert run["state"] == "finished", run["cause"]
        link = run["links"]["calibration"]
        found = (await bench.client.get(f"{link}/arm")).json()
        assert (found["views"], found["joints_from_poses"], found["taken_up"]) == (5, 0, False)
        assert codes((await bench.client.get(link)).json()) == {"arm-as-drawn"}
        again = (await bench.client.post(f"{link}/solve", json={"without": [1]})).json()
        assert (await bench.client.get(f"/calibrations/{again['id']}/arm")).json()["views"] == 4


async def test_without_a_known_arm_it_is_refused_before_anything_moves(bench: Bench, cell: ArmCell) -> None:
    for path, body in (("/calibrate", {"arm": True}), ("/calibrations", session_of(cell))):
        refused = await bench.client.post(path, json=body)
        assert (refused.status_code, refused.json()["code"]) == (409, "arm-unknown")
        assert "[robot] model" in refused.json()["fix"]
    assert not bench.robot.goals
    assert not (await bench.client.get("/runs")).json()["runs"]

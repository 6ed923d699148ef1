"""The tolerance of requests: what verifications compare with it, and settings that forbid a larger one."""

from pathlib import Path

import pytest

from daemon.config.settings import CalibrationSettings
from daemon.model.requests import CalibrateRequest
from daemon.runs.pose_selection import mount_expectation, stopping_rule
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import serving, settings_for
from tests.support.waiting import LIMIT_S


@pytest.mark.parametrize(
    ("stated", "asked", "hurried"),
    [
        ({}, {}, False),
        ({"tolerance_mm": 0.5}, {}, True),
        ({}, {"tolerance_mm": 0.5}, True),
        ({"tolerance_mm": 1.0}, {}, False),
    ],
    ids=["by nobody", "in the settings", "by the request", "wide"],
)
def test_poses_hurry_to_a_tolerance_that_somebody_stated(
    stated: dict[str, float], asked: dict[str, float], hurried: bool
) -> None:
    rule = stopping_rule(CalibrationSettings.model_validate(stated), CalibrateRequest.model_validate(asked))
    assert (rule.tolerance_mm, rule.hurried) == ((stated | asked).get("tolerance_mm", 1.0), hurried)


async def test_a_verification_is_compared_with_the_tolerance(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, calibration={"tolerance_mm": 50.0})) as bench:
        await apply_calibration(bench)
        for body, within in (({}, True), ({"tolerance_mm": 1e-4}, False)):
            run = (await bench.client.post("/verify", params={"wait": LIMIT_S}, json=body)).json()
            found = run["result"]["verification"]
            assert found["tolerance_mm"] == body.get("tolerance_mm", 50.0)
            largest_mm = 2 * max(max(point["sigma_mm"]) for point in found["points"])
            assert found["expanded_mm"] == pytest.approx(largest_mm)
            assert found["within_tolerance"] is within
        text = (await bench.client.get(f"/runs/{run['id']}", headers={"Accept": "text/plain"})).text
        assert "NOT within the tolerance of 0.0001 mm" in text


async def test_settings_may_forbid_that_a_request_loosens_the_tolerance(tmp_path: Path) -> None:
    strict = {"tolerance_mm": 2.0, "requests_may_loosen": False}
    async with serving(settings_for(tmp_path, calibration=strict)) as bench:
        for path in ("/calibrate", "/verify"):
            refused = await bench.client.post(path, json={"tolerance_mm": 2.1})
            assert (refused.status_code, refused.json()["code"]) == (422, "tolerance-loosened")
        assert (await bench.client.get("/runs")).json()["runs"] == []
        started = await bench.client.post("/calibrate", json={"tolerance_mm": 1.9})
        assert started.status_code == 202


@pytest.mark.parametrize(
    ("stated_mm", "may_loosen", "forbidden"),
    [(None, False, False), (1.0, False, False), (1.1, False, True), (1.1, True, False)],
)
def test_without_a_tolerance_of_the_settings_one_millimetre_is_compared(
    stated_mm: float | None, may_loosen: bool, forbidden: bool
) -> None:
    settings = CalibrationSettings.model_validate({"requests_may_loosen": may_loosen})
    assert settings.forbids(stated_mm) is forbidden


def test_how_far_the_mount_may_be_off_is_a_limit() -> None:
    guess = {"translation_mm": [0.0, 0.0, 100.0], "quaternion_wxyz": [1.0, 0.0, 0.0, 0.0]}
    settings = {"flange_T_camera_guess": guess, "guess_mm": 10.0, "verdict": {"mount_sigma": 3.0}}
    expected = mount_expectation(CalibrationSettings.model_validate(settings), "eye-in-hand")
    assert expected is not None and expected.within_mm == 30.0

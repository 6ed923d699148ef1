"""The arm's axes at each station: in session.json, in the calibration, and read from both again."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.session import ViewDocument
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.load import Load
from calibration.problem import Problem
from daemon.sessions.session_reader import load_problem, open_session
from tests.daemon.cell_under_test import serving, settings_for
from tests.support.waiting import LIMIT_S

POSE = {"translation_mm": [900.0, 0.0, 900.0], "quaternion_wxyz": [0.0, 0.0, 1.0, 0.0]}


def read_session(folder: Path) -> tuple[list[dict[str, Any]], Problem]:
    """The views of the only session.json below `folder`, and the problem it describes."""
    (file,) = folder.rglob("session.json")
    problem = load_problem(open_session(file.parent), lambda done, count: None)
    return json.loads(file.read_text())["views"], problem


async def test_joints_load_and_temperature_are_kept_with_session_and_calibration(tmp_path: Path) -> None:
    load = {"mass_kg": 1.5, "centre_mm": [0.0, 0.0, 60.0], "inertia_kg_m2": [0.01, 0.01, 0.01]}
    async with serving(settings_for(tmp_path, robot={"load": load})) as bench:
        stated = await bench.client.post("/arm/temperature", json={"temperature_c": 31.5})
        assert stated.json() == {"temperature_c": 31.5, "age_s": pytest.approx(0.0, abs=LIMIT_S)}
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        calibration = CalibrationDocument.model_validate_json(
            (await bench.client.get(run["links"]["calibration"])).content
        )
    written, problem = read_session(tmp_path)
    assert problem.load == Load(1.5, (0.0, 0.0, 60.0))
    arm = find_arm("IRB 1600-6/1.45")
    for view, document, read in zip(calibration.views, written, problem.views, strict=True):
        assert view.joints_deg is not None and read.stance.joints_rad is not None
        assert read.arm_temperature_c == document["arm_temperature_c"] == 31.5
        assert list(view.joints_deg) == document["joints_deg"] == pytest.approx(np.degrees(read.stance.joints_rad))
        np.testing.assert_allclose(arm.forward(np.radians(view.joints_deg)), read.base_T_flange, atol=1e-2)


def test_a_view_without_joints_is_read_and_one_of_another_arm_keeps_its_seven() -> None:
    view = {"base_T_flange": POSE, "corners_px": []}
    assert ViewDocument.model_validate(view).stance.joints_rad is None
    seven = ViewDocument.model_validate({**view, "joints_deg": [180.0] * 7}).stance.joints_rad
    assert seven is not None and seven == pytest.approx([np.pi] * 7)

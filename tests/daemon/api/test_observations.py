"""POST /calibrations: views that another program has taken."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.documents.session import CameraDocument
from calibration.problem import MeasuredPoints, MeasuredPose, Problem
from calibration.transforms import inverse
from daemon.api.dependencies import MAX_JSON_VALUES
from daemon.api.routes.calibrations import MAX_SESSION_VALUES
from tests.daemon.cell_under_test import Bench, pose_json, serving, settings_for
from tests.simulated.external_axes import axis_cell
from tests.simulated.measured_sessions import Measure, measured_cell, points, tracker
from tests.simulated.sessions import CellNoise, random_cell

CHESSBOARD = {"kind": "chessboard", "columns": 11, "rows": 8, "pitch_mm": 15.0}


def body_of(problem: Problem) -> dict[str, Any]:
    """The session as a body, without its files."""
    views: list[dict[str, Any]] = []
    for view in problem.views:
        one: dict[str, Any] = {"base_T_flange": pose_json(view.base_T_flange)}
        if isinstance(view.measured, MeasuredPose):
            one["camera_T_target"] = pose_json(view.measured.camera_T_target)
            if view.measured.covariance is not None:
                one["covariance"] = view.measured.covariance.tolist()
        elif isinstance(view.measured, MeasuredPoints):
            rows = zip(view.measured.ids.tolist(), view.measured.points_mm.tolist(), strict=True)
            one["points_mm"] = [[key, *point] for key, point in rows]
        elif view.detection is not None:
            rows = zip(view.detection.ids.tolist(), view.detection.corners_px.tolist(), strict=True)
            one["corners_px"] = [[key, *corner] for key, corner in rows]
        views.append(one)
    body: dict[str, Any] = {"schema_version": 1, "setup": problem.setup, "views": views}
    if not isinstance(problem.views[0].measured, MeasuredPose):
        body["target"] = CHESSBOARD
    if not problem.in_space:
        body |= {"camera": None, "image_size": list(problem.image_size)}
    return body


@pytest.mark.parametrize(
    ("measure", "setup"),
    [(tracker(), "eye-in-hand"), (tracker(known=True), "eye-to-hand"), (points(), "eye-in-hand")],
    ids=["poses", "poses-with-covariance", "points"],
)
async def test_measurements_in_space_are_solved_and_stored(tmp_path: Path, measure: Measure, setup: Any) -> None:
    async with serving(settings_for(tmp_path, calibration={"tolerance_mm": 4.0})) as bench:
        await solve_measurements(bench, measure, setup)


async def solve_measurements(bench: Bench, measure: Measure, setup: Any) -> None:
    cell = measured_cell(np.random.default_rng(3), 12, measure, setup=setup)
    made = await bench.client.post("/calibrations", json=body_of(cell.problem))
    assert made.status_code == 201, made.text
    found = made.json()
    X = PoseDocument.model_validate(found["flange_T_camera" if setup == "eye-in-hand" else "base_T_camera"])
    off = cell.error(X.transform())
    assert np.abs(off[:3]).max() < np.radians(0.2)
    assert np.abs(off[3:]).max() < 2.0
    assert found["verdict"]["accepted"], found["verdict"]
    assert (await bench.client.get(made.headers["location"])).json() == found
    assert (await bench.client.get("/calibrations/current")).status_code == 404, "nothing is applied"
    assert bench.camera.pictures == 0
    assert not bench.robot.goals


async def test_corners_of_another_program_are_solved(bench: Bench) -> None:
    cell = random_cell(np.random.default_rng(5), 10, CellNoise())
    made = await bench.client.post("/calibrations", json=body_of(cell.problem))
    assert made.status_code == 201, made.text
    assert made.json()["camera"]["source"] == "estimated"
    assert all(point["expanded_mm"] > 0 for point in made.json()["uncertainty"]["points"])


async def test_what_cannot_be_solved_is_refused_with_its_place(bench: Bench) -> None:
    body = body_of(measured_cell(np.random.default_rng(3), 4, tracker()).problem)
    pose, other = body["views"][0]["base_T_flange"], body["views"][1:]
    picture = {"base_T_flange": pose, "image": "view_0.png"}
    lone = {"base_T_flange": pose, "points_mm": [[0, 1.0, 2.0, 3.0]]}
    for views, place, status in (
        ([picture, *other], "views[0].image", 422),
        ([lone, *other], "views", 422),
        ([{"base_T_flange": pose}, *other], "views[0]", 422),
        ([], "views", 422),
    ):
        refused = await bench.client.post("/calibrations", json={**body, "views": views})
        assert (refused.status_code, refused.json()["code"]) == (status, "document-refused"), refused.text
        assert refused.json()["problems"][0]["place"] == place
    assert (await bench.client.post("/calibrations")).status_code == 422
    assert (await bench.client.get("/calibrations")).json()["calibrations"] == []


async def test_poses_of_no_cell_are_stored_without_a_transform_and_say_why(bench: Bench) -> None:
    body = body_of(measured_cell(np.random.default_rng(3), 4, tracker()).problem)
    for view in body["views"]:
        view["base_T_flange"]["translation_mm"] = [1e300, 0.0, 0.0]
    made = await bench.client.post("/calibrations", json=body)
    assert made.status_code == 201, made.text
    found = made.json()
    assert (found["verdict"]["accepted"], found["flange_T_camera"]) == (False, None)
    assert "too-few-poses" in {finding["code"] for finding in found["verdict"]["findings"]}
    assert {view["status"] for view in found["views"]} == {"rejected"}


async def test_the_camera_s_own_poses_in_place_of_the_robot_s_are_a_circle(bench: Bench) -> None:
    """As recorders mix them up that store both in a record; the fit would be perfect, with the identity as X."""
    problem = measured_cell(np.random.default_rng(3), 8, tracker()).problem
    seen = [view.measured.camera_T_target for view in problem.views if isinstance(view.measured, MeasuredPose)]
    for robot in (seen, [inverse(pose) for pose in seen]):
        body = body_of(problem)
        for view, pose in zip(body["views"], robot, strict=True):
            view["base_T_flange"] = pose_json(pose)
        made = await bench.client.post("/calibrations", json=body)
        assert made.status_code == 201, made.text
        found = made.json()
        assert (found["verdict"]["accepted"], found["flange_T_camera"], found["uncertainty"]) == (False, None, None)
        assert "circular-poses" in {finding["code"] for finding in found["verdict"]["findings"]}


async def test_a_session_may_have_more_values_than_other_bodies_and_not_any_number(bench: Bench) -> None:
    for values, status in ((MAX_JSON_VALUES + 1, 422), (MAX_SESSION_VALUES + 1, 400)):
        refused = await bench.client.post("/calibrations", json=[0] * (values + 1))
        assert refused.status_code == status, refused.text


async def test_a_session_on_a_track_gives_its_direction(bench: Bench) -> None:
    given = axis_cell("track", 1, views=12).problem
    body = body_of(given) | {"external_axis": {"kind": "track", "direction": [0.0, 1.0, 0.0]}}
    for one, view in zip(body["views"], given.views, strict=True):
        one["external_axes"] = list(view.stance.external_axes)
    assert given.camera is not None
    body["camera"] = CameraDocument.of(given.camera).model_dump(mode="json")
    made = await bench.client.post("/calibrations", json=body)
    assert made.status_code == 201, made.text
    found = made.json()["external_axis"]
    assert (found["kind"], found["readings"]) == ("track", [0.0, 2000.0])
    assert found["expanded_mm"] < 0.5

"""Pictures in the sizes of a screen, shared and never taken for it during a run; what each view of a run shows."""

import asyncio
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from calibration.kinematics.abb_arms import find_arm
from calibration.monitoring.view_residuals import root_mean_square
from daemon.api.run_views import joints_in_posture
from daemon.cell.skeleton import skeleton_mm
from drivers.interfaces import CaptureSettings
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.fakes import BOARD, Gate
from tests.support.patience import run_patiently
from tests.support.waiting import LIMIT_S

MAGIC = {"image/png": b"\x89PNG", "image/jpeg": b"\xff\xd8\xff", "image/webp": b"RIFF"}


def size_of(content: bytes) -> tuple[int, int]:
    image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert image is not None
    return image.shape[1], image.shape[0]


@pytest.mark.parametrize(
    ("capture", "expected"),
    [
        (None, {}),
        (CaptureSettings(bits=12), {"handeyed-bits": "12"}),
        (
            CaptureSettings(12, exposure_us=8000.0, gain_db=1.5),
            {"handeyed-bits": "12", "handeyed-exposure-us": "8000", "handeyed-gain-db": "1.5"},
        ),
    ],
    ids=["unknown", "bits", "all"],
)
async def test_a_picture_comes_with_its_exposure_and_gain(
    bench: Bench, capture: CaptureSettings | None, expected: dict[str, str]
) -> None:
    bench.camera.capture = capture
    answer = await bench.client.get("/camera/frame", params={"width": 240})
    found = {name: value for name, value in answer.headers.items() if name.startswith("handeyed-")}
    assert found == {"handeyed-source": "camera", **expected}


@pytest.mark.parametrize("media_type", MAGIC)
async def test_a_picture_comes_in_the_format_and_size_that_are_asked_for(bench: Bench, media_type: str) -> None:
    accept = {"accept": media_type}
    whole = await bench.client.get("/camera/frame", headers=accept)
    small = await bench.client.get("/camera/frame", params={"width": 240}, headers=accept)
    for answer, size in ((whole, (640, 480)), (small, (240, 180))):
        assert (answer.status_code, answer.headers["content-type"], answer.headers["vary"]) == (
            200,
            media_type,
            "Accept",
        )
        assert answer.content.startswith(MAGIC[media_type])
        assert size_of(answer.content) == size
        assert answer.headers["cache-control"] == "no-store"


@pytest.mark.parametrize(
    ("accept", "expected"),
    [
        ("*/*", "image/png"),
        ("image/avif,image/webp,*/*;q=0.8", "image/webp"),
        ("image/jpeg;q=0.5,image/webp;q=0.4", "image/jpeg"),
    ],
)
async def test_the_preferred_format_is_sent(bench: Bench, accept: str, expected: str) -> None:
    answer = await bench.client.get("/camera/frame", params={"width": 240}, headers={"accept": accept})
    assert answer.headers["content-type"] == expected


async def test_what_cannot_be_sent_is_refused(bench: Bench) -> None:
    assert (await bench.client.get("/camera/frame", headers={"accept": "text/html"})).status_code == 406
    assert (await bench.client.get("/camera/frame", params={"width": 241})).status_code == 422


async def test_all_who_ask_at_once_share_one_picture(bench: Bench) -> None:
    widths = (None, 240, 480, 240, 480, None)
    asked = [bench.client.get("/camera/frame", params={"width": width} if width else {}) for width in widths]
    assert {answer.status_code for answer in await asyncio.gather(*asked)} == {200}
    assert bench.camera.pictures == 1


async def test_during_a_run_its_last_picture_is_shown_and_none_taken(bench: Bench) -> None:
    bench.robot.before_move = gate = Gate(at_move=1)
    location = (await bench.client.post("/calibrate")).headers["location"]
    await gate.reached.wait()
    for path in ("/camera/frame", "/camera/frame.png"):
        early = await bench.client.get(path)
        assert (early.status_code, early.json()["code"]) == (409, "cell-busy")
    bench.robot.before_move = second = Gate(at_move=3)
    gate.open.set()
    await second.reached.wait()
    before = bench.camera.pictures
    shown = await bench.client.get("/camera/frame", headers={"accept": "image/webp"}, params={"width": 480})
    as_png = await bench.client.get("/camera/frame.png", headers={"accept": "image/webp"})
    assert size_of(as_png.content) == (640, 480)
    for answer, media_type in ((shown, "image/webp"), (as_png, "image/png")):
        assert answer.headers["content-type"] == media_type
        assert answer.headers["handeyed-source"] == f"{location}/frames/1"
    assert (await bench.client.get("/camera/look")).json()["code"] == "cell-busy"
    assert bench.camera.pictures == before == 2
    second.open.set()
    await bench.run_over(location)


async def test_the_target_is_looked_for_once_for_all(bench: Bench) -> None:
    looks = await asyncio.gather(*(bench.client.get("/camera/look") for _ in range(5)))
    document = looks[0].json()
    assert len(document["corners"]) == document["of"] == len(BOARD.points_mm)
    assert document["missing"] is None
    assert 0 < document["fill"] < 1
    assert document["sharpness"] > 0
    assert bench.camera.pictures == 1


async def test_a_target_that_is_not_seen_has_a_reason(bench: Bench) -> None:
    bench.camera.blind = lambda picture: True
    document = (await bench.client.get("/camera/look")).json()
    assert document["corners"] == []
    assert document["missing"]["code"]
    assert document["fill"] == 0


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """A finished calibration run, its views, its calibration and one of its pictures."""
    return run_patiently(finished_runs(tmp_path_factory.mktemp("views")))


async def finished_runs(folder: Path) -> dict[str, Any]:
    async with serving(settings_for(folder, robot={"model": "IRB 1600-6/1.45"})) as bench:
        run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert run["state"] == "finished", run["cause"]
        frame = f"/runs/{run['id']}/frames/0"
        verified = (await bench.client.post(f"/calibrations/{run['id']}/apply")).status_code
        verification = (await bench.client.post("/verify", params={"wait": LIMIT_S})).json()
        return {
            "run": run,
            "applied": verified,
            "views": (await bench.client.get(f"/runs/{run['id']}/views")).json(),
            "verified": (await bench.client.get(f"/runs/{verification['id']}/views")).json(),
            "calibration": (await bench.client.get(f"/calibrations/{run['id']}")).json(),
            "frame": await bench.client.get(frame, params={"width": 240}, headers={"accept": "image/jpeg"}),
            "png": await bench.client.get(frame),
            "none": (await bench.client.get("/runs/nowhere/views")).status_code,
        }


def test_each_view_has_its_corners_and_residuals_by_both_poses(views: dict[str, Any]) -> None:
    document, calibration = views["views"], views["calibration"]
    assert document["calibration_id"] == calibration["id"]
    assert len(document["views"]) == len(calibration["views"]) == 5
    for view, solved in zip(document["views"], calibration["views"], strict=True):
        assert (view["status"], len(view["corners"])) == (solved["status"], len(BOARD.points_mm))
        rows = np.array([corner[1:] for corner in view["corners"]], float)
        assert root_mean_square(rows[:, 2:4]) == pytest.approx(view["rms_px"], abs=2e-3)
        assert root_mean_square(rows[:, 4:6]) == pytest.approx(view["rms_px_free"], abs=2e-3)
        assert view["rms_px_free"] == pytest.approx(solved["reprojection_px"], abs=0.02)
        assert view["rms_px_free"] <= view["rms_px"] + 0.02
        assert view["at"]


def test_the_joints_of_a_view_follow_from_its_pose_and_posture() -> None:
    arm = find_arm("IRB 1600-6/1.45")
    joints = np.radians([10.0, 20.0, -15.0, 30.0, 40.0, -50.0])
    pose, posture = arm.forward(joints), arm.configuration(joints)
    found = joints_in_posture(arm, pose, posture)
    assert found is not None
    assert np.allclose(found, joints, atol=1e-6)
    points = skeleton_mm(arm, found)
    assert points is not None
    assert np.allclose(points[4], pose[:3, 3], atol=2e-3)
    assert joints_in_posture(arm, pose, (9, 9, 9, 0)) is None
    assert joints_in_posture(None, pose, posture) is None


def test_the_views_of_a_verification_are_predicted_without_corrections(views: dict[str, Any]) -> None:
    assert views["verified"]["calibration_id"] == views["calibration"]["id"]
    for view in views["verified"]["views"]:
        assert view["rms_px"] is not None
        assert view["rms_px_free"] is None
        assert view["status"] == "taken"


def test_a_stored_picture_never_changes(views: dict[str, Any]) -> None:
    assert "immutable" in views["frame"].headers["cache-control"]
    assert size_of(views["frame"].content) == (240, 180)
    assert views["png"].headers["content-type"] == "image/png"
    assert views["none"] == 404

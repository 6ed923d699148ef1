"""A camera on a stand, the target on the flange: the first calibration of an empty store, by the page alone."""

from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import pytest_asyncio

from calibration.documents.pose import PoseDocument
from calibration.transforms import Array, inverse, rotation_angle_rad, transform
from drivers.interfaces import CameraFrame
from tests.daemon.access_keys import bearer, with_keys
from tests.daemon.cell_under_test import Bench, Parts, pose_json
from tests.daemon.fakes import (
    BASE_T_TARGET,
    FLANGE_T_CAMERA,
    FakeCamera,
    FakeRobot,
    picture_of_the_board,
    poses_around_the_target,
)
from tests.daemon.page.conftest import Opened
from tests.daemon.page.holding import hold_by_key, hold_until, press

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow]

Cell = tuple[Bench, dict[str, str]]

BASE_T_CAMERA = transform(np.array([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]]), [1300.0, 0.0, 700.0])
FLANGE_T_TARGET = transform(np.diag([1.0, -1.0, -1.0]), [-110.0, 80.0, 60.0])


def seen_poses() -> list[Array]:
    """base_T_flange (4, 4) that show the target as `poses_around_the_target` do to a camera on the flange."""
    shown = [inverse(pose @ FLANGE_T_CAMERA) @ BASE_T_TARGET for pose in poses_around_the_target(6)]
    return [BASE_T_CAMERA @ camera_T_target @ inverse(FLANGE_T_TARGET) for camera_T_target in shown]


@dataclass
class StandCamera(FakeCamera):
    """Sees the board that the flange carries."""

    async def grab(self, newer_than_s: float) -> CameraFrame:
        frame = await super().grab(newer_than_s)
        camera_T_target = inverse(BASE_T_CAMERA) @ self.robot.base_T_flange @ FLANGE_T_TARGET
        image = picture_of_the_board(BASE_T_TARGET @ inverse(camera_T_target) @ inverse(FLANGE_T_CAMERA))
        return CameraFrame(image, frame.taken_at_s, capture=frame.capture)


@pytest_asyncio.fixture(scope="module", loop_scope="module", params=["taught", "planned"])
async def cell(request: Any, tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Cell]:
    poses = seen_poses()
    robot = FakeRobot(base_T_flange=poses[0].copy())
    parts = Parts(robot=robot)
    parts.camera = StandCamera(robot)
    taught = [pose_json(pose) for pose in poses] if request.param == "taught" else []
    async with with_keys(
        tmp_path_factory.mktemp("stand"), parts, camera={"setup": "eye-to-hand"}, calibration={"poses": taught}
    ) as running:
        yield running


@pytest.fixture
def cookies() -> dict[str, Any]:
    """None are kept: each cell is another daemon."""
    return {}


async def test_the_first_calibration_of_a_camera_on_a_stand(open_page: Opened, cell: Cell) -> None:
    bench, keys = cell
    assert (await bench.client.get("/calibrations/current", headers=bearer(keys["viewer"]))).status_code == 404
    async with open_page("operator", "cell") as page:
        await page.get_by_text("No calibration is active").wait_for()
        await page.get_by_text("corners found").first.wait_for()
        await press(page.get_by_role("link", name="Calibrate").and_(page.locator(".button.primary")))
        await page.get_by_text("Ready.").wait_for()
        good = page.get_by_text("✓ Good")
        await hold_until(page, hold_by_key, "Calibrate (arm moves)", good.is_visible)
        await page.get_by_role("heading", name="Camera in the base").wait_for()
        await hold_until(page, hold_by_key, "Activate", page.get_by_text("Active since").is_visible)
        await page.evaluate("location.hash = '#/verify'")
        await page.get_by_role("button", name="Quick check (arm moves)").wait_for()
    answer = await bench.client.get("/calibrations/current", headers=bearer(keys["viewer"]))
    found = PoseDocument.model_validate(answer.json()["calibration"]["base_T_camera"]).transform()
    assert np.linalg.norm(found[:3, 3] - BASE_T_CAMERA[:3, 3]) < 1.0
    assert np.degrees(rotation_angle_rad(found[:3, :3].T @ BASE_T_CAMERA[:3, :3])) < 0.1

"""An arm that hangs upside down or rides a track: the pose is right, or it is refused with the likely cause."""

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.transforms import Array, difference, transform
from daemon.errors import NotStill
from mock_robot.cabinet.cabinet import Mounting
from mock_robot.truth.score import score_calibration
from tests.daemon.fakes import ply_of, points_of
from tests.mock_robot.running_cell import RunningCell, running_cell
from tests.stories.plant import Plant, daemon_for, poses_taught_for
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

WORLD_T_BASE = transform(np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, 2500.0])
BASE_FRAME = PoseDocument.of(WORLD_T_BASE).model_dump(mode="json")
POINT_MM = 0.4


def hang(cell: RunningCell) -> None:
    cell.controller.mounting = Mounting(WORLD_T_BASE)


def ride(integrated: bool, at_mm: float = 400.0) -> Callable[[RunningCell], None]:
    """On a track along the world's x axis."""

    def mount(cell: RunningCell) -> None:
        cell.controller.mounting = Mounting(track=(1.0, 0.0, 0.0), integrated=integrated)
        move_track(cell, at_mm)

    return mount


def move_track(cell: RunningCell, to_mm: float) -> None:
    controller: Any = cell.controller
    controller.unit.external = [to_mm, *controller.unit.external[1:]]
    controller.external_axes = tuple(controller.unit.external)


@asynccontextmanager
async def mounted(folder: Path, mount: Callable[[RunningCell], None], **robot: Any) -> AsyncIterator[Plant]:
    async with running_cell(7, 100.0) as cell:
        memory = cell.controller.memory  # type: ignore[attr-defined]
        memory["cell_box_low"].value, memory["cell_box_high"].value = [-9000.0] * 3, [9000.0] * 3
        mount(cell)
        calibration = {"poses": poses_taught_for(7)[:5]}
        async with daemon_for(cell, folder, robot=robot, calibration=calibration) as story:
            yield story


async def robot_of(story: Plant) -> dict[str, Any]:
    found: dict[str, Any] = (await story.operator.client.get("/robot")).json()
    return found


async def test_an_arm_upside_down_is_calibrated_in_its_base_frame(tmp_path: Path) -> None:
    async with mounted(tmp_path, hang, base_frame=BASE_FRAME) as story:
        ask = story.operator.client
        seen = await robot_of(story)
        forward = story.cell.controller.arm.arm.forward(np.radians(np.array(seen["joints_deg"])))
        off_mm, _ = difference(PoseDocument.model_validate(seen["base_T_flange"]).transform(), forward)
        assert off_mm < 0.01
        assert (seen["frame"], seen["frame_warning"]) == ("base", None)
        run = (await ask.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert (run["state"], run["stations"]) == ("finished", 5), run["cause"]
        current = (await story.application.store.current())[1].document
        assert current.flange_T_camera is not None
        assert score_calibration(story.truth, current.flange_T_camera.transform())["point_rms_mm"] < POINT_MM
        points = np.array([[0.0, 0, 600], [50, -20, 580]])
        params, headers = {"pose": "now"}, {"content-type": "application/x-ply"}
        answer = await ask.post("/register", params=params, content=ply_of(points), headers=headers)
        truth: Array = story.cell.cell.flange_at(story.cell.cell.clock()) @ story.truth.flange_T_camera
        expected = points @ truth[:3, :3].T + truth[:3, 3]
        assert np.abs(points_of(answer.content) - expected).max() < POINT_MM


@pytest.mark.parametrize(
    ("mount", "cause"),
    [(hang, "hangs upside down"), (ride(integrated=True), "rides on a track")],
    ids=["upside down", "integrated track"],
)
async def test_a_base_elsewhere_is_warned_of_and_nothing_moves(
    tmp_path: Path, mount: Callable[[RunningCell], None], cause: str
) -> None:
    async with mounted(tmp_path, mount) as story:
        seen = await robot_of(story)
        assert seen["frame"] == "world"
        assert cause in seen["frame_warning"]
        status = (await story.operator.client.get("/calibrate")).json()
        assert any(cause in warning for warning in status["warnings"])
        answer = await story.operator.client.post("/calibrate", params={"wait": LIMIT_S})
        assert answer.status_code >= 400 or answer.json()["state"] == "failed"
        assert story.cell.controller.moves_accepted == 0


@pytest.mark.parametrize("integrated", [True, False], ids=["integrated", "not integrated"])
async def test_a_track_that_moves_between_two_views_is_refused(tmp_path: Path, integrated: bool) -> None:
    """Only one of the two poses is right, and the link does not show which."""
    async with mounted(tmp_path, ride(integrated, at_mm=0.0)) as story:
        cell = story.application.cell
        async with cell.hold("views by hand"):
            before = await cell.read_standing_pose()
            move_track(story.cell, 250.0)
            with pytest.raises(NotStill, match=r"external axis 1 moved from 0\.00 to 250\.00"):
                await cell.read_standing_pose()
            move_track(story.cell, 0.0)
            again = await cell.read_standing_pose()
        assert difference(before.base_T_flange, again.base_T_flange)[0] < 0.01
        moved_mm = 250.0 if integrated else 0.0
        move_track(story.cell, 250.0)
        seen = PoseDocument.model_validate((await robot_of(story))["base_T_flange"]).transform()
        assert difference(before.base_T_flange, seen)[0] == pytest.approx(moved_mm, abs=0.01)

"""The flange stays in the box on its way, measured at the shipped RAPID by an independent chain of links."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.transforms import Array, rotation_from_vector, transform
from mock_robot.arm.simulated_arm import SimulatedArm
from tests.calibration.kinematics.link_chain import urdf_chain
from tests.stories.plant import Plant, plant, small_pictures

pytestmark = pytest.mark.slow

X_MAX_MM = 950.0
BOX_MM = ((-500.0, -1000.0, 200.0), (X_MAX_MM, 1000.0, 1500.0))
MAX_OUTSIDE_MM = 1.0


@pytest.fixture
def moves(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Array, Array]]:
    """The joints between which the mock's arm has moved."""
    made: list[tuple[Array, Array]] = []
    depart = SimulatedArm.depart

    def recorded(arm: SimulatedArm, joints: Array, speed_mm_s: float, linear: bool, now_s: float, *more: Any) -> float:
        made.append((arm.joints_at(now_s), joints))
        return depart(arm, joints, speed_mm_s, linear, now_s, *more)

    monkeypatch.setattr(SimulatedArm, "depart", recorded)
    return made


def furthest_x_mm(story: Plant, moves: list[tuple[Array, Array]]) -> float:
    """Largest x of the flange on all moves."""
    arm, along = story.cell.controller.arm.arm, np.linspace(0, 1, 200)
    return float(max(urdf_chain(arm, a + k * (b - a))[0, 3] for a, b in moves for k in along))


def poses_on_an_arc(story: Plant, *angles_and_radii: tuple[float, float]) -> list[dict[str, object]]:
    """As the flange is turned at the start, at angles (degrees) about axis 1 and radii (mm), 850 mm high."""
    start = story.cell.cell.flange_at(story.cell.cell.clock())
    poses = []
    for angle_deg, radius_mm in angles_and_radii:
        turn = transform(rotation_from_vector([0, 0, np.radians(angle_deg)]), np.zeros(3))
        pose = turn @ transform(start[:3, :3], [radius_mm, 0.0, 850.0])
        poses.append(PoseDocument.of(pose).model_dump(mode="json"))
    return poses


async def test_a_plan_that_swings_out_of_the_box_moves_nothing(
    tmp_path: Path, moves: list[tuple[Array, Array]]
) -> None:
    async with plant(tmp_path, truth=small_pictures(7), robot={"box_mm": BOX_MM}) as story:
        swing = poses_on_an_arc(story, (40, 980), (-40, 980), (0, 800))
        for path in ("/calibrate", "/scans"):
            answer = await story.operator.client.post(path, json={"poses": swing})
            assert (answer.status_code, answer.json()["code"]) == (422, "pose-refused"), answer.text
            assert "pose 2: at 5" in answer.json()["detail"] or "pose 2: at 4" in answer.json()["detail"]
        assert story.cell.commanded_moves == 0
        assert moves == []


async def test_what_is_driven_stays_in_the_box(tmp_path: Path, moves: list[tuple[Array, Array]]) -> None:
    async with plant(tmp_path, truth=small_pictures(7), robot={"box_mm": BOX_MM}) as story:
        around = poses_on_an_arc(story, (40, 980), (20, 930), (0, 940), (-20, 930), (-40, 980))
        run = await story.operator.starts("/calibrate", poses=around)
        assert (await story.operator.waits_for_the_end_of(run))["station"] == len(around)
        assert len(moves) == len(around)
        assert 0 < furthest_x_mm(story, moves) < X_MAX_MM + MAX_OUTSIDE_MM

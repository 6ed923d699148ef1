"""Whatever is asked for, from wherever the arm stands: no approach leads what is carried beyond the point."""

import asyncio
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.documents.pose import PoseDocument
from calibration.transforms import Array, map_points, rotation_from_vector, transform
from daemon.cell.cell import Cell, Devices
from daemon.cell.motion_rules import MotionRules
from daemon.config.robot_settings import SettlingSettings
from daemon.config.settings import RobotSettings
from daemon.errors import PoseRefused
from daemon.runs.run_log import RunLog
from daemon.runtime.clock import Clock
from extensions.touch.approach import MAX_BEYOND_MM, MAX_FROM_SIGHT_DEG, TouchApproach
from extensions.touch.mathematics.report import Sighting
from extensions.touch.requests import ApproachRequest
from extensions.touch.touch_tests import PointToTouch
from tests.daemon.calibrations import a_calibration
from tests.daemon.fakes import FakeCamera, FakeRobot
from tests.support.cases import cases

SLACK_MM = 0.011
"""Of MIN_STEP_MM, and of numbers."""


def vectors(most: float) -> st.SearchStrategy[Array]:
    return st.tuples(*[st.floats(-most, most)] * 3).map(np.array)


directions = vectors(1.0).filter(lambda v: float(np.linalg.norm(v)) > 0.1).map(lambda v: v / np.linalg.norm(v))


@st.composite
def near(draw: st.DrawFn, direction: Array) -> Array:
    """Any direction, mostly one not far from the given one."""
    mixed = direction + draw(st.sampled_from((0.0, 0.5, 3.0, -1.5))) * draw(directions)
    length = float(np.linalg.norm(mixed))
    return mixed / length if length > 1e-3 else direction


class Drawn:
    """A request, where the arm stands, what it carries, and what the camera saw."""

    def __init__(self, draw: st.DrawFn) -> None:
        base_R_flange = rotation_from_vector(draw(vectors(3.0)))
        self.tip_mm = draw(vectors(300.0))
        length = float(np.linalg.norm(self.tip_mm))
        tool = base_R_flange @ self.tip_mm / length if length > 1 else base_R_flange[:, 2]
        self.along = base_R_flange[:, 2] if draw(st.booleans()) else draw(near(tool))
        by_default = np.array_equal(self.along, base_R_flange[:, 2])
        self.sights = np.array([draw(near(self.along)) for _ in range(draw(st.integers(1, 3)))])
        self.camera_mm = draw(vectors(150.0))
        self.carried_mm = [draw(vectors(200.0)).tolist() for _ in range(draw(st.integers(0, 2)))]
        self.point_mm = draw(vectors(500.0))
        left_mm = draw(st.sampled_from((-200.0, -1.0, -0.4, 0.0, 0.3, 3.0, 19.0, 20.0, 50.0, 300.0)))
        beside = draw(st.sampled_from((0.0, 0.0, 1.0, 100.0))) * np.cross(self.along, draw(directions))
        tip = self.point_mm - left_mm * self.along + beside
        self.base_T_flange = transform(base_R_flange, tip - base_R_flange @ self.tip_mm)
        body = {"touch": {"id": 0}, "stand_off_mm": draw(st.sampled_from((5.0, 20.0, 100.0)))}
        body |= {} if by_default else {"along": (draw(st.floats(0.01, 100.0)) * self.along).tolist()}
        body |= {} if draw(st.booleans()) else {"step_mm": draw(st.floats(0.01, 5.0))}
        self.request = ApproachRequest.model_validate(body)

    def before_mm(self, base_T_flange: Array) -> Array:
        """How far before the point's plane, (n,), are the tip, the flange, the camera and each carried point."""
        points = np.array([self.tip_mm, np.zeros(3), self.camera_mm, *self.carried_mm])
        found: Array = (self.point_mm - map_points(base_T_flange, points)) @ self.along
        return found

    def move(self) -> TouchApproach:
        robot = FakeRobot(base_T_flange=self.base_T_flange.copy())
        devices, still = Devices(robot, FakeCamera(robot), None), SettlingSettings(gap_s=0.0, limit_s=0.5)
        wide = {"address": "tcp://robot:1", "box_mm": [[-9e3] * 3, [9e3] * 3], "carried_mm": self.carried_mm}
        rules = MotionRules(RobotSettings.model_validate(wide))
        x = {"flange_T_camera": PoseDocument.of(transform(np.eye(3), self.camera_mm))}
        given = CalibrationInUse(a_calibration("cal-1").model_copy(update=x))
        point = PointToTouch(Sighting(self.point_mm, self.sights), self.tip_mm, given)
        return TouchApproach(Cell(devices, still, Clock()), rules, self.request, point)


drawn = st.composite(Drawn)()


def moves_of(asked: Drawn) -> list[tuple[Array, Array]]:
    """Each move that the arm made, from and to: base_T_flange (4, 4). Straight, without a turn."""
    move = asked.move()
    try:
        asyncio.run(move.drive(cast(RunLog, type("Log", (), {"id": "run"}))))
    except PoseRefused:
        event("refused")
    robot = cast(FakeRobot, move.cell.robot)
    goals = [goal.base_T_flange for goal in robot.goals]
    assert all(goal.path == "linear" for goal in robot.goals)
    assert all(np.allclose(goal[:3, :3], asked.base_T_flange[:3, :3], atol=1e-9) for goal in goals)
    event(f"{len(goals)} moves, {'a step' if asked.request.step_mm else 'to the stand-off'}")
    return list(zip([asked.base_T_flange, *goals], goals, strict=False))


def violations(asked: Drawn, moves: list[tuple[Array, Array]]) -> list[str]:
    found = []
    for start, end in moves:
        before, after = asked.before_mm(start), asked.before_mm(end)
        least_mm = 0.0 if asked.request.step_mm else asked.request.stand_off_mm
        if (after < least_mm - SLACK_MM).any():
            found.append("nearer than allowed")
        if before[0] < -MAX_BEYOND_MM:
            found.append("through the point's plane")
        shift = end[:3, 3] - start[:3, 3]
        across_mm = float(np.linalg.norm(shift - shift @ asked.along * asked.along))
        if across_mm > SLACK_MM and not asked.request.step_mm and (before < least_mm - SLACK_MM).any():
            found.append("across before it was back")
        if (asked.sights @ asked.along < np.cos(np.radians(MAX_FROM_SIGHT_DEG)) - 1e-9).any():
            found.append("against the line of sight")
    return found


@settings(max_examples=cases(500), deadline=None)
@given(drawn)
def test_no_move_brings_anything_nearer_than_the_stand_off_or_by_a_step_beyond_the_point(asked: Drawn) -> None:
    assert violations(asked, moves_of(asked)) == []


@pytest.mark.parametrize(
    ("unchecked", "found"),
    [("require_in_sight", "against the line of sight"), ("require_tip_first", "nearer than allowed")],
)
def test_an_approach_that_is_not_checked_is_found_out(
    unchecked: str, found: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"extensions.touch.approach.Approach.{unchecked}", lambda *_: None)
    seen: set[str] = set()

    @settings(max_examples=200, deadline=None, database=None)
    @given(drawn)
    def look(asked: Drawn) -> None:
        seen.update(violations(asked, moves_of(asked)))

    look()
    assert found in seen


def test_a_tip_from_beyond_the_point_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("extensions.touch.approach.MAX_BEYOND_MM", 1e6)
    seen: dict[str, Any] = {}

    @settings(max_examples=500, deadline=None, database=None)
    @given(drawn)
    def look(asked: Drawn) -> None:
        seen.update(dict.fromkeys(violations(asked, moves_of(asked))))

    look()
    assert "through the point's plane" in seen

"""An arm on a track, and a turntable before it, that the controller leaves out of its poses: found by hand, then used.

`pytest -m '' -s tests/stories/test_beside_the_arm.py` prints the figures of docs/cells.md.
"""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.external_axis import FoundAxisDocument
from calibration.documents.pose import PoseDocument
from calibration.kinematics.arm import UnreachablePoseError
from calibration.kinematics.external_axis import AxisKind, ExternalAxis, reading_of
from calibration.transforms import Array, inverse, map_points
from daemon.config.settings import TaughtPose
from mock_robot.cabinet.cabinet import Mounting
from mock_robot.cabinet.panel import Mode
from mock_robot.truth.score import score_calibration, score_cloud
from tests.daemon.fakes import ply_of, points_of
from tests.mock_robot.running_cell import RunningCell
from tests.stories.jogging import jogs_and_waits
from tests.stories.plant import Plant, plant, poses_taught_for, small_pictures
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

SEED = 7
VIEWS_EACH = 3
POINTS = np.array([[0.0, 0, 600], [50, -20, 580], [-80, 40, 620]])
PART_MM = 0.5
WIDE_MM = ((-2000.0, -2000.0, 0.0), (2000.0, 2000.0, 2500.0))
OFF = np.radians([0.3, -0.2])
"""Of the axis as built from the one as drawn."""


@dataclass(frozen=True)
class Beside:
    """An axis as drawn, as [robot.external_axis] has it; where views are taken, and from where the part is scanned."""

    drawn: dict[str, Any]
    readings: tuple[float, ...]
    scanned_at: tuple[float, float]

    def built(self) -> ExternalAxis:
        kind: AxisKind = self.drawn["kind"]
        point_mm = np.array(self.drawn.get("point_mm", np.zeros(3)))
        drawn = ExternalAxis(kind, self.drawn["number"], np.array(self.drawn["direction"]), point_mm)
        return drawn.apply_step(np.array([*OFF, 12.0, -8.0]))


TRACK = Beside({"kind": "track", "number": 1, "direction": [0.0, 1.0, 0.0]}, (-1000.0, 0.0, 1000.0), (-300.0, 1500.0))
TURNTABLE = Beside(
    {"kind": "turntable", "number": 2, "direction": [0.0, 0.0, 1.0], "point_mm": [1000.0, 150.0, 0.0]},
    (-120.0, 0.0, 120.0), (-30.0, 60.0),
)  # fmt: skip


@dataclass
class Cell:
    """The plant, with an operator who moves the axis and the arm by hand."""

    story: Plant
    axis: ExternalAxis

    async def stands(self, reading: float, at_zero: Array) -> None:
        """The axis at this reading of the controller, and the arm where it sees what it saw at zero from `at_zero`."""
        turn_axis(self.story.cell, self.axis.number, reading)
        await jogs_and_waits(self.story.cell, self.reported(reading, at_zero))

    def reported(self, reading: float, at_zero: Array) -> Array:
        """Where the controller says that the flange stands then."""
        there: Array = inverse(self.axis.motion(reading_of(self.axis.kind, reading))) @ at_zero
        return there

    def within_reach(self, reading: float) -> list[Array]:
        """Poses at zero that see the target, and that the arm reaches at this reading."""
        found = []
        for pose in poses_taught_for(SEED):
            with suppress(UnreachablePoseError):
                self.story.cell.controller.arm.arm.inverse(self.reported(reading, pose.transform()))
                found.append(pose.transform())
        return found


def turn_axis(cell: RunningCell, number: int, to: float) -> None:
    """Move an external axis at the pendant."""
    controller: Any = cell.controller
    controller.unit.external[number - 1] = to
    controller.external_axes = tuple(controller.unit.external)


@asynccontextmanager
async def in_manual_mode(folder: Path, beside: Beside) -> AsyncIterator[Cell]:
    """A cell with the axis as built, which its key switch leaves to the operator, and a daemon that has the drawing."""
    async with plant(
        folder, planned=True, truth=small_pictures(SEED), robot={"external_axis": beside.drawn, "box_mm": WIDE_MM}
    ) as story:
        axis = beside.built()
        memory = story.cell.controller.memory  # type: ignore[attr-defined]
        memory["cell_box_low"].value, memory["cell_box_high"].value = map(list, WIDE_MM)
        story.cell.controller.mounting = Mounting(beside=axis)
        turn_axis(story.cell, axis.number, 0.0)
        story.cell.controller.switch_mode(Mode.MANR, story.cell.cell.clock())
        yield Cell(story, axis)


@pytest.mark.parametrize("beside", [TRACK, TURNTABLE], ids=["track", "turntable"])
async def test_it_is_calibrated_by_hand_and_a_part_comes_out_where_it_is(tmp_path: Path, beside: Beside) -> None:
    async with in_manual_mode(tmp_path, beside) as cell:
        ask, kind = cell.story.operator.client, beside.drawn["kind"]
        refused = (await ask.post("/calibrate")).json()
        assert (refused["code"], "by hand" in refused["fix"]) == ("no-poses", True)
        found = await calibrate(cell, beside)

        point_mm = [await register(cell, reading) for reading in beside.readings]
        print(f"{kind}: points registered at {beside.readings} off by {np.round(point_mm, 2)} mm")
        assert max(point_mm) < found.expanded_mm

        robot = (await ask.get("/robot")).json()
        assert robot["external_axes"][cell.axis.number - 1] == pytest.approx(beside.readings[-1], abs=0.01)

        target_mm = await verify(cell, beside)
        print(f"{kind}: the target verified from the first and the last reading off by {np.round(target_mm, 2)} mm")
        assert max(target_mm) < found.expanded_mm

        part = await scan(cell, beside)
        print(f"{kind}: a part scanned at {beside.scanned_at} off by {part['rms_mm']:.3f} mm RMS,"
              f" 95 % of it within {part['p95_mm']:.3f} mm")  # fmt: skip
        assert part["rms_mm"] < PART_MM


async def calibrate(cell: Cell, beside: Beside) -> FoundAxisDocument:
    """By hand, from three views at each reading; the result is active."""
    ask, kind = cell.story.operator.client, beside.drawn["kind"]
    run = await cell.story.operator.starts("/calibrate", manual=True)
    for reading in beside.readings:
        for pose in cell.within_reach(reading)[:VIEWS_EACH]:
            await cell.stands(reading, pose)
            run = (await ask.post(run["links"]["stations"])).json()
            assert run.get("state") == "waiting", run
    run = (await ask.post(run["links"]["finish"], params={"wait": LIMIT_S})).json()
    assert run["state"] == "finished", run["cause"]
    document = (await cell.story.application.store.current())[1].document
    found = document.external_axis
    assert document.verdict.accepted and found is not None and document.mount_T_camera is not None
    off_deg = np.degrees(np.linalg.norm(np.cross(found.axis().direction, cell.axis.direction)))
    x_mm = score_calibration(cell.story.truth, document.mount_T_camera.transform())["point_rms_mm"]
    print(f"{kind}: {3 * VIEWS_EACH} views; direction off by {off_deg:.4f} deg ({found.off_deg:.2f} from the drawing);"
          f" X maps points {x_mm:.3f} mm off, RMS; U of a registered point {found.expanded_mm:.2f} mm")  # fmt: skip
    assert off_deg < 0.02
    return found


async def register(cell: Cell, reading: float) -> float:
    """How far points before the camera come out from the truth, at most, with the axis at this reading."""
    await cell.stands(reading, cell.within_reach(reading)[-1])
    ask, cloud = cell.story.operator.client, ply_of(POINTS)
    headers = {"content-type": "application/x-ply"}
    answer = await ask.post("/register", params={"pose": "now"}, content=cloud, headers=headers)
    assert answer.status_code == 200, answer.text
    at = {"pose": answer.headers["handeyed-pose"]}
    unread = await ask.post("/register", params=at, content=cloud, headers=headers)
    assert (unread.status_code, "external_axes" in unread.text) == (422, True)
    axes = ",".join([*["0"] * (cell.axis.number - 1), str(reading)])
    given = await ask.post("/register", params={**at, "external_axes": axes}, content=cloud, headers=headers)
    assert np.allclose(points_of(given.content), points_of(answer.content), atol=0.05)
    truth = map_points(
        cell.story.cell.cell.flange_at(cell.story.cell.cell.clock()) @ cell.story.truth.mount_T_scanner, POINTS
    )
    return float(np.linalg.norm(points_of(answer.content) - truth, axis=1).max())


async def verify(cell: Cell, beside: Beside) -> list[float]:
    """How far the target is seen from the truth, from the first and from the last reading."""
    cabinet, now_s, truth, off_mm = cell.story.cell.controller, cell.story.cell.cell.clock, cell.story.truth, []
    cabinet.switch_mode(Mode.AUTO, now_s())
    cabinet.switch_motors(True, now_s())
    cabinet.run_program(True, now_s())
    await cell.story.operator.waits_until_ready()
    for reading in (beside.readings[0], beside.readings[-1]):
        first, *_, last = cell.within_reach(reading)
        await cell.stands(reading, first)
        poses = [PoseDocument.of(cell.reported(reading, pose)).model_dump(mode="json") for pose in (first, last)]
        asked = {"poses": poses}
        run = (await cell.story.operator.client.post("/verify", json=asked, params={"wait": LIMIT_S})).json()
        assert run.get("state") == "finished", run
        points = run["result"]["verification"]["points"]
        seen_mm = np.array([np.mean(point["base_mm"], axis=0) for point in points])
        truth_mm = map_points(truth.base_T_target, truth.target.points_mm[[point["id"] for point in points]])
        off_mm.append(float(np.linalg.norm((seen_mm - truth_mm).mean(axis=0))))
    return off_mm


async def scan(cell: Cell, beside: Beside) -> dict[str, Any]:
    """The score of a part of which the scanner sees one half from one reading, and the other from another."""
    ask, sheet = cell.story.operator.client, cell.story.cell.announcement.sheet
    poses = [TaughtPose.model_validate(pose) for pose in sheet["scan_poses"]]
    links = (await ask.post("/scans", json={"name": "door"})).json()["links"]
    for reading, pose in zip(beside.scanned_at, poses[1:3], strict=True):
        await cell.stands(reading, pose.transform())
        seen = await ask.post(links["views"])
        assert seen.status_code == 201, seen.text
        assert seen.json()["external_axes"][cell.axis.number - 1] == pytest.approx(reading, abs=0.01)
    return score_cloud(cell.story.truth, (await ask.get(links["cloud"])).content)

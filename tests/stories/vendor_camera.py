"""What a story with an industrial camera does: five taught views are calibrated, and points are registered."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibration.transforms import Array, map_points
from mock_robot.truth.score import score_calibration
from mock_robot.truth.truth import CellTruth
from tests.daemon.clouds import PLY
from tests.daemon.fakes import ply_of, points_of
from tests.mock_robot.running_cell import RunningCell
from tests.stories.plant import daemon_for, poses_taught_for
from tests.support.waiting import LIMIT_S

VIEWS = 5
POINT_MM = 0.4
SEEN_MM = np.array([[0.0, 0, 600], [50, -20, 580], [-80, 40, 620]])


@dataclass(frozen=True)
class Figures:
    """`point_mm`: RMS by which a mapped point is off; `registered_mm` (n,): by which registered points are."""

    point_mm: float
    registered_mm: Array
    exposure_us: float | None


async def calibrate_and_register(cell: RunningCell, truth: CellTruth, address: str, folder: Path) -> Figures:
    """Calibrate the cell by the camera at `address` with the poses taught for its seed, and register points."""
    taught = {"poses": poses_taught_for(truth.seed)[:VIEWS]}
    async with daemon_for(cell, folder, camera={"address": address}, calibration=taught) as story:
        ask = story.operator.client
        run = (await ask.post("/calibrate", params={"wait": LIMIT_S})).json()
        assert run["state"] == "finished", run["cause"]
        verdict = (await ask.get(run["links"]["calibration"])).json()["verdict"]
        assert verdict["accepted"], verdict["findings"]
        document = (await story.application.store.current())[1].document
        look = (await ask.get("/camera/look")).json()
        answer = await ask.post("/register", params={"pose": "now"}, content=ply_of(SEEN_MM), headers=PLY)
        expected = map_points(cell.cell.flange_at(cell.cell.clock()) @ truth.mount_T_scanner, SEEN_MM)
        off_mm = np.linalg.norm(points_of(answer.content) - expected, axis=1)
    assert document.mount_T_camera is not None
    point_mm = score_calibration(truth, document.mount_T_camera.transform())["point_rms_mm"]
    print("story: a point off by", round(point_mm, 3), "mm RMS, registered ones by", off_mm.round(3), "mm")
    assert point_mm < POINT_MM
    assert off_mm.max() < 2 * POINT_MM
    return Figures(point_mm, off_mm, look["exposure_us"])

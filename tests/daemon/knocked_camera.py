"""A calibrated cell whose camera can be knocked, and a chart that learns quickly."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from calibration.transforms import Array
from drivers.interfaces import CameraFrame
from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.fakes import FakeCamera, picture_of_the_board

QUICK = {"learn": 2, "runs_between_false_alarms": 1000}


@dataclass
class KnockedCamera(FakeCamera):
    """Somebody's elbow: the camera sits elsewhere on the flange than when it was calibrated."""

    knock: Array = field(default_factory=lambda: np.eye(4))

    async def grab(self, newer_than_s: float) -> CameraFrame:
        frame = await super().grab(newer_than_s)
        return CameraFrame(picture_of_the_board(self.robot.base_T_flange @ self.knock), frame.taken_at_s)


@asynccontextmanager
async def calibrated(folder: Path, **changes: Any) -> AsyncIterator[tuple[Bench, KnockedCamera]]:
    parts = Parts()
    camera = KnockedCamera(parts.robot)
    parts.camera = camera
    settings = settings_for(folder, calibration={"policy": "auto", "tolerance_mm": 20.0}, drift=QUICK, **changes)
    async with serving(settings, parts) as bench:
        run = await bench.run_over((await bench.client.post("/calibrate")).headers["location"])
        assert run["result"]["applied"], run
        yield bench, camera

"""A calibration by hand: who jogs the fake arm, and takes the pictures."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.fakes import poses_around_the_target

POSES = poses_around_the_target(6)
COLUMNS, ROWS = 11, 8
FRAME_PX = 25.0
"""How far the target may be from its frame in a picture 1920 px wide, from the pose of the advice."""


@dataclass
class ByHand:
    """A manual run, and the operator's hand on the joystick."""

    bench: Bench
    run: dict[str, Any]

    def jogs_to(self, base_T_flange: Any) -> None:
        self.bench.robot.base_T_flange = base_T_flange.copy()

    async def takes(self, pose: Any = None) -> httpx.Response:
        if pose is not None:
            self.jogs_to(pose)
        return await self.bench.client.post(self.run["links"]["stations"])

    async def finishes(self, wait: float = 30) -> httpx.Response:
        return await self.bench.client.post(self.run["links"]["finish"], params={"wait": wait})

    async def sees(self) -> dict[str, Any]:
        found: dict[str, Any] = (await self.bench.client.get(self.run["links"]["self"])).json()
        return found


@asynccontextmanager
async def by_hand(folder: Path, parts: Parts | None = None, **calibration: Any) -> AsyncIterator[ByHand]:
    """A manual run that has just begun."""
    settings = settings_for(folder, calibration={"poses": [], **calibration})
    async with serving(settings, parts) as bench:
        started = await bench.client.post("/calibrate", json={"manual": True})
        assert started.status_code == 202, started.text
        assert started.json()["state"] == "waiting"
        yield ByHand(bench, started.json())

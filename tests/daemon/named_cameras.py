"""A cell with a second camera, `wrist`, on the same flange."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx

from calibration.documents.session import CameraDocument
from calibration.transforms import rotation_from_vector, transform
from tests.daemon.cell_under_test import Bench, Parts, pose_json, serving, settings_for
from tests.daemon.fakes import CAMERA, FLANGE_T_CAMERA, FakeCamera, poses_around_the_target
from tests.support.waiting import LIMIT_S

WRIST = FLANGE_T_CAMERA @ transform(rotation_from_vector([0.01, -0.02, 0.3]), [12.0, -7.0, 4.0])


def wrist(**changes: Any) -> dict[str, Any]:
    poses = [pose_json(pose) for pose in poses_around_the_target()]
    return {"address": "http://wrist/frame.png", "intrinsics": CameraDocument.of(CAMERA).model_dump(),
            "calibration": {"poses": poses, "policy": "auto", "tolerance_mm": 20.0}, **changes}  # fmt: skip


@asynccontextmanager
async def two_cameras(folder: Path, **changes: Any) -> AsyncIterator[Bench]:
    parts = Parts()
    parts.cameras["wrist"] = FakeCamera(parts.robot, flange_T_camera=WRIST)
    async with serving(settings_for(folder, cameras={"wrist": wrist()}, **changes), parts) as bench:
        yield bench


async def calibrate(client: httpx.AsyncClient, **body: Any) -> dict[str, Any]:
    run: dict[str, Any] = (await client.post("/calibrate", json=body, params={"wait": LIMIT_S})).json()
    assert run["state"] == "finished", run["cause"]
    return run

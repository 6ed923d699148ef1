"""A whole plant for stories: the mock cell, the daemon, an operator with an HTTP client, joined by real sockets."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.documents.plan import PlanDocument
from calibration.documents.validation import validate_document
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import Arm, UnreachablePoseError
from calibration.planning.plan import plan_poses
from calibration.transforms import Array
from daemon.application import Application
from daemon.cell.devices import open_devices
from daemon.composition import build
from daemon.config.settings import Settings, TaughtPose
from daemon.model.run_states import RunState
from mock_robot.cell import Announcement
from mock_robot.truth.truth import CellTruth
from mock_robot.truth.truth_sheet import cell_sheet
from tests.mock_robot.running_cell import RunningCell, running_cell
from tests.support.serving import serve_for_tests
from tests.support.waiting import LIMIT_S

ANSWER_LIMIT_S = 20.0
"""The mock controller answers at once, but not while its machine is busy with something else."""
TEXT = {"accept": "text/plain"}
OVER = (RunState.FINISHED, RunState.FAILED, RunState.ABORTED)


def small_pictures(seed: int, by: float = 2.0, **others: Any) -> CellTruth:
    """The cell of that seed with `by` times fewer pixels each way: for stories that are not about accuracy."""
    truth = CellTruth.from_seed(seed, **others)
    matrix = truth.camera.matrix / by
    matrix[2, 2], (width, height) = 1.0, truth.camera.image_size
    return replace(truth, camera=CameraModel(matrix, truth.camera.distortion, (round(width / by), round(height / by))))


def robot_address(cell: Announcement) -> str:
    """Over the network, or over the serial line of a cell that has one."""
    if cell.serial_path is not None:
        return f"serial://{cell.serial_path}"
    return f"tcp://{cell.robot_host}:{cell.robot_port}"


def settings_of(cell: Announcement, folder: Path, **changes: Any) -> Settings:
    """What an integrator would write after reading the cell's sheet."""
    sheet = cell.sheet
    sections: dict[str, Any] = {
        "robot": {
            "address": robot_address(cell),
            "model": sheet["arm"],
            "box_mm": sheet["box_mm"],
            "speed_mm_s": 250,
            "limit_s": ANSWER_LIMIT_S,
            "settling": {"gap_s": 0.01, "translation_mm": 0.5, "rotation_deg": 0.05},
        },
        "camera": {
            "address": f"{cell.devices_url}/camera/snapshot.png",
            "setup": sheet["setup"],
            "limit_s": LIMIT_S,
            "intrinsics": sheet["camera"],
        },
        "scanner": {
            "address": f"{cell.devices_url}/scanner/cloud.ply",
            "poses": sheet["scan_poses"],
            "limit_s": LIMIT_S,
        },
        "target": sheet["target"],
        "calibration": {
            **{name: guess for name, guess in sheet.items() if name.endswith("_guess")},
            "policy": "auto",
            "tolerance_mm": 4.0,
        },
        "server": {"port": 0},
        "storage": {"folder": str(folder), "reserve_mb": 0},
    }
    for section, values in changes.items():
        sections[section] = {**sections.get(section, {}), **values}
    return validate_document(Settings, sections, "story settings")


@cache
def poses_taught_for(seed: int) -> tuple[TaughtPose, ...]:
    """Eight poses as an operator would teach them: stories about something else need not wait for the planner."""
    sheet = cell_sheet(CellTruth.from_seed(seed))
    question = PlanDocument.model_validate(
        {
            "schema_version": 1,
            **{key: sheet[key] for key in ("target", "camera", "flange_T_camera_guess", "base_T_target_guess")},
            "limits": {"box_mm": sheet["box_mm"]},
        }
    )
    arm = find_arm(sheet["arm"])

    def reachable(base_T_flange: Array) -> NDArray[np.bool_]:
        return np.array([_has_solution(arm, pose) for pose in base_T_flange], bool)

    plan = plan_poses(question.scene(), question.limits.limits(), 8, reachable=reachable)
    return tuple(TaughtPose.of(pose) for pose in plan.base_T_flange)


def _has_solution(arm: Arm, base_T_flange: Array) -> bool:
    try:
        arm.inverse(base_T_flange)
    except UnreachablePoseError:
        return False
    return True


@dataclass
class Operator:
    """Somebody with an HTTP client."""

    client: httpx.AsyncClient

    async def starts(self, path: str, **body: Any) -> dict[str, Any]:
        answer = await self.client.post(path, json=body)
        assert answer.status_code == 202, answer.text
        run: dict[str, Any] = answer.json()
        return run

    async def sees(self, run: dict[str, Any]) -> dict[str, Any]:
        found: dict[str, Any] = (await self.client.get(run["links"]["self"])).json()
        return found

    async def waits_for_the_end_of(self, run: dict[str, Any], within_s: float = LIMIT_S) -> dict[str, Any]:
        ended: dict[str, Any] = (await self.client.get(run["links"]["self"], params={"wait": within_s})).json()
        assert ended["over"], ended
        return ended

    async def waits_until_station(self, run: dict[str, Any], station: int, within_s: float = LIMIT_S) -> None:
        """Listens to the events, as a page would."""
        async with (
            asyncio.timeout(within_s),
            self.client.stream("GET", "/events", headers={"last-event-id": "0"}) as events,
        ):
            async for line in events.aiter_lines():
                if line.startswith("data:") and f'"station": {station},' in line and run["id"] in line:
                    return
                _require_in_progress(line, run)

    async def waits_until(self, run: dict[str, Any], state: str, station: int, within_s: float = LIMIT_S) -> None:
        """Listens to the events until the run is in that state, with so many stations done."""
        async with (
            asyncio.timeout(within_s),
            self.client.stream("GET", "/events", headers={"last-event-id": "0"}) as events,
        ):
            async for line in events.aiter_lines():
                told = f'"state": "{state}", "station": {station},'
                if line.startswith("data:") and told in line and run["id"] in line:
                    return
                _require_in_progress(line, run)

    async def waits_until_ready(self, within_s: float = LIMIT_S) -> None:
        """The devices are dialled in the background."""
        async with asyncio.timeout(within_s):
            while not (await self.client.get("/ready")).json()["calibrate"]["ready"]:  # noqa: ASYNC110 - it happens behind HTTP
                await asyncio.sleep(0.02)


def _require_in_progress(line: str, run: dict[str, Any]) -> None:
    """Fail when the event is the end of the run: what a test waits for cannot come any more."""
    ended = any(f'"state": "{state}"' in line for state in OVER)
    assert not (ended and line.startswith("data:") and run["id"] in line), line


@dataclass
class Plant:
    """The three of them."""

    cell: RunningCell
    application: Application
    operator: Operator
    folder: Path
    url: str

    @property
    def truth(self) -> CellTruth:
        return self.cell.truth


@asynccontextmanager
async def daemon_for(cell: RunningCell, folder: Path, **changes: Any) -> AsyncIterator[Plant]:
    """The daemon beside a cell that runs already."""
    application = build(settings_of(cell.announcement, folder, **changes), open_devices)
    async with (
        serve_for_tests(application) as served,
        httpx.AsyncClient(base_url=served.url, verify=False, timeout=2 * LIMIT_S) as client,
    ):
        operator = Operator(client)
        await operator.waits_until_ready()
        yield Plant(cell, application, operator, folder, served.url)


@asynccontextmanager
async def plant(
    folder: Path,
    *,
    seed: int = 7,
    time_scale: float = 100.0,
    planned: bool = False,
    truth: CellTruth | None = None,
    serial: bool = False,
    **changes: Any,
) -> AsyncIterator[Plant]:
    """Cell and daemon from nothing. `planned`: no poses are taught; `serial`: the robot is on a serial line."""
    if not planned:
        changes["calibration"] = {"poses": poses_taught_for(seed), **changes.get("calibration", {})}
    async with (
        running_cell(seed, time_scale, truth=truth, serial=serial) as cell,
        daemon_for(cell, folder, **changes) as running,
    ):
        yield running

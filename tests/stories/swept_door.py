"""A door and a line profiler that sweeps over it at 100 mm/s: mock and daemon joined by sockets, in a moved time.

The robot's poses come over the CB link, the profiles over the sensor's own protocol with a clock of its own.
"""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibration.documents.pose import PoseDocument
from calibration.kinematics.arm import UnreachablePoseError
from calibration.transforms import Array, inverse, map_points, transform
from daemon.application import Application
from daemon.cell.devices import open_devices
from daemon.composition import build
from daemon.runtime.clock import Clock
from drivers.interfaces import PoseReading
from drivers.scanners.gocator_profiler import GocatorProfiler
from extensions.sweeps.recorder import Sweep
from extensions.sweeps.service import SweepService
from mock_robot.cell import MockCell, Ports
from mock_robot.devices.profiler import SENSOR_AHEAD_S
from mock_robot.scene.part import DOOR
from mock_robot.truth.truth import CellTruth
from tests.daemon.calibrations import document_with_covariance
from tests.simulated.door_sweeps import base_T_profiler_before_door
from tests.stories.plant import settings_of
from tests.support.serving import serve_for_tests
from tests.support.waiting import eventually

SPEED_MM_S = 100.0
STEP_S = 0.04
HALF_TURN = transform(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))


@dataclass
class SweptCell:
    """Mock and daemon, and the clock of both."""

    truth: CellTruth
    now_s: float = 100.0

    def __post_init__(self) -> None:
        self.mock = MockCell(self.truth, clock=lambda: self.now_s)
        self.application: Application
        self._reading = asyncio.Lock()

    @property
    def sensor(self) -> GocatorProfiler:
        found = self.application.cell.links()["scanner"]
        assert isinstance(found, GocatorProfiler)
        return found

    def let_no_time_pass_while_a_pose_is_read(self) -> None:
        """A busy machine would make the poses of a time that the test moves as uncertain as a step of it."""
        robot = self.application.cell.robot
        read_pose = robot.read_pose

        async def read_at_one_time() -> PoseReading:
            async with self._reading:
                return await read_pose()

        robot.read_pose = read_at_one_time  # type: ignore[method-assign]

    async def pass_time(self, duration_s: float) -> None:
        """Step by step; at each the daemon sees what the arm and the sensor did."""
        sweeps = self.application.service(SweepService)
        for _ in range(round(duration_s / STEP_S)):
            async with self._reading:
                self.now_s = round(self.now_s + STEP_S, 6)
            stamped_s = self.now_s + SENSOR_AHEAD_S - 1e-6
            await eventually(lambda: self.sensor._clock._stamp_s >= stamped_s)  # noqa: B023 - awaited at once
            recorder = sweeps._recorder
            if recorder is not None and recorder.sweep.state == "running":
                await eventually(
                    lambda: recorder._last_pose_s >= self.now_s or recorder.sweep.state != "running"  # noqa: B023
                )

    async def sweep(self, y: float, x_begin: float, x_end: float) -> Sweep:
        """One straight move along the door at height y, from one x to another."""
        arm = self.mock.controller.arm
        begin, end = self._joints(y, x_begin, x_end)
        arm.jog(begin, 1.0, self.mock.controller.robot_s(self.now_s))
        await self.pass_time(1.2)
        document = document_with_covariance()
        x = PoseDocument.of(self.truth.flange_T_scanner)
        sweep = await self.application.service(SweepService).begin(document.model_copy(update={"flange_T_camera": x}))
        await self.pass_time(0.2)
        assert arm.depart(end, SPEED_MM_S, True, self.mock.controller.robot_s(self.now_s)) == 1.0
        await self.pass_time(abs(x_end - x_begin) / SPEED_MM_S + 0.4)
        ending = asyncio.create_task(self.application.service(SweepService).end(sweep.id))
        await self.pass_time(2 * STEP_S)
        return await ending

    def _joints(self, y: float, x_begin: float, x_end: float) -> tuple[Array, Array]:
        arm = self.mock.controller.arm.arm
        for turn in (np.eye(4), HALF_TURN):
            first, last = (
                base_T_profiler_before_door(self.truth, x, y) @ turn @ inverse(self.truth.nominal.mount_T_camera)
                for x in (x_begin, x_end)
            )
            try:
                begin = min(arm.inverse(first), key=lambda joints: float(np.abs(joints).max()))
                return begin, arm.nearest(last, begin)
            except UnreachablePoseError:
                continue
        raise AssertionError("the arm cannot sweep there")

    def distances_mm(self, sweep: Sweep) -> Array:
        """Of every tenth point from the true skin."""
        points = np.fromfile(sweep.file, "<f4").reshape(-1, 3)[::10]
        return np.asarray(DOOR.deviation(map_points(inverse(self.truth.base_T_part), points)))


@asynccontextmanager
async def swept_cell(folder: Path) -> AsyncIterator[SweptCell]:
    cell = SweptCell(CellTruth.from_seed(1))
    announcement = await cell.mock.start(Ports(profiler=0))
    try:
        settings = settings_of(announcement, folder, scanner={"address": announcement.profiler, "poses": []})
        cell.application = build(settings, open_devices, clock=Clock(monotonic_s=lambda: cell.now_s))
        async with serve_for_tests(cell.application):
            await eventually(lambda: all(link.link.connected for link in cell.application.cell.links().values()))
            cell.let_no_time_pass_while_a_pose_is_read()
            yield cell
    finally:
        await cell.mock.close()

"""Sweeps of line profilers: begun and ended by a request while somebody else moves the arm; one at a time."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from calibration.documents.calibration import CalibrationDocument
from calibration.transforms import Array
from daemon.cell.cell import Cell
from daemon.cell.settling import check_external_axes
from daemon.config.settings import MAIN_SCANNER
from daemon.errors import CellNotReady, NoScanner, NotFound
from daemon.model.records import FlangePose
from daemon.runtime.clock import Clock
from daemon.runtime.durable_files import make_folder
from daemon.runtime.tasks import Service
from daemon.runtime.workers import Workers
from daemon.scans.scan_service import TRANSIT_FOLDER, ScanService
from daemon.store.database import storage_errors
from daemon.store.store import Store
from drivers.interfaces import PathRecorder, PoseReading, ProfileSource, Robot
from extensions.sweeps.errors import NoProfiler
from extensions.sweeps.mathematics.assembler import SweepAssembler
from extensions.sweeps.recorder import Sweep, SweepRecorder

KEPT = 8
"""Sweeps whose points can be fetched; older ones are deleted, and all when the daemon starts."""


@dataclass(frozen=True, eq=False)
class PathBesideAxis:
    """A recorder whose poses are moved by `motion` (1, 4, 4) of an external axis, which stands as it did `first`."""

    path: PathRecorder
    robot: Robot
    first: PoseReading
    motion: Array

    async def read(self) -> tuple[Array, Array]:
        """As the recorder. Raises NotStill when the axis has moved."""
        times_s, poses = await self.path.read()
        check_external_axes(self.first.external_axes, (await self.robot.read_pose()).external_axes)
        return times_s, self.motion @ poses


@dataclass(eq=False)
class SweepService(Service):
    """Stopping it ends the sweep."""

    cell: Cell
    store: Store
    scans: ScanService
    workers: Workers
    clock: Clock
    new_id: Callable[[], str]
    _sweeps: dict[str, Sweep] = field(default_factory=dict)
    _recorder: SweepRecorder | None = None
    _task: "asyncio.Task[None] | None" = None

    async def stop(self) -> None:
        """Break off the sweep that runs."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def begin(self, calibration: CalibrationDocument, scanner: str = MAIN_SCANNER) -> Sweep:
        """Begin a sweep; it runs in the background until `end`, or the first error.

        Raises NoScanner, NoProfiler, CellNotReady, CellBusy, CalibrationUnusable, StorageError.
        """
        settings = self.scans.settings_of(scanner)
        source = self.cell.links().get(scanner)
        if source is None or settings is None:
            raise NoScanner
        if not isinstance(source, ProfileSource):
            raise NoProfiler(scanner)
        reasons = self.cell.sensor_obstacles(("robot", scanner))
        if reasons:
            raise CellNotReady(reasons)
        offset_s = settings.clock_offset_s
        assembler = SweepAssembler(self.scans.flange_T_scanner(calibration, scanner), offset_s)
        await self.store.require_ready()
        folder = self.store.folder / "scans" / TRANSIT_FOLDER
        with storage_errors(folder):
            await self.workers.run(make_folder, folder)
        sweep_id = self.new_id()
        file = folder / f"merged-sweep-{sweep_id}.f32"
        sweep = Sweep(sweep_id, self.clock.timestamp(), scanner, calibration.id, file)
        recorder = SweepRecorder(
            sweep,
            source,
            partial(self._open_path, calibration),
            assembler,
            self._has_room,
            offset_s,
            self.clock,
            self.workers,
        )
        hold = self.cell.hold(f"sweep {sweep_id}")
        await hold.__aenter__()

        async def run_and_release() -> None:
            try:
                await recorder.run()
            finally:
                await hold.__aexit__(None, None, None)

        self._recorder, self._sweeps[sweep_id] = recorder, sweep
        self._task = asyncio.create_task(run_and_release(), name=f"sweep {sweep_id}")
        while len(self._sweeps) > KEPT:
            oldest = self._sweeps.pop(next(iter(self._sweeps)))
            with suppress(OSError):
                await self.workers.run(oldest.file.unlink, missing_ok=True)
        return sweep

    async def _open_path(self, calibration: CalibrationDocument) -> PathRecorder:
        """The flange's path, with the calibration's external axis at its zero. Raises DeviceError, DocumentError."""
        path = await self.cell.record_path()
        if calibration.external_axis is None:
            return path
        first = await self.cell.robot.read_pose()
        motion = calibration.external_axis.place(np.eye(4)[None], [FlangePose.of(first).stance])
        return PathBesideAxis(path, self.cell.robot, first, motion)

    def get(self, sweep_id: str) -> Sweep:
        """Raises NotFound."""
        try:
            return self._sweeps[sweep_id]
        except KeyError:
            what = f"there is no sweep {sweep_id!r}; the last {KEPT} are kept, until the daemon ends"
            raise NotFound(what, "begin one with POST /sweeps") from None

    async def end(self, sweep_id: str) -> Sweep:
        """End a sweep, and wait until all points are there; one that is over stays as it is. Raises NotFound."""
        sweep = self.get(sweep_id)
        if self._recorder is not None and self._recorder.sweep is sweep and self._task is not None:
            self._recorder.end()
            await asyncio.wait([self._task])
        return sweep

    def _has_room(self) -> bool:
        return self.store.free_bytes() >= self.store.run_bytes

"""Several sensors of one mount in one calibration run: each looks from every station, and all are solved together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calibration.documents.arm_conditions import LoadDocument
from calibration.documents.pose import PoseDocument
from calibration.documents.rig import RigDocument, rig_document
from calibration.documents.session import SessionDocument, ViewDocument
from calibration.documents.target import TargetDocument
from calibration.errors import CalibrationError
from calibration.problem import Problem, Setup
from calibration.solution import Solution
from calibration.verdict import VerdictLimits
from daemon.cell.cell import Cell
from daemon.config.settings import NamedScannerSettings
from daemon.errors import CalibrationUnusable
from daemon.runs.calibration_run import CalibrationRun
from daemon.runs.pose_sequence import PoseSequence
from daemon.runs.run_log import RunLog, RunResult
from daemon.scans.rig_sensors import RigSensors
from daemon.scans.upload import SUFFIXES
from daemon.sessions.session_files import SESSION_FILE
from daemon.sessions.session_reader import load_problem, open_session
from daemon.sessions.session_writer import SensorBeside, SessionWriter
from daemon.store.store import Store
from drivers.errors import DeviceError
from drivers.interfaces import PoseReading


@dataclass(frozen=True, eq=False)
class CameraBeside:
    """A further camera of the run: the cell through it, and its session."""

    cell: Cell
    session: SessionWriter

    async def look(self, reading: PoseReading, at: str) -> None:
        """Store what it sees from where the arm stands. Raises NotStill, DeviceError, StorageError."""
        await self.session.add(await self.cell.capture_frame(reading), reading, at)


@dataclass(eq=False)
class ScannerBeside:
    """A scanner of the run whose organised clouds show the target, and its session in the folder of its name."""

    name: str
    settings: NamedScannerSettings
    cell: Cell
    store: Store
    run_id: str
    setup: Setup
    target: TargetDocument
    _views: list[ViewDocument] = field(default_factory=list, init=False)

    async def look(self, reading: PoseReading, at: str) -> None:
        """Store what it sees from where the arm stands. Raises NoScanner, NotStill, DeviceError, StorageError."""
        cloud = await self.cell.capture_cloud(reading, self.name)
        folder = self.store.folder_beside(self.run_id, self.name)
        file = f"view_{len(self._views):03d}{SUFFIXES[cloud.media_type]}"
        await self.store.write_file(folder / file, [cloud.content])
        joints = None if reading.joints_rad is None else tuple(np.degrees(reading.joints_rad).round(6).tolist())
        pose, conditions = PoseDocument.of(reading.base_T_flange), self.cell.arm.conditions()
        view = ViewDocument(
            base_T_flange=pose, joints_deg=joints, arm_temperature_c=conditions.temperature_c, cloud=file,
            unit=self.settings.unit,
        )  # fmt: skip
        self._views.append(view)
        document = SessionDocument(
            schema_version=1, source=f"{self.name}, run {self.run_id}, {at}", poses_from_controller=True,
            setup=self.setup, target=self.target, load=LoadDocument.of(conditions.load), views=self._views,
        )  # fmt: skip
        await self.store.write_file(folder / SESSION_FILE, [document.model_dump_json(indent=1).encode()])


@dataclass(frozen=True, eq=False)
class LookBeside:
    """A sensor beside the camera: a look that its device refuses is noted in the run's log, and fails nothing else."""

    name: str
    sensor: SensorBeside
    log: RunLog

    async def look(self, reading: PoseReading, at: str) -> None:
        """Store what it sees, or note why it sees nothing. Raises NoScanner, NotStill, StorageError."""
        try:
            await self.sensor.look(reading, at)
        except DeviceError as error:
            self.log.missed.setdefault(self.name, []).append(str(error))


@dataclass(frozen=True, eq=False)
class TogetherRun:
    """A calibration run of several sensors on one mount: each camera alone, then all in one estimate.

    `cameras`: how each further camera is calibrated, by its name; `scanners`: names of the scanners.
    """

    main: CalibrationRun
    cameras: Mapping[str, CalibrationRun]
    scanners: Sequence[str]
    rigs: RigSensors

    async def drive(self, sequence: PoseSequence, log: RunLog) -> RunResult:
        """Run the sequence, and store a calibration of each camera, and the rig, active when it is accepted.

        A sensor that cannot be calibrated, and a rig that is refused, are named in the result and fail nothing else;
        one that is calibrated without some of its looks is named in `missed`.
        """
        event, result = await self.main.drive(sequence, log)
        together: dict[str, Any] = {"calibrations": {}, "rig_id": None, "refused": {}, "missed": {}}
        for name, run in self.cameras.items():
            try:
                together["calibrations"][name] = await self._calibrate(name, run, log)
            except CalibrationError as error:
                together["refused"][name] = str(error)
        problems, alone, refused = await self.main.workers.run(self.solve_each, log.id)
        together["refused"] = refused | together["refused"]
        for name, reasons in log.missed.items():
            if name in alone:
                together["missed"][name] = f"{len(reasons)} of {log.run.stations} looks failed, the last: {reasons[-1]}"
            else:
                together["refused"][name] = reasons[-1]
        try:
            rig = await self.main.workers.run(self._solve, problems, alone)
            together["rig"] = rig.verdict.model_dump(mode="json")
            record = await self.rigs.save(rig, log.id, despite_verdict=False)
            together["rig_id"] = record.id
        except (CalibrationError, CalibrationUnusable) as error:
            together["refused"]["rig"] = str(error)
        assert result is not None
        return event, {**result, "together": together}

    async def _calibrate(self, name: str, run: CalibrationRun, log: RunLog) -> dict[str, Any]:
        """Solve one camera's session, and store its calibration. Raises CalibrationError, StorageError."""
        problem = await run.workers.run(self._problem, log.id, name)
        at = run.clock.timestamp()
        return await run.keep(await run.workers.run(run.solve, problem, f"{log.id}-{name}", at), log.id)

    def _problem(self, run_id: str, name: str) -> Problem:
        store = self.main.store
        folder = store.run_folder(run_id) if name == self.main.camera else store.folder_beside(run_id, name)
        return load_problem(open_session(folder))

    def solve_each(self, run_id: str) -> tuple[dict[str, Problem], dict[str, Solution], dict[str, str]]:
        """The session and solution of each sensor alone, and why the others have none."""
        from calibration.solve import solve_hand_eye  # see run_modules

        problems: dict[str, Problem] = {}
        alone: dict[str, Solution] = {}
        refused: dict[str, str] = {}
        for name in (self.main.camera, *self.cameras, *self.scanners):
            try:
                problem = self._problem(run_id, name)
                alone[name], problems[name] = solve_hand_eye(problem), problem
            except CalibrationError as error:
                refused[name] = str(error)
        return problems, alone, refused

    def _solve(self, problems: dict[str, Problem], alone: dict[str, Solution]) -> RigDocument:
        """The joint solution of these sessions. Raises CalibrationError."""
        from calibration.solve import solve_rig  # see run_modules

        limits: VerdictLimits = self.main.limits
        return rig_document(solve_rig(problems), alone, limits.tolerance_mm)

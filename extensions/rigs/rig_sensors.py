"""The sensors of a rig, by name: solved together in one calibration run, stored, and placed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calibration.documents.arm_conditions import LoadDocument
from calibration.documents.calibration import errors_of
from calibration.documents.pose import PoseDocument
from calibration.documents.rig import RigDocument
from calibration.documents.session import SessionDocument, ViewDocument
from calibration.documents.target import TargetDocument
from calibration.errors import CalibrationError, DocumentError, DocumentProblem
from calibration.problem import MOUNTS, Problem
from calibration.sentences.sentence import Sentence
from calibration.solution import Solution
from calibration.transforms import Array
from daemon.cell.cell import Cell
from daemon.config.settings import NamedScannerSettings
from daemon.errors import CalibrationUnusable, NoScanner, NotFound
from daemon.model.requests import CalibrateRequest
from daemon.operations import DriveAll, Operations
from daemon.runs.calibration_run import CalibrationRun
from daemon.runs.pose_sequence import PoseSequence
from daemon.runs.run_log import RunLog, RunResult
from daemon.runs.run_sessions import Drive, OpenBeside
from daemon.scans.upload import SUFFIXES
from daemon.sessions.session_files import SESSION_FILE
from daemon.sessions.session_reader import load_problem, open_session
from daemon.sessions.session_writer import SensorBeside, SessionWriter
from daemon.store.actor import current_audit_context
from daemon.store.documents import DocumentKind, DocumentRecord
from drivers.errors import DeviceError
from drivers.interfaces import PoseReading

STORED_RIGS = DocumentKind("rigs", "rig", "setup")


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
    main: Operations
    run_id: str
    target: TargetDocument
    _views: list[ViewDocument] = field(default_factory=list, init=False)

    async def look(self, reading: PoseReading, at: str) -> None:
        """Store what it sees from where the arm stands. Raises NoScanner, NotStill, DeviceError, StorageError."""
        cell, store = self.main.cell, self.main.store
        cloud = await cell.capture_cloud(reading, self.name)
        folder = store.folder_beside(self.run_id, self.name)
        file = f"view_{len(self._views):03d}{SUFFIXES[cloud.media_type]}"
        await store.write_file(folder / file, [cloud.content])
        joints = None if reading.joints_rad is None else tuple(np.degrees(reading.joints_rad).round(6).tolist())
        pose, conditions = PoseDocument.of(reading.base_T_flange), cell.arm.conditions()
        view = ViewDocument(
            base_T_flange=pose, joints_deg=joints, arm_temperature_c=conditions.temperature_c, cloud=file,
            unit=self.settings.unit,
        )  # fmt: skip
        self._views.append(view)
        document = SessionDocument(
            schema_version=1, source=f"{self.name}, run {self.run_id}, {at}", poses_from_controller=True,
            setup=self.main.settings.camera.setup, target=self.target,
            load=None if conditions.load is None else LoadDocument(**vars(conditions.load)), views=self._views,
        )  # fmt: skip
        await store.write_file(folder / SESSION_FILE, [document.model_dump_json(indent=1).encode()])


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
    rigs: "RigSensors"

    async def drive(self, sequence: PoseSequence, log: RunLog) -> RunResult:
        """Run the sequence, and store a calibration of each camera, and the rig, active when it is accepted.

        A sensor that cannot be calibrated, and a rig that is refused, are named in the result and fail nothing else;
        one that is calibrated without some of its looks is named in `missed`.
        """
        result = await self.main.drive(sequence, log)
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
            record = await self.rigs.save(rig, log.id)
            together["rig_id"] = record.id
        except (CalibrationError, CalibrationUnusable) as error:
            together["refused"]["rig"] = str(error)
        return {**result, "together": together}

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
        from extensions.rigs.mathematics.report import rig_document  # see run_modules
        from extensions.rigs.mathematics.rig import solve_rig

        return rig_document(solve_rig(problems), alone, self.main.limits.tolerance_mm)


@dataclass(frozen=True)
class RigSensors:
    """`FurtherSensors` of a camera, whose are the `operations`: those of its rig. The newest rig stored is active."""

    operations: Operations

    def join(self, request: CalibrateRequest, target: TargetDocument) -> tuple[OpenBeside, DriveAll]:
        """As `FurtherSensors.join`. Raises NotFound, CalibrationUnusable; what it returns first, NoScanner."""
        main, names = self.operations, request.together or ()
        setup = main.settings.camera.setup
        for name in names:
            own = main.others[name].settings.camera.setup if name in main.others else setup
            if name not in main.others:
                main.scans.settings_of(name)
            if name == main.camera or names.count(name) > 1:
                raise CalibrationUnusable(f"{name} is named twice", "name each sensor once")
            if own != setup:
                what = f"{name} is {own}, {main.camera} is {setup}"
                raise CalibrationUnusable(what, "solve sensors together that are on one mount")

        def beside(name: str, log: RunLog) -> SensorBeside:
            if (other := main.others.get(name)) is not None:
                lens = other.settings.camera.intrinsics
                writer = other.sessions.open("calibration", log, target, lens, sensor=name)
                return CameraBeside(other.cell, writer)
            if (settings := main.scans.settings_of(name)) is None:
                raise NoScanner
            return ScannerBeside(name, settings, main, log.id, target)

        def drive(run: CalibrationRun) -> Drive:
            others = {name: main.others[name] for name in names if name in main.others}
            cameras = {name: other.calibration_run(request, compared=False) for name, other in others.items()}
            return TogetherRun(run, cameras, [name for name in names if name not in others], self).drive

        return lambda log: [LookBeside(name, beside(name, log), log) for name in names], drive

    async def save(self, rig: RigDocument, new_id: str, *, despite_verdict: bool = False) -> DocumentRecord:
        """Store a rig and activate it. Raises DocumentError, CalibrationUnusable, StorageError."""
        setup = self.operations.settings.camera.setup
        if rig.setup != setup:
            what = Sentence("rig-of-other-setup", given=rig.setup, setup=setup)
            raise CalibrationUnusable(what, Sentence("solve-sensors-together"))
        _check(rig)
        if not (rig.verdict.accepted or despite_verdict):
            what = Sentence("rig-not-accepted", why=errors_of(rig.verdict.findings))
            raise CalibrationUnusable(what, Sentence("solve-rig-or-despite"))
        at, actor = self.operations.clock.timestamp(), current_audit_context().actor
        record = DocumentRecord(new_id, rig.setup, at, actor, rig.model_dump_json())
        await self.operations.store.documents(STORED_RIGS).save(
            record, **({} if rig.verdict.accepted else {"despite_verdict": True})
        )
        return record

    async def base_T_sensor(self, name: str, base_T_flange: Array) -> tuple[str, Array]:
        """Id of the active rig, and the pose (4, 4) of one of its sensors. Raises NotFound, StorageError."""
        setup = self.operations.settings.camera.setup
        newest = await self.operations.store.documents(STORED_RIGS).about(setup, 1)
        if not newest:
            raise NotFound(Sentence("no-active-rig"), Sentence("store-rig"))
        rig = newest[0].parsed(RigDocument)
        poses = {sensor.name: sensor.mount_T_sensor for sensor in rig.sensors}
        if name not in poses:
            raise NotFound(Sentence("rig-without-sensor", name=name), Sentence("choose-one-of", names=list(poses)))
        mount_T_sensor = poses[name].transform()
        return newest[0].id, base_T_flange @ mount_T_sensor if setup == "eye-in-hand" else mount_T_sensor


def _check(rig: RigDocument) -> None:
    """Raises DocumentError for a rig whose sensors a name would not tell apart, or of another mount."""
    problems = []
    names = [sensor.name for sensor in rig.sensors]
    if not names or len(set(names)) < len(names):
        what = "two have the same name" if names else "there is none"
        problems.append(DocumentProblem("sensors", what, "give each sensor a name of its own"))
    if rig.mount != MOUNTS[rig.setup]:
        what = f"{rig.mount!r}, but sensors of {rig.setup} are on the {MOUNTS[rig.setup]}"
        problems.append(DocumentProblem("mount", what, "send rig.json as it was solved"))
    if problems:
        raise DocumentError("request body", problems)

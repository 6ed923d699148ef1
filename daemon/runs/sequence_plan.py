"""The plan of a run that takes its views along one sequence of poses, into a session of its own."""

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from calibration.documents.external_axis import ExternalAxisDocument
from calibration.documents.session import AxisOffsetDocument, CameraDocument
from calibration.documents.target import TargetDocument
from calibration.kinematics.arm_conditions import ArmConditions
from calibration.problem import Setup
from daemon.runs.pose_sequence import PoseSequence
from daemon.runs.run_log import RunLog
from daemon.runs.supervisor import RunPlan, RunResult
from daemon.runtime.workers import Workers
from daemon.sessions.session_writer import SensorBeside, SessionWriter
from daemon.store.store import Store

MakeSequence = Callable[[SessionWriter, RunLog], PoseSequence]
OpenSession = Callable[[RunLog], SessionWriter]
OpenBeside = Callable[[RunLog], Sequence[SensorBeside]]
Drive = Callable[[PoseSequence, RunLog], Awaitable[RunResult]]


def plan_sequence(stations: int, sequence: MakeSequence, session: OpenSession, drive: Drive) -> RunPlan:
    """A run of so many stations, which opens its session when it begins."""

    async def drive_sequence(log: RunLog) -> RunResult:
        return await drive(sequence(session(log), log), log)

    return RunPlan(stations, drive_sequence)


@dataclass(frozen=True)
class RunSessions:
    """Prepares the session folders of runs with one camera. `conditions`: of the arm now."""

    store: Store
    workers: Workers
    setup: Setup
    external_axis: ExternalAxisDocument | None = None
    conditions: Callable[[], ArmConditions] = ArmConditions

    def prepare(
        self,
        kind: str,
        target: TargetDocument,
        camera: CameraDocument | None,
        beside: OpenBeside = lambda log: (),
        axis_offset: AxisOffsetDocument | None = None,
    ) -> OpenSession:
        """A function that opens the session folder of a run; `beside`: opens those of the sensors beside the camera."""

        def open_session(log: RunLog) -> SessionWriter:
            folder, source = self.store.run_folder(log.id), f"{kind} run {log.id}"
            return self._writer(folder, source, target, camera, beside(log), axis_offset)

        return open_session

    def open_beside(
        self, name: str, target: TargetDocument, camera: CameraDocument | None, log: RunLog
    ) -> SessionWriter:
        """The session of this camera in a calibration run of another one, in the folder of its name."""
        folder, source = self.store.folder_beside(log.id, name), f"calibration run {log.id}, {name}"
        return self._writer(folder, source, target, camera)

    def _writer(
        self,
        folder: Path,
        source: str,
        target: TargetDocument,
        camera: CameraDocument | None,
        beside: Sequence[SensorBeside] = (),
        axis_offset: AxisOffsetDocument | None = None,
    ) -> SessionWriter:
        intrinsics = None if camera is None else CameraDocument.of(camera.camera())
        return SessionWriter(
            folder, source, self.setup, target, intrinsics, self.store, self.workers, beside, axis_offset,
            self.external_axis, self.conditions,
        )  # fmt: skip

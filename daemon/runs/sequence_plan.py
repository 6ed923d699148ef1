"""The plan of a run that takes its views along one sequence of poses, into a session of its own."""

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from calibration.documents.knowledge import KnowledgeDocument, NoiseBeliefDocument
from calibration.documents.session import CameraDocument, SessionDocument
from calibration.documents.target import TargetDocument
from calibration.kinematics.robot_accuracy import USUAL_BELIEF, NoiseBelief
from calibration.problem import AxisOffset, Setup
from daemon.cell.arm_in_cell import ArmInCell
from daemon.runs.pose_sequence import PoseSequence
from daemon.runs.run_log import RunLog, RunResult
from daemon.runs.supervisor import RunPlan
from daemon.runtime.workers import Workers
from daemon.sessions.session_writer import SensorBeside, SessionWriter
from daemon.store.store import Store

MakeSequence = Callable[[SessionWriter, RunLog], PoseSequence]
OpenSession = Callable[[RunLog], SessionWriter]
OpenBeside = Callable[[RunLog], Sequence[SensorBeside]]
Drive = Callable[[PoseSequence, RunLog], Awaitable[RunResult]]


def plan_sequence(stations: int, sequence: MakeSequence, session: OpenSession, drive: Drive) -> RunPlan:
    """A run of so many stations, which opens its session when it begins."""
    return RunPlan(stations, lambda log: drive(sequence(session(log), log), log))


@dataclass(frozen=True)
class RunSessions:
    """Prepares the session folders of runs with one camera. `known`: beforehand."""

    store: Store
    workers: Workers
    setup: Setup
    arm: ArmInCell
    known: KnowledgeDocument = field(default_factory=KnowledgeDocument)

    def prepare(
        self,
        kind: str,
        target: TargetDocument,
        camera: CameraDocument | None,
        beside: OpenBeside = lambda log: (),
        axis_offset: AxisOffset | None = None,
        robot_noise: NoiseBelief = USUAL_BELIEF,
    ) -> OpenSession:
        """A function that opens the session folder of a run; `beside`: opens those of the sensors beside the camera."""

        def open_session(log: RunLog) -> SessionWriter:
            folder, source = self.store.run_folder(log.id), f"{kind} run {log.id}"
            return self._writer(folder, source, target, camera, beside(log), axis_offset, robot_noise)

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
        axis_offset: AxisOffset | None = None,
        robot_noise: NoiseBelief = USUAL_BELIEF,
    ) -> SessionWriter:
        head = SessionDocument(
            schema_version=1, source=source, poses_from_controller=True, setup=self.setup, target=target,
            camera=None if camera is None else CameraDocument.of(camera.camera()), axis_offset=axis_offset,
            external_axis=self.arm.declared, known=self.known, robot_noise=NoiseBeliefDocument.of(robot_noise),
            views=[],
        )  # fmt: skip
        return SessionWriter(folder, head, self.store, self.workers, self.arm, beside)

"""The session folders of runs that take their views along one sequence of poses."""

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field

from calibration.documents.knowledge import KnowledgeDocument, NoiseBeliefDocument
from calibration.documents.session import CameraDocument, SessionDocument
from calibration.documents.target import TargetDocument
from calibration.kinematics.robot_accuracy import USUAL_BELIEF, NoiseBelief
from calibration.problem import AxisOffset, Setup
from daemon.cell.arm_in_cell import ArmInCell
from daemon.runs.pose_sequence import PoseSequence
from daemon.runs.run_log import RunLog, RunResult
from daemon.runtime.workers import Workers
from daemon.sessions.session_writer import SensorBeside, SessionWriter
from daemon.store.store import Store

MakeSequence = Callable[[SessionWriter, RunLog], PoseSequence]
OpenBeside = Callable[[RunLog], Sequence[SensorBeside]]
Drive = Callable[[PoseSequence, RunLog], Awaitable[RunResult]]


@dataclass(frozen=True)
class RunSessions:
    """Opens the session folders of runs with one camera. `known`: beforehand."""

    store: Store
    workers: Workers
    setup: Setup
    arm: ArmInCell
    known: KnowledgeDocument = field(default_factory=KnowledgeDocument)

    def open(
        self,
        kind: str,
        log: RunLog,
        target: TargetDocument,
        camera: CameraDocument | None,
        *,
        sensor: str | None = None,
        beside: Sequence[SensorBeside] = (),
        axis_offset: AxisOffset | None = None,
        robot_noise: NoiseBelief = USUAL_BELIEF,
    ) -> SessionWriter:
        """The session of a run, with the sensors `beside` the camera; that of a further `sensor` has its name."""
        folder = self.store.run_folder(log.id) if sensor is None else self.store.folder_beside(log.id, sensor)
        source = f"{kind} run {log.id}" if sensor is None else f"{kind} run {log.id}, {sensor}"
        head = SessionDocument(
            schema_version=1, source=source, poses_from_controller=True, setup=self.setup, target=target,
            camera=None if camera is None else CameraDocument.of(camera.camera()), axis_offset=axis_offset,
            external_axis=self.arm.declared, known=self.known, robot_noise=NoiseBeliefDocument.of(robot_noise),
            views=[],
        )  # fmt: skip
        return SessionWriter(folder, head, self.store, self.workers, self.arm, beside)

"""The sensors of the active rig, by name."""

from dataclasses import dataclass

from calibration.documents.calibration import errors_of
from calibration.documents.rig import RigDocument
from calibration.errors import DocumentError, DocumentProblem
from calibration.problem import MOUNTS, Setup
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array
from daemon.errors import CalibrationUnusable, NotFound
from daemon.runtime.clock import Clock
from daemon.store.actor import current_audit_context
from daemon.store.documents import DocumentRecord
from daemon.store.store import Store


@dataclass(frozen=True)
class RigSensors:
    """Stores rigs, the newest of which is active, and gives their sensors' poses. `setup`: of the cell."""

    store: Store
    clock: Clock
    setup: Setup

    async def save(self, rig: RigDocument, new_id: str, *, despite_verdict: bool) -> DocumentRecord:
        """Store a rig and activate it. Raises DocumentError, CalibrationUnusable, StorageError."""
        if rig.setup != self.setup:
            what = Sentence("rig-of-other-setup", given=rig.setup, setup=self.setup)
            raise CalibrationUnusable(what, Sentence("solve-sensors-together"))
        _check(rig)
        if not (rig.verdict.accepted or despite_verdict):
            what = Sentence("rig-not-accepted", why=errors_of(rig.verdict.findings))
            raise CalibrationUnusable(what, Sentence("solve-rig-or-despite"))
        at, actor = self.clock.timestamp(), current_audit_context().actor
        record = DocumentRecord(new_id, rig.setup, at, actor, rig.model_dump_json())
        await self.store.rigs.save(record, **({} if rig.verdict.accepted else {"despite_verdict": True}))
        return record

    async def base_T_sensor(self, name: str, base_T_flange: Array) -> tuple[str, Array]:
        """Id of the active rig, and the pose (4, 4) of one of its sensors. Raises NotFound, StorageError."""
        newest = await self.store.rigs.about(self.setup, 1)
        if not newest:
            raise NotFound(Sentence("no-active-rig"), Sentence("store-rig"))
        rig = newest[0].parsed(RigDocument)
        poses = {sensor.name: sensor.mount_T_sensor for sensor in rig.sensors}
        if name not in poses:
            raise NotFound(Sentence("rig-without-sensor", name=name), Sentence("choose-one-of", names=list(poses)))
        mount_T_sensor = poses[name].transform()
        return newest[0].id, base_T_flange @ mount_T_sensor if self.setup == "eye-in-hand" else mount_T_sensor


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

"""Touch tests over REST: the tip is brought to each point, and the pose is read or given. Nothing moves here."""

from dataclasses import dataclass
from datetime import datetime
from functools import partial

import numpy as np

from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.documents.pose import PoseDocument
from calibration.documents.tip import TipDocument
from calibration.documents.touch_test import TouchTestDocument
from calibration.documents.touches import TouchesDocument
from calibration.documents.validation import Document
from calibration.errors import DocumentError
from calibration.kinematics.stance import Stance
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array
from daemon.cell.cell import Cell
from daemon.config.settings import MAIN_CAMERA, CalibrationSettings, Settings
from daemon.errors import ToleranceLoosened
from daemon.model.records import CalibrationRecord, FlangePose, RunRecord
from daemon.model.run_states import RunState
from daemon.runtime.clock import Clock
from daemon.runtime.workers import Workers
from daemon.store.actor import current_audit_context
from daemon.store.documents import DocumentKind, DocumentRecord
from daemon.store.store import Store
from extensions.touch.mathematics.report import (
    SeenPoint,
    Sighting,
    sighting_of,
    verified_points,
)
from extensions.touch.mathematics.with_arm import touch_test_with_arm, touches_in_use
from extensions.touch.requests import ApproachRequest, TouchRequest

TOUCH_TESTS = DocumentKind("touch_tests", "touch", "calibration_id")

_refusal = partial(DocumentError.one, "request body")
MAX_TOUCHES = 100

MAX_AGE_H = 8.0
"""Of a verification whose points the arm may approach: one shift, in which nobody has moved the target."""

MIN_TIP_MM = 5.0
"""A tip nearer to the flange's centre is usually one in metres."""


class StoredTouchTest(Document):
    """A touch test with what it was made from, so that touches can be added to it. `verification`: id of the run."""

    tip: TipDocument
    touches: TouchesDocument
    verification: str | None
    result: TouchTestDocument


@dataclass(frozen=True, eq=False)
class PointToTouch:
    """Where the camera saw a point, and the tip (3,) in the flange. `given`: by which calibration."""

    seen: Sighting
    tip_mm: Array
    given: CalibrationInUse

    def carried_mm(self) -> dict[str, Array]:
        """What the calibration knows to be carried beside the tip, by name, (3,) in the flange: the camera."""
        x = self.given.document.flange_T_camera
        return {} if x is None else {"the camera": x.transform()[:3, 3]}


@dataclass(frozen=True)
class _Basis:
    """What a request refers to: the test it adds to, the tip, the verification, the calibration with its arm."""

    earlier: StoredTouchTest | None
    tip: TipDocument
    run: RunRecord | None
    calibration: CalibrationRecord
    given: CalibrationInUse


@dataclass(frozen=True)
class TouchTests:
    """Evaluates and stores touch tests. `settings`: of the cell, for the tolerance of each camera."""

    store: Store
    cell: Cell
    workers: Workers
    clock: Clock
    settings: Settings

    async def evaluate(self, request: TouchRequest, new_id: str) -> DocumentRecord:
        """Evaluate touches, a missing pose read from the standing arm, and store the result.

        Raises NotFound, NoCalibration, DocumentError, GeometryError, CellBusy, NotStill, ToleranceLoosened,
        DeviceError, StorageError.
        """
        base = await self._basis(request)
        calibration = base.calibration
        known = calibration.camera in self.settings.camera_names  # else of a camera that the settings name no more
        settings = self.settings.of_camera(calibration.camera if known else MAIN_CAMERA).calibration
        tolerance_mm = _tolerance_mm(request, base.earlier, settings)
        touches = await self._with_poses(request, base.earlier)
        found = await self.workers.run(_evaluate, base.given, base.tip, touches, base.run, tolerance_mm)
        verification = None if base.run is None else base.run.id
        stored = StoredTouchTest(tip=base.tip, touches=touches, verification=verification, result=found)
        at, actor = self.clock.timestamp(), current_audit_context().actor
        new = DocumentRecord(new_id, calibration.id, at, actor, stored.model_dump_json())
        await self.store.documents(TOUCH_TESTS).save(new)
        return new

    async def find(self, request: ApproachRequest) -> "PointToTouch":
        """The point of an approach, of the active calibration.

        Raises NotFound, NoCalibration, DocumentError, GeometryError, StorageError.
        """
        base = await self._basis(request)
        given = base.given
        await self._require_current(base)
        tip_mm = np.array(base.tip.flange_tip_mm)
        if np.linalg.norm(tip_mm) < MIN_TIP_MM and not request.short_tip:
            what = f"it lies {np.linalg.norm(tip_mm):.3g} mm from the flange's centre"
            raise _refusal("tip.flange_tip_mm", what, "give it in mm; or, if the tool is so short, add short_tip: true")
        seen = {} if base.run is None else _seen_by(base.run, given)
        built = touches_in_use(given, TouchesDocument(touches=(request.touch,))).touches[0]
        anywhere = PoseDocument.of(np.eye(4))  # a touch has a pose, which says nothing of where the point was seen
        touch = built.model_copy(update={"base_T_flange": anywhere})
        return PointToTouch(sighting_of(given.document, touch, seen, "request body"), tip_mm, given)

    async def _require_current(self, base: "_Basis") -> None:
        """Raises DocumentError for a calibration that is no longer active, and an old verification."""
        used = base.calibration
        _, in_force = await self.store.current(used.camera)
        if in_force.id != used.id:
            what = f"the point was seen with calibration {used.id}, and {in_force.id} is active"
            raise _refusal("verification", what, "verify anew, and begin a new test")
        if base.run is None:
            return
        age = self.clock.utc_now() - datetime.fromisoformat(base.run.updated_at)
        if abs(age.total_seconds()) > MAX_AGE_H * 3600:  # a clock that was set back says nothing of the age either
            what = f"run {base.run.id} ended at {base.run.updated_at}, more than {MAX_AGE_H:g} h from now"
            raise _refusal("verification", what, "verify anew")

    async def _basis(self, request: TouchRequest | ApproachRequest) -> "_Basis":
        """What a request refers to. Raises NotFound, NoCalibration, DocumentError, StorageError."""
        earlier = None
        if request.adds_to is not None:
            record = await self.store.documents(TOUCH_TESTS).get(request.adds_to)
            earlier = record.parsed(StoredTouchTest)
        tip = request.tip or (None if earlier is None else earlier.tip)
        if tip is None:
            raise _refusal("tip", "missing", "add it: that of 'handeyed tip'")
        if earlier is not None and tip != earlier.tip:
            raise _refusal("tip", "another than that of the test to be added to", "leave it out, or begin a new test")
        if earlier is not None and request.verification not in (None, earlier.verification):
            raise _refusal("verification", "another than that of the test to be added to", "begin a new test")
        verification = request.verification or (None if earlier is None else earlier.verification)
        run = None if verification is None else await self._verification(verification)
        calibration = await self._calibration(request.camera, run, earlier)
        errors = await self.store.arm(calibration.id)
        given = await self.workers.run(self.cell.arm.in_use, calibration.document, errors)
        return _Basis(earlier, tip, run, calibration, given)

    async def _verification(self, run_id: str) -> RunRecord:
        run = await self.store.run(run_id)
        table = run.result["verification"] if run.kind == "verify" and run.result else {}
        if run.state is not RunState.FINISHED or table.get("frame") != "base" or "base_T_flange" not in table:
            what = f"run {run_id} is no finished verification by a camera on the flange, with its poses"
            raise _refusal("verification", what, "verify anew, or give the points as camera_mm")
        return run

    async def _calibration(
        self, camera: str | None, run: RunRecord | None, earlier: StoredTouchTest | None
    ) -> CalibrationRecord:
        """That of the verification, else of the test to be added to, else the active one of the camera."""
        if run is not None and run.result is not None:
            record = await self.store.calibration(run.result["calibration_id"])
        elif earlier is not None:
            record = await self.store.calibration(earlier.result.calibration_id)
        else:
            _, record = await self.store.current(camera or MAIN_CAMERA)
        if camera not in (None, record.camera):
            what = f"{camera!r}, but calibration {record.id} is of {record.camera!r}"
            raise _refusal("camera", what, "leave it out, or name a verification by that camera")
        return record

    async def _with_poses(self, request: TouchRequest, earlier: StoredTouchTest | None) -> TouchesDocument:
        """All touches; one without a pose gets that of the arm, which must stand and be in nobody's use."""
        new = list(request.touches)
        unposed = [index for index, touch in enumerate(new) if touch.base_T_flange is None]
        if len(unposed) > 1:
            fix = "send them one after the other, with adds_to"
            raise _refusal(f"touches[{unposed[1]}].base_T_flange", "the arm's pose is read for one touch only", fix)
        for index in unposed:
            async with self.cell.hold(Sentence("holder-touch")):
                reading = await self.cell.read_standing_pose()
            new[index] = new[index].model_copy(update=vars(FlangePose.of(reading)))
        before = earlier.touches if earlier else TouchesDocument(touches=tuple(new))
        placing = request.placing_sigma_mm if request.placing_sigma_mm is not None else before.placing_sigma_mm
        listed = (*before.touches, *new) if earlier else tuple(new)
        if len(listed) > MAX_TOUCHES:
            raise _refusal("touches", f"{len(listed)} touches in all", f"begin a new test after {MAX_TOUCHES}")
        return TouchesDocument(placing_sigma_mm=placing, touches=listed)


def _tolerance_mm(
    request: TouchRequest, earlier: StoredTouchTest | None, settings: CalibrationSettings
) -> float | None:
    """That of the request, else of the test to be added to, else of the settings. Raises ToleranceLoosened."""
    of_earlier = None if earlier is None else earlier.result.tolerance_mm
    tolerance_mm = request.tolerance_mm or of_earlier or settings.tolerance_mm
    if tolerance_mm is not None and settings.forbids(tolerance_mm):
        raise ToleranceLoosened(tolerance_mm, settings.verdict_limits().tolerance_mm)
    return tolerance_mm


def _evaluate(
    given: CalibrationInUse,
    tip: TipDocument,
    touches: TouchesDocument,
    run: RunRecord | None,
    tolerance_mm: float | None,
) -> TouchTestDocument:
    """The test, of the points as the verification has seen them."""
    seen = {} if run is None else _seen_by(run, given)
    return touch_test_with_arm(given, tip, touches, seen, tolerance_mm, "request body")


def _seen_by(run: RunRecord, given: CalibrationInUse) -> dict[int, SeenPoint]:
    """The target's points as a verification saw them, with its joints where the arm's errors are active."""
    assert run.result is not None
    table, x = run.result["verification"], given.document.mount_T_camera
    if x is None:
        return {}
    poses = np.array([PoseDocument.model_validate(pose).transform() for pose in table["base_T_flange"]])
    base_mm = np.array([point["base_mm"] for point in table["points"]]).transpose(1, 0, 2)
    joints_rad = None
    if given.arm is not None:
        recorded = table.get("joints_deg") or [None] * len(poses)
        known = [None if joints is None else np.radians(joints) for joints in recorded]
        joints_rad = given.joints_of(given.arm, list(map(Stance, poses, known)))
    return verified_points([point["id"] for point in table["points"]], poses, x.transform(), base_mm, joints_rad)

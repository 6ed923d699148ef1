"""The stored calibrations: the active one of a camera, one by its id, and putting active one."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from calibration.documents.calibration import AccuracyDocument, CalibrationDocument, ReasonDocument, errors_of
from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.errors import CalibrationError
from calibration.monitoring.comparison import compare
from calibration.problem import Setup
from calibration.sentences.sentence import Sentence
from daemon.cell.arm_in_cell import ArmInCell
from daemon.config.settings import MAIN_CAMERA
from daemon.errors import CalibrationUnusable, StorageInconsistent
from daemon.model.records import AppliedCalibration, CalibrationRecord
from daemon.model.requests import ApplyRequest
from daemon.runtime.clock import Clock
from daemon.runtime.workers import Workers
from daemon.store.store import Store

log = logging.getLogger(__name__)

MAX_WORSE = 1.25
"""Largest U of a calibration that policy "auto" activates, over that of the active one."""


@dataclass(frozen=True)
class Calibrations:
    """`camera`: whose calibration "current" means. `workers`: compute the uncertainty with the arm."""

    store: Store
    clock: Clock
    workers: Workers
    arm: ArmInCell
    camera: str = MAIN_CAMERA

    async def apply(
        self, calibration_id: str, request: ApplyRequest, expected: Sequence[int] | None = None
    ) -> AppliedCalibration:
        """Put an active calibration. Raises NotFound, CalibrationUnusable, StorageError, AppliedMeanwhile.

        `expected`: sequence numbers of which one must be active now.
        """
        found = await self.store.calibration(calibration_id)
        check_usable(found, request)
        despite = request.despite_verdict and not found.accepted
        applied = AppliedCalibration(
            found.id, self.clock.timestamp(), request.applied_by, despite_verdict=despite, reason=request.reason,
            camera=found.camera,
        )  # fmt: skip
        return await self.store.apply(applied, expected)

    async def current(self) -> CalibrationDocument:
        """The active calibration of this camera. Raises NoCalibration."""
        _, record = await self.store.current(self.camera)
        return record.document

    async def find(self, which: str, of: str | None = None) -> CalibrationDocument:
        """The active calibration ("current") or by id; one of the camera `of`, where it is given.

        Raises NoCalibration, NotFound, CalibrationUnusable.
        """
        if which == "current":
            _, record = await self.store.current(of or self.camera)
        else:
            record = await self.store.calibration(which)
        document = record.document
        if of is not None and record.camera != of:
            what = Sentence("calibration-of-other-camera", calibration=document.id, camera=record.camera, of=of)
            raise CalibrationUnusable(what, Sentence("choose-calibration-of", of=of))
        require_transform(document)
        return document

    async def in_use(self, calibration: CalibrationDocument) -> CalibrationInUse:
        """The calibration with the errors of the arm identified with it.

        Raises CalibrationUnusable for one without the cell's external axis, StorageError, GeometryError.
        """
        errors = await self.store.arm(calibration.id)
        if errors is None:  # there is nothing to compute that would hold the event loop up
            return self.arm.in_use(calibration, None)
        return await self.workers.run(self.arm.in_use, calibration, errors)

    async def accuracy(self, calibration: CalibrationDocument) -> AccuracyDocument:
        """What it states, with the arm's errors as they are now where they were taken up. Raises StorageError.

        That of the calibration alone, where it or its arm.json cannot be used.
        """
        try:
            calibration = (await self.in_use(calibration)).document
        except (CalibrationUnusable, CalibrationError, StorageInconsistent) as error:
            log.warning("the uncertainty of calibration %s is stated without its arm: %s", calibration.id, error)
        return calibration.accuracy


def check_usable(calibration: CalibrationRecord, request: ApplyRequest) -> None:
    """Raises CalibrationUnusable for a calibration without a transform, or rejected without `despite_verdict`."""
    require_transform(calibration.document)
    if not (calibration.accepted or request.despite_verdict):
        why = errors_of(calibration.document.verdict.findings)
        what = Sentence("calibration-not-accepted", calibration=calibration.id, why=why)
        raise CalibrationUnusable(what, Sentence("calibrate-or-despite", body='{"despite_verdict": true}'))


def require_transform(calibration: CalibrationDocument) -> None:
    """Raises CalibrationUnusable for a calibration without a transform."""
    if calibration.mount_T_camera is None:
        what = Sentence("calibration-without-transform", calibration=calibration.id)
        raise CalibrationUnusable(what, Sentence("calibrate-with-other-poses"))


def require_setup(calibration: CalibrationDocument, setup: Setup) -> None:
    """Raises CalibrationUnusable for a calibration of the other set-up."""
    if calibration.setup != setup:
        given = calibration.setup
        what = Sentence("calibration-of-other-setup", calibration=calibration.id, given=given, setup=setup)
        raise CalibrationUnusable(what, Sentence("calibrate-this-cell"))


def result_of(document: CalibrationDocument, *, applied: bool, why_not: Sentence | None = None) -> dict[str, Any]:
    """The result of a run that made this calibration. `why_not`: policy "auto" left it to a person."""
    return {
        "calibration_id": document.id,
        "accepted": document.verdict.accepted,
        "applied": applied,
        "not_applied": None if why_not is None else ReasonDocument.of(why_not).model_dump(mode="json"),
        **document.accuracy.fields(),
    }


def why_not_applied(current: CalibrationDocument, new: CalibrationDocument) -> Sentence | None:
    """Why a person should decide whether `new` replaces the active calibration: it is worse, or contradicts it."""
    now_mm, before_mm = new.accuracy.expanded_mm, current.accuracy.expanded_mm
    if current.mount_T_camera is None or current.setup != new.setup or now_mm is None or before_mm is None:
        return None
    both = {"expanded_mm": now_mm, "before_mm": before_mm}
    found = compare(current, new)
    if found.agree is False:
        worst = max(found.points, key=lambda point: point.difference_mm)
        return Sentence("not-applied-contradicts", point=worst.name, difference_mm=worst.difference_mm, **both)
    return Sentence("not-applied-worse", **both) if now_mm > MAX_WORSE * before_mm else None

"""Gateway between the PLC's registers and `daemon.operations`: triggers become calls, results become registers."""

import asyncio
import logging
from collections.abc import Coroutine
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import partial
from typing import Any

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.validation import validate_document
from calibration.errors import CalibrationError, DocumentError
from daemon.access.actor_names import PLC_CLIENT
from daemon.application import CellCamera
from daemon.errors import DaemonError, NoCalibration, NotFound, RunOver, StopUnconfirmed, StorageError
from daemon.model.records import RunRecord
from daemon.model.requests import CalibrateRequest, ScanRequest, VerifyRequest
from daemon.model.run_states import RunState
from daemon.operations import Operations
from daemon.runtime.clock import Clock
from daemon.runtime.logs import about_request
from daemon.store.actor import AuditContext, acting_as
from drivers.errors import DeviceError
from protocols.counter import MAX_COUNT
from protocols.modbus.words import Words
from protocols.plc.bank import PlcBank
from protocols.plc.codes import UNKNOWN, ControlBit, DriftState, PlcCommand, PlcVerdict, number_of
from protocols.plc.events import (
    AbortRun,
    CellStatus,
    CommandEnded,
    HandshakeEvent,
    RegistersWritten,
    StartAccepted,
    StartCommand,
    StartRefused,
    StationReached,
    TimePassed,
)
from protocols.plc.handshake import Handshake, Rules, react, register_image
from protocols.plc.registers import BY_NAME, CONTROL
from protocols.plc.results import Accuracy, CameraPose, CommandResult, Sigma
from registration.errors import RegistrationError


def finished_result(
    command: PlcCommand, run: RunRecord, document: CalibrationDocument, now: datetime, *, good: bool,
    deviation_mm: float | None, in_force: bool = True,
) -> CommandResult:  # fmt: skip
    """The result of a run that came to its end: X, its uncertainty, accuracy and age, and the deviation it found."""
    camera = sigma = None
    if document.mount_T_camera is not None:
        camera = CameraPose(document.mount_T_camera.translation_mm, document.mount_T_camera.quaternion_wxyz)
    if document.uncertainty is not None:
        uncertainty = document.uncertainty
        sigma = Sigma(uncertainty.translation_mm, uncertainty.rotation_deg, uncertainty.point_mm)
    stated = document.accuracy
    accuracy = Accuracy(
        stated.expanded_mm, stated.worst_point or "", stated.tolerance_mm, stated.tolerance_stated, stated.expected_mm,
        stated.before_mm, unexpected=stated.why is not None,
    )  # fmt: skip
    verdict = PlcVerdict.ACCEPTED if good else PlcVerdict.REJECTED
    return CommandResult(
        command, verdict, run.id, 0, run.station, age_of(document, now), camera, sigma, deviation_mm, accuracy, in_force
    )


def age_of(document: CalibrationDocument, now: datetime) -> int:
    """Whole seconds since the calibration was made; 0 when that lies in the future."""
    return max(0, int((now - datetime.fromisoformat(document.created_at)).total_seconds()))


log = logging.getLogger(__name__)

BEAT_S, POLL_S, PROGRESS_S = 0.5, 1.0, 0.2

MAX_TEMPERATURE = 1000
"""Of the register arm_temperature; larger values are no arm's."""

ARM_TEMPERATURE = BY_NAME["arm_temperature"].address

EXPECTED_ERRORS = (DaemonError, DeviceError, CalibrationError, RegistrationError)

FALLBACK_CODES: tuple[tuple[type[Exception], str], ...] = (
    (DocumentError, "request-refused"),
    (CalibrationError, "calibration-error"),
    (RegistrationError, "registration-error"),
    (DeviceError, "device-error"),
)
"""Error codes for exceptions whose own code has no number in the register map; the first matching type decides."""

DRIFT = {
    "off": DriftState.OFF,
    "learning": DriftState.LEARNING,
    "steady": DriftState.STEADY,
    "drifting": DriftState.DRIFTING,
    "out-of-tolerance": DriftState.DRIFTING,
}


@dataclass(eq=False)
class PlcGateway:
    """Owns the handshake's state. All events go through `_take`, which never awaits: register images are consistent."""

    cameras: tuple[CellCamera, ...]
    clock: Clock
    rules: Rules
    _state: Handshake = field(init=False)
    _image: Words = field(init=False)
    _by: str = field(default="a PLC", init=False)
    _tasks: set[asyncio.Task[None]] = field(default_factory=set, init=False)
    _last_warning: str = field(default="", init=False)

    def __post_init__(self) -> None:
        # After a restart the ids begin at the time in seconds, so that the PLC cannot take an old result for a new one.
        begin = int(self.clock.utc_now().timestamp()) % MAX_COUNT + 1
        self._state = Handshake(self.rules, acquisition_id=begin, result_id=begin)
        self._image = register_image(self._state)

    @property
    def operations(self) -> Operations:
        """Of [camera], and all that no camera has a part in."""
        return self.cameras[0].operations

    def _camera(self, number: int) -> CellCamera:
        """The camera of that number in the settings. Raises NotFound."""
        if number >= len(self.cameras):
            raise NotFound(f"there is no camera {number}", f"the settings have {len(self.cameras) - 1} further")
        return self.cameras[number]

    def bank(self, client: str, may_write: bool, *, repeated: bool = False) -> PlcBank:
        """`repeated`: for older requests that come again after newer ones: of what they write only abort counts."""

        def image() -> Words:
            """The register values with the control register as `client` left it: it holds abort by itself, or not."""
            if not self._state.abort_writers:
                return self._image
            own = self._state.written_by(client)
            return (*own, *self._image[len(own) :])

        return PlcBank(image, partial(self._write_again if repeated else self._write, client), may_write)

    def start(self) -> None:
        self._run(self._send_beats(), "PLC heartbeat")
        self._run(self._poll_cell(), "PLC readiness")

    async def stop(self) -> None:
        """Stop the heartbeat and all commands in progress."""
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _write(self, client: str, words: Words, written: range) -> None:
        rising = ControlBit(words[0]) & ~ControlBit(self._state.written_by(client)[0])
        if rising:
            self._by = f"{PLC_CLIENT} {client}"
            log.info("%s sets %s", self._by, ", ".join(bit.name.lower() for bit in rising if bit.name))
        held = self._state.abort_writers
        self._take(RegistersWritten(words, client))
        tenths = self._state.input("arm_temperature")
        if ARM_TEMPERATURE in written and 0 < tenths <= MAX_TEMPERATURE:
            self.operations.cell.arm.state_temperature(tenths / 10)
        if self._state.abort_writers != held:
            self.operations.supervisor.hold_abort([f"{PLC_CLIENT} {each}" for each in self._state.abort_writers])

    def _write_again(self, client: str, words: Words, _: range) -> None:
        log.warning("%s %s repeats an older write after newer ones: it is ignored", PLC_CLIENT, client)
        if ControlBit(words[0]) & ControlBit.ABORT:
            control, *others = self._state.written_by(client)
            self._write(client, (control | ControlBit.ABORT, *others), range(CONTROL, CONTROL + 1))

    def _take(self, event: HandshakeEvent) -> None:
        reaction = react(self._state, event)
        for state in reaction.states:
            if state != self._state:
                self._state, self._image = state, register_image(state)
        for effect in reaction.effects:
            match effect:
                case StartCommand():
                    self._run(self._carry_out(effect), f"PLC {effect.command.name.lower()}")
                case AbortRun(why):
                    self._run(self._abort(self._by if why == "the PLC" else why), "PLC abort")

    def _run(self, work: Coroutine[Any, Any, None], name: str) -> None:
        task = asyncio.create_task(work, name=name)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _carry_out(self, start: StartCommand) -> None:
        """Start the run, follow it and report its result. The PLC gets an answer in every case."""
        name = f"plc-{start.command.name.lower()}-{self._state.acquisition_id + 1}"
        with about_request(name), acting_as(AuditContext(self._by, "operator")):
            try:
                run = await self._begin(start)
            except Exception as error:  # noqa: BLE001  logged by _code_of
                self._take(StartRefused(self._code_of(error)))
                return
            self._take(StartAccepted())
            self._take(CommandEnded(await self._follow(start, run)))
        await self._update_cell()

    async def _begin(self, start: StartCommand) -> RunRecord:
        """Start the run through `daemon.operations`, as REST does, and return it. Raises the same errors."""
        camera = self._camera(start.camera)
        tolerance = {"tolerance_mm": start.tolerance_um / 1e3 or None, "camera": (start.camera and camera.name) or None}
        match start.command:
            case PlcCommand.CALIBRATE:
                wanted = {"count": start.stations_wanted or None, **tolerance}
                return await camera.operations.calibrate(validate_document(CalibrateRequest, wanted, "registers"))
            case PlcCommand.VERIFY:
                return await camera.operations.verify(validate_document(VerifyRequest, tolerance, "registers"))
            case _:
                await camera.operations.calibrations.find("current")
                name = self.operations.settings.scanner_beside(camera.name) if start.camera else None
                request = ScanRequest(name=f"part {start.part_id}", capture=True, refine=True, scanner=name)
                _, run = await self.operations.scan(request)
                assert run is not None  # it moves the arm
                return run

    async def _follow(self, start: StartCommand, run: RunRecord) -> CommandResult:
        """Wait for the end of the run, publishing its progress, and return its result."""
        try:
            while not run.is_over:
                run = await self.operations.supervisor.wait(run.id, PROGRESS_S)
                self._take(StationReached(run.station, run.stations))
            return await self._result(start.command, run, self._camera(start.camera))
        except Exception as error:  # noqa: BLE001  logged by _code_of; the run has ended
            return CommandResult(start.command, PlcVerdict.FAILED, run.id, self._code_of(error))

    async def _result(self, command: PlcCommand, run: RunRecord, camera: CellCamera) -> CommandResult:
        if run.state is not RunState.FINISHED or run.result is None:
            verdict = PlcVerdict.ABORTED if run.state is RunState.ABORTED else PlcVerdict.FAILED
            code = number_of(run.cause.code) if run.cause else UNKNOWN
            return CommandResult(command, verdict, run.id, code, run.station)
        operations, now = camera.operations, self.clock.utc_now()
        if command is PlcCommand.REGISTER:
            used = await operations.calibrations.in_use(await operations.calibrations.find("current"))
            report = await (await operations.scans.start_registration(run.result["scan_id"], used, refine=True))
            rms, good = report.rms_mm, report.verdict.accepted
            deviation_mm = rms.before if rms.after is None else rms.after
            return finished_result(command, run, used.document, now, good=good, deviation_mm=deviation_mm)
        document = (await operations.store.calibration(run.result["calibration_id"])).document
        if command is PlcCommand.CALIBRATE:
            good, in_force = document.verdict.accepted, run.result["applied"]
            deviation_mm = document.hold_out.base_error_mm if document.hold_out else None
            return finished_result(command, run, document, now, good=good, deviation_mm=deviation_mm, in_force=in_force)
        document = (await operations.calibrations.in_use(document)).document
        drifts, found = bool((await camera.drift.report_after(run)).alarm), run.result["verification"]
        good, largest_mm = found["within_tolerance"] and not drifts, float(max(found["sigma_mm"]))
        return finished_result(command, run, document, now, good=good, deviation_mm=largest_mm)

    async def _abort(self, by: str) -> None:
        """Abort the run in progress, also one that another client started; then append its audit row."""
        run = self.operations.supervisor.in_progress
        if run is None:
            return
        context = AuditContext(by if by.startswith(PLC_CLIENT) else self._by, "operator")
        with acting_as(context), suppress(RunOver, StopUnconfirmed):
            await self.operations.supervisor.abort(run.id, by)
        try:
            await self.operations.store.audit.append(context, self.clock.timestamp(), "abort", run.id, by=by)
        except StorageError as error:
            log.error("the audit log could not be written: %s", error)

    def _code_of(self, error: Exception) -> int:
        """The error code for the registers; the message goes to the log, that of a defect with its traceback."""
        if not isinstance(error, EXPECTED_ERRORS):
            log.error("a defect ended a command of %s", self._by, exc_info=error)
            return number_of("internal-error")
        log.warning("a command of %s failed: %s", self._by, error)
        number = number_of(getattr(error, "code", ""))
        if number != UNKNOWN:
            return number
        return next((number_of(code) for family, code in FALLBACK_CODES if isinstance(error, family)), UNKNOWN)

    async def _send_beats(self) -> None:
        while True:
            before_s = self.clock.monotonic_s()
            await self.clock.sleep(BEAT_S)
            self._take(TimePassed(self.clock.monotonic_s() - before_s))

    async def _poll_cell(self) -> None:
        while True:
            await self._update_cell()
            await self.clock.sleep(POLL_S)

    async def _update_cell(self) -> None:
        try:
            seen = await self._read_cell()
        except EXPECTED_ERRORS as error:
            if str(error) != self._last_warning:
                log.warning("not ready for the PLC: %s", error)
            self._last_warning, seen = str(error), CellStatus(ready=False, stop_unconfirmed=self._stop_unconfirmed)
        self._take(seen)

    @property
    def _stop_unconfirmed(self) -> bool:
        return bool(self.operations.cell.safe_stop.warnings())

    async def _read_cell(self) -> CellStatus:
        number = self._state.input("camera_wanted")
        camera = self.cameras[number] if number < len(self.cameras) else self.cameras[0]
        busy = self.operations.supervisor.in_progress is not None
        obstacles = () if busy else await camera.operations.cell.obstacles()
        report = camera.drift.report
        seen = CellStatus(
            ready=not busy and not obstacles,
            drift=DriftState.DRIFTING if report.alarm else DRIFT[report.standing],
            drift_shift_um=round(1e3 * report.shift_mm),
            stop_unconfirmed=self._stop_unconfirmed,
        )
        try:
            document = await camera.operations.calibrations.current()
        except NoCalibration:
            return seen
        return replace(seen, in_force=True, calibration_age_s=age_of(document, self.clock.utc_now()))

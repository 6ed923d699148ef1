"""The PLC's door: what it writes becomes calls of daemon.operations, what comes of them becomes its registers."""

import asyncio
import logging
from collections.abc import Coroutine
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

from calibration.documents.validation import validate_document
from calibration.errors import CalibrationError, DocumentError
from calibration.monitoring.control_chart import DriftStanding
from daemon.drift.monitor import DriftWatch
from daemon.errors import DaemonError, NoCalibration, RunOver
from daemon.model.records import RunRecord
from daemon.model.requests import CalibrateRequest, ScanRequest, VerifyRequest
from daemon.model.run_states import RunState
from daemon.operations import Operations
from daemon.plc.result_mapping import age_of, calibrated, ended_badly, failed, registered, verified
from daemon.runtime.clock import Clock
from daemon.runtime.logs import about_request
from daemon.store.actor import Behalf, on_behalf_of
from drivers.errors import DeviceError
from protocols.modbus.words import Words
from protocols.plc.bank import PlcBank
from protocols.plc.codes import Command, Control, DriftState
from protocols.plc.error_codes import UNKNOWN, number_of
from protocols.plc.events import (
    Abort,
    Accepted,
    Beat,
    CellSeen,
    Effect,
    Ended,
    Event,
    Progressed,
    Refused,
    Start,
    Written,
)
from protocols.plc.handshake import COUNT_MOST, Handshake, Rules, react
from protocols.plc.image import image_of
from protocols.plc.results import Result
from registration.errors import RegistrationError

log = logging.getLogger(__name__)

BEAT_S, LOOK_S, PROGRESS_S = 0.5, 1.0, 0.2

REFUSALS = (DaemonError, DeviceError, CalibrationError, RegistrationError)

FAMILIES: tuple[tuple[type[Exception], str], ...] = (
    (DocumentError, "request-refused"),
    (CalibrationError, "calibration-error"),
    (RegistrationError, "registration-error"),
    (DeviceError, "device-error"),
)
"""For errors whose own code has no number."""

DRIFT = {
    None: DriftState.OFF,
    DriftStanding.LEARNING: DriftState.LEARNING,
    DriftStanding.STEADY: DriftState.STEADY,
    DriftStanding.DRIFTING: DriftState.DRIFTING,
}


@dataclass(eq=False)
class PlcDoor:
    """Owner of the handshake. Every change of it goes through `_take`, which never waits: no image is ever half."""

    operations: Operations
    drift: DriftWatch
    clock: Clock
    rules: Rules
    _state: Handshake = field(init=False)
    _image: Words = field(init=False)
    _by: str = field(default="a PLC", init=False)
    _tasks: set[asyncio.Task[None]] = field(default_factory=set, init=False)
    _told: str = field(default="", init=False)

    def __post_init__(self) -> None:
        # After a restart the ids begin where no PLC has seen them lately: it takes no old result for a new one.
        begin = int(self.clock.utc_now().timestamp()) % COUNT_MOST + 1
        self._state = Handshake(self.rules, acquisition_id=begin, result_id=begin)
        self._image = image_of(self._state)

    def bank(self, client: str, may_write: bool) -> PlcBank:
        """The registers for one client."""
        return PlcBank(self.image, lambda words: self._write(words, client), may_write)

    def image(self) -> Words:
        """The registers of this moment."""
        return self._image

    def start(self) -> None:
        self._run(self._beat(), "PLC heartbeat")
        self._run(self._look_around(), "PLC readiness")

    async def stop(self) -> None:
        """Nothing is followed any more; what runs was stopped by the daemon."""
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _write(self, words: Words, client: str) -> None:
        rising = Control(words[0]) & ~self._state.control
        if rising:
            self._by = f"the PLC at {client}"
            log.info("%s sets %s", self._by, ", ".join(bit.name.lower() for bit in rising if bit.name))
        self._take(Written(words))

    def _take(self, event: Event) -> None:
        reaction = react(self._state, event)
        for state in reaction.states:
            if state != self._state:
                self._state, self._image = state, image_of(state)
        for effect in reaction.effects:
            self._do(effect)

    def _do(self, effect: Effect) -> None:
        match effect:
            case Start():
                self._run(self._command(effect), f"PLC {effect.command.name.lower()}")
            case Abort(why):
                self._run(self._abort(why), "PLC abort")

    def _run(self, work: Coroutine[Any, Any, None], name: str) -> None:
        task = asyncio.create_task(work, name=name)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    # what the PLC wants done

    async def _command(self, start: Start) -> None:
        """Begin, follow, tell. Whatever happens, the PLC gets its answer."""
        name = f"plc-{start.command.name.lower()}-{self._state.acquisition_id + 1}"
        with about_request(name), on_behalf_of(Behalf(self._by, "operator")):
            try:
                run = await self._begun(start)
            except REFUSALS as error:
                self._take(Refused(self._code_of(error)))
                return
            except Exception:
                log.exception("a defect kept a command of %s from being begun", self._by)
                self._take(Refused(number_of("internal-error")))
                return
            self._take(Accepted())
            self._take(Ended(await self._followed(start.command, run)))
        await self._look()

    async def _begun(self, start: Start) -> RunRecord:
        """The run, by the same door as REST. Raises as daemon.operations does."""
        match start.command:
            case Command.CALIBRATE:
                wanted = {"count": start.stations_wanted} if start.stations_wanted else {}
                return await self.operations.calibrate(validate_document(CalibrateRequest, wanted, "stations_wanted"))
            case Command.VERIFY:
                return await self.operations.verify(VerifyRequest())
            case _:
                await self.operations.calibration("current")
                request = ScanRequest(name=f"part {start.part_id}", capture=True, refine=True)
                _, run = await self.operations.scan(request)
                assert run is not None  # it moves the arm
                return run

    async def _followed(self, command: Command, run: RunRecord) -> Result:
        """The result of the run once it is over."""
        try:
            while not run.over:
                run = await self.operations.supervisor.wait(run.id, PROGRESS_S)
                self._take(Progressed(run.station, run.stations))
            return await self._result(command, run)
        except REFUSALS as error:
            return failed(command, run.id, self._code_of(error))
        except Exception:
            log.exception("a defect kept a result from %s", self._by)
            return failed(command, run.id, number_of("internal-error"))

    async def _result(self, command: Command, run: RunRecord) -> Result:
        if run.state is not RunState.FINISHED or run.result is None:
            return ended_badly(command, run)
        operations, now = self.operations, self.clock.utc_now()
        if command is Command.REGISTER:
            document = await operations.calibration("current")
            report = await (await operations.scans.registered(run.result["scan_id"], document, refine=True))
            return registered(run, document, now, report)
        document = (await operations.store.calibration(run.result["calibration_id"])).document
        if command is Command.CALIBRATE:
            return calibrated(run, document, now)
        return verified(run, document, now, holds=not (await self.drift.entered(run)).alarm)

    async def _abort(self, why: str) -> None:
        """Whoever started it: stopping needs no permission."""
        run = self.operations.supervisor.in_progress
        if run is None:
            return
        with on_behalf_of(Behalf(self._by, "operator")), suppress(RunOver):
            await self.operations.supervisor.abort(run.id, f"{self._by}" if why == "the PLC" else why)

    def _code_of(self, error: Exception) -> int:
        """The number of an error; its words go to the log."""
        log.warning("%s is told: %s", self._by, error)
        number = number_of(getattr(error, "code", ""))
        if number != UNKNOWN:
            return number
        return next((number_of(code) for family, code in FAMILIES if isinstance(error, family)), UNKNOWN)

    # what the PLC sees

    async def _beat(self) -> None:
        while True:
            before_s = self.clock.monotonic_s()
            await self.clock.sleep(BEAT_S)
            self._take(Beat(self.clock.monotonic_s() - before_s))

    async def _look_around(self) -> None:
        while True:
            await self._look()
            await self.clock.sleep(LOOK_S)

    async def _look(self) -> None:
        try:
            seen = await self._seen()
        except REFUSALS as error:
            if str(error) != self._told:
                log.warning("the PLC is told not ready: %s", error)
            self._told, seen = str(error), CellSeen(ready=False)
        self._take(seen)

    async def _seen(self) -> CellSeen:
        busy = self.operations.supervisor.in_progress is not None
        obstacles = () if busy else await self.operations.cell.obstacles()
        report = self.drift.report
        seen = CellSeen(
            ready=not busy and not obstacles,
            drift=DriftState.DRIFTING if report.alarm else DRIFT[report.standing],
            drift_shift_um=round(1e3 * report.shift_mm),
        )
        try:
            document = await self.operations.current_document()
        except NoCalibration:
            return seen
        return replace(seen, in_force=True, calibration_age_s=age_of(document, self.clock.utc_now()))

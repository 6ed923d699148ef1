"""Scheduled verifications, which move the arm; off unless the settings turn them on."""

import logging
from dataclasses import dataclass, field

from calibration.errors import CalibrationError
from calibration.sentences.sentence import Sentence
from daemon.access.actor_names import DRIFT_SCHEDULE
from daemon.errors import CellBusy, CellNotReady, DaemonError, RunInProgress
from daemon.model.requests import VerifyRequest
from daemon.model.run_states import RunState
from daemon.operations import Operations
from daemon.runtime.clock import Clock
from daemon.runtime.logs import about_request
from daemon.runtime.tasks import InBackground
from daemon.store.actor import AuditContext, acting_as
from drivers.errors import DeviceError

log = logging.getLogger(__name__)

RETRY_S = 60.0
"""A verification that is due during another run is tried again after this."""

POLL_S = 0.2
"""Interval of checks for an emergency stop, manual mode, an open interlock."""

SCHEDULE = AuditContext(actor=DRIFT_SCHEDULE)


Seen = tuple[int, int, tuple[bool, float]]
"""What others have seen of the cell: aborts held, obstacles, which only rise, and the link, with its state's start."""


@dataclass(eq=False)
class DriftSchedule(InBackground):
    """Background service: verifies every `every_s`, first one interval after the start, while the cell is in use.

    The cell is in use when since the daemon's start a run was started over REST or by a PLC and finished, and since
    then no run failed or was aborted and no obstacle to motion occurred (emergency stop, manual mode, motors off, open
    interlock, a controller that does not answer, a link that was interrupted, a PLC's abort). Otherwise a verification
    that is due is skipped. An obstacle counts whoever saw it, also between two checks.
    """

    operations: Operations
    clock: Clock
    every_s: float
    _withdrawn_run: str = field(default="", init=False)
    _withdrawn_because: str = field(default="", init=False)
    _seen_after: str = field(default="", init=False)
    _seen: Seen | None = field(default=None, init=False)

    async def start(self) -> None:
        if self.every_s > 0:
            await super().start()

    def warnings(self) -> list[str]:
        """Why nothing is scheduled, for GET /ready."""
        why = self._skip_reason() if self.every_s > 0 else ""
        return [Sentence("schedule-waits", why=why)] if why else []

    async def run(self) -> None:
        due_s = self.clock.monotonic_s() + self.every_s
        while True:
            await self.clock.sleep(POLL_S)
            await self._check_cell()
            if self.clock.monotonic_s() >= due_s:
                busy = await self._verify()
                due_s = self.clock.monotonic_s() + (RETRY_S if busy else self.every_s)

    async def _check_cell(self) -> None:
        """Withdraw the latest run's consent when there is an obstacle to motion; a run in progress checks by itself."""
        latest = self.operations.supervisor.latest
        if latest is not None and not latest.is_over:
            # What anybody sees after its end counts, also before the next check.
            self._seen_after, self._seen = latest.id, self._see()
            return
        if latest is None or self._skip_reason():
            return
        if self._seen is None or self._seen_after != latest.id:
            self._seen_after, self._seen = latest.id, self._see()
        cell, changed = self.operations.cell, zip(self._seen, self._see(), strict=True)
        causes = ("a PLC set abort", cell.occupancy.last_obstacle, "the link to the robot was interrupted")
        missed = [why for why, (before, now) in zip(causes, changed, strict=True) if before != now]
        obstacles = missed or await cell.robot_obstacles()
        if obstacles:
            self._withdraw(latest.id, obstacles[0])

    def _see(self) -> Seen:
        cell, supervisor = self.operations.cell, self.operations.supervisor
        link = cell.robot.link.connected, cell.robot.link.since_s
        return supervisor.abort_holds, cell.occupancy.obstacles_seen, link

    async def _verify(self) -> bool:
        """Start a verification or skip it. Returns True when another run is in progress."""
        if self.operations.supervisor.in_progress is not None:
            return True
        if why := self._skip_reason():
            log.warning("the scheduled verification is left out until somebody starts a run: %s", why)
            return False
        latest = self.operations.supervisor.latest
        with acting_as(SCHEDULE), about_request("drift-schedule"):
            try:
                run = await self.operations.verify(VerifyRequest())
            except (RunInProgress, CellBusy):
                return True
            except (DaemonError, DeviceError, CalibrationError) as error:
                log.warning("the scheduled verification is left out: %s", error)
                if latest is not None and isinstance(error, CellNotReady | DeviceError):
                    self._withdraw(latest.id, str(error))
                return False
        log.info("the scheduled verification is run %s", run.id)
        return False

    def _skip_reason(self) -> str:
        """Why the schedule must not move the arm now; empty when it may, or when a run is in progress."""
        latest = self.operations.supervisor.latest
        if latest is None:
            return Sentence("schedule-daemon-started")
        if not latest.is_over:
            return ""
        if latest.state is not RunState.FINISHED:
            return Sentence(f"schedule-run-{latest.state}", run=latest.id)
        if latest.request.get("manual") or latest.kind == "jog":
            return Sentence("schedule-moved-by-hand", run=latest.id)
        return self._withdrawn_because if latest.id == self._withdrawn_run else ""

    def _withdraw(self, run_id: str, why: str) -> None:
        self._withdrawn_run, self._withdrawn_because = run_id, why
        log.warning("the drift schedule verifies nothing until somebody starts a run: %s", why)

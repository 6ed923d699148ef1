"""Verifications that the daemon begins by itself: only when the settings say so, for they move the arm."""

import asyncio
import logging
from contextlib import suppress
from dataclasses import dataclass, field

from calibration.errors import CalibrationError
from daemon.errors import DaemonError
from daemon.model.requests import VerifyRequest
from daemon.operations import Operations
from daemon.runtime.clock import Clock
from daemon.runtime.logs import about_request
from daemon.store.actor import AuditContext, acting_as
from drivers.errors import DeviceError

log = logging.getLogger(__name__)

RETRY_S = 60.0
"""A cell that is in use, or in manual mode, is asked again after this."""

SCHEDULE = AuditContext(actor="the drift schedule")


@dataclass(eq=False)
class DriftSchedule:
    """The first verification comes a whole interval after the start: a restart moves nothing."""

    operations: Operations
    clock: Clock
    every_s: float
    _task: asyncio.Task[None] | None = field(default=None, init=False)

    async def start(self) -> None:
        if self.every_s > 0:
            self._task = asyncio.create_task(self._run_schedule(), name="drift schedule")

    async def stop(self) -> None:
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task

    async def _run_schedule(self) -> None:
        while True:
            await self.clock.sleep(self.every_s)
            refused = ""
            while (why := await self._try_verify()) is not None:
                if why != refused:
                    log.info("the scheduled verification waits: %s", why)
                refused = why
                await self.clock.sleep(RETRY_S)

    async def _try_verify(self) -> str | None:
        """Why it could not begin; None when it has."""
        with acting_as(SCHEDULE), about_request("drift-schedule"):
            try:
                run = await self.operations.verify(VerifyRequest())
            except (DaemonError, DeviceError, CalibrationError) as error:
                return str(error)
        log.info("the scheduled verification is run %s", run.id)
        return None

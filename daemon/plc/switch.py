"""The PLC interface that can be switched on, off and over while the daemon runs."""

import logging
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from daemon.config.plc_settings import PlcSettings
from daemon.errors import PortTaken
from daemon.runtime.metrics import Metric

if TYPE_CHECKING:
    from daemon.plc.service import PlcService

log = logging.getLogger(__name__)

Make = Callable[[PlcSettings], "PlcService"]
"""Builds the service and binds its port. Raises PortTaken."""


class PlcSwitch:
    """Background service: the PLC interface of these settings, or none."""

    def __init__(self, settings: PlcSettings | None, make: Make) -> None:
        """Raises PortTaken."""
        self._settings, self._make = settings, make
        self._service = None if settings is None else make(settings)

    @property
    def service(self) -> "PlcService":
        """The interface that is on. Raises LookupError when none is."""
        if self._service is None:
            raise LookupError("the settings name no PLC")
        return self._service

    async def start(self) -> None:
        if self._service is not None:
            await self._service.start()

    async def stop(self) -> None:
        if self._service is not None:
            await self._service.stop()

    async def change(self, settings: PlcSettings | None) -> None:
        """End the interface with its commands, and begin the one of these settings.

        Raises PortTaken when it cannot listen there; then the one before goes on.
        """
        before = self._settings
        await self.stop()
        self._service, self._settings = None, None
        try:
            self._service = None if settings is None else self._make(settings)
            self._settings = settings
        except PortTaken:
            self._service = None if before is None else self._make(before)
            self._settings = before
            raise
        finally:
            await self.start()

    def families(self) -> Iterable[Metric]:
        return () if self._service is None else self._service.families()

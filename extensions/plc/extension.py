"""What the PLC interface adds to the daemon: the service of [plc]."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from calibration.sentences.sentence import Sentence
from daemon.api.extension import Extension
from daemon.application import Application
from daemon.config.plc_settings import PlcSettings
from daemon.errors import CellNotReady, PortTaken
from daemon.runtime.metrics import Metric
from daemon.runtime.tasks import SectionService

if TYPE_CHECKING:
    from extensions.plc.service import PlcService


class PlcSwitch(SectionService):
    """Service of [plc], which can be switched on, off and over while the daemon runs.

    `service`: the interface that is on; None when the settings name no PLC.
    """

    service: "PlcService | None"

    def __init__(self, app: Application) -> None:
        """Raises PortTaken."""
        self._app = app
        self._open(app.settings.plc)

    async def start(self) -> None:
        if self.service is not None:
            await self.service.start()

    async def stop(self) -> None:
        if self.service is not None:
            await self.service.stop()

    async def change(self, settings: PlcSettings | None, /) -> None:
        """End the interface with its commands, and begin the one of these settings.

        Raises CellNotReady while a PLC holds abort, PortTaken when it cannot listen there; then the one before goes on.
        """
        if self._app.supervisor.abort_is_held:
            raise CellNotReady(("a PLC holds abort",), Sentence("clear-plc-abort"))
        await self.stop()
        try:
            self._open(settings)
        except PortTaken:
            self._open(self._app.settings.plc)
            raise
        finally:
            await self.start()

    def families(self) -> Iterable[Metric]:
        return () if self.service is None else self.service.families()

    def _open(self, settings: PlcSettings | None) -> None:
        """Build the interface and bind its port. Raises PortTaken; then none is on."""
        self.service = None
        if settings is not None:
            from extensions.plc.service import PlcService  # of no use to a cell without a PLC

            self.service = PlcService(settings, self._app.cameras, self._app.clock)


PLC = Extension("plc", sections={"plc": PlcSwitch})

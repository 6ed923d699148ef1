"""The session with a controller: connects in the background, polls the panel, reconnects after a loss."""

import asyncio
from collections.abc import Mapping

from drivers.errors import DeviceError
from drivers.robots.abb.controller_link import ControllerLink
from drivers.robots.abb.rws import parsing
from drivers.robots.abb.rws.client import RwsClient
from drivers.robots.abb.rws.dialect import DIALECTS
from drivers.robots.abb.rws.parsing import ControllerState
from drivers.timing import Timing

POLL_S = 2.0
"""Polling period of the panel: two requests a second, of 20 that a controller answers."""


class RwsLink(ControllerLink):
    """Owns the session."""

    again = "it is looked for again by itself"

    def __init__(self, client: RwsClient, timing: Timing) -> None:
        super().__init__(client.device, timing)
        self._client = client

    async def close(self) -> None:
        await super().close()
        await self._client.close()

    async def one(self, path: str, query: Mapping[str, str] | None = None, *, urgent: bool = False) -> parsing.Values:
        """The first resource at a path; empty when there is none. Raises DeviceError."""
        items = await self._client.get(path, query, urgent=urgent)
        return items[0] if items else {}

    async def read_state(self) -> ControllerState:
        """State of panel and program. Raises DeviceError."""
        device, dialect = self._client.device, self._client.dialect or DIALECTS[2]
        controller = await self.one(dialect.controller_state)  # after a restart each request at once is given a session
        mode, execution, speed = await asyncio.gather(
            self.one("/rw/panel/opmode"),
            self.read_execution(),
            self.one("/rw/panel/speedratio"),
        )
        return ControllerState(
            controller=parsing.word(device, controller, "ctrlstate"),
            mode=parsing.word(device, mode, "opmode"),
            execution=execution,
            speed_ratio=parsing.number(device, speed, "speedratio"),
        )

    async def read_execution(self, *, urgent: bool = False) -> str:
        """Execution state of RAPID, "running" or "stopped". Raises DeviceError."""
        return parsing.word(self._client.device, await self.one("/rw/rapid/execution", urgent=urgent), "ctrlexecstate")

    async def _look(self) -> None:
        while True:
            try:
                await self._poll_panel()
            except DeviceError as error:
                self._connected.clear()
                self._report.down(f"{error.what}: {error.fix}")
            await self._client.close()
            await self._timing.sleep(self._backoff.next_wait_s())

    async def _poll_panel(self) -> None:
        """Connect, and poll the panel; raises DeviceError when it cannot be read."""
        dialect = await self._client.find()
        while True:
            state = await self.read_state()
            self._report.up(f"connected over {dialect.name}: {state}")
            self._backoff.reset()
            self._connected.set()
            await self._timing.sleep(POLL_S)

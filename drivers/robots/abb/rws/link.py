"""The session with a controller: connects in the background, monitors the panel, reconnects after a loss."""

import asyncio
import html
import logging
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from urllib.parse import urlsplit

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidHandshake, InvalidURI, WebSocketException
from websockets.typing import Subprotocol

from drivers.backoff import Backoff
from drivers.errors import DeviceError, DeviceUnreachable, GarbledAnswer
from drivers.robots.abb.controller_link import ControllerLink
from drivers.robots.abb.rws import parsing
from drivers.robots.abb.rws.client import RwsClient
from drivers.robots.abb.rws.dialect import DIALECTS
from drivers.robots.abb.rws.parsing import ControllerState
from drivers.timing import Timing

OPEN_LIMIT_S = 5.0
MEDIUM = "1"
_EVENT = re.compile(r'<li class="([\w-]+)"[^>]*>')
_SPAN = re.compile(r'<span class="([\w-]+)">([^<]*)</span>')


def events_in(message: str) -> list[dict[str, str]]:
    """The values of each change that a message reports; it is always XHTML."""
    begins = [*_EVENT.finditer(message)]
    ends = [*(begin.start() for begin in begins[1:]), len(message)][: len(begins)]
    return [
        {name: html.unescape(value) for name, value in _SPAN.findall(message, begin.end(), end)}
        for begin, end in zip(begins, ends, strict=True)
    ]


class Subscription:
    """A subscription to the panel, the execution state and the event log."""

    def __init__(self, client: RwsClient, on_event: Callable[[dict[str, str]], None]) -> None:
        self._client, self._on_event = client, on_event
        self._connection: ClientConnection | None = None

    @property
    def is_open(self) -> bool:
        return self._connection is not None

    async def end(self) -> None:
        """Close the socket, which ends `listen`."""
        if self._connection is not None:
            await self._connection.close()

    async def listen(self, opened: Callable[[], None]) -> None:
        """Subscribe and pass on events until the subscription ends. Always ends by raising DeviceError."""
        device = self._client.device
        path = await self._subscribe()
        url, headers, tls = self._client.socket(path)
        dialect = self._client.dialect
        assert dialect is not None
        try:
            async with connect(
                url,
                subprotocols=[Subprotocol(dialect.subprotocol)],
                additional_headers=headers,
                ssl=tls,
                compression=None,
                open_timeout=OPEN_LIMIT_S,
                close_timeout=1.0,
                ping_interval=None,  # RWS 2.0 answers no ping, and closes on any message
                proxy=None,
            ) as connection:
                self._connection = connection
                opened()
                async for message in connection:
                    for event in events_in(message if isinstance(message, str) else message.decode("utf-8", "replace")):
                        self._on_event(event)
        except (InvalidHandshake, InvalidURI) as error:
            raise GarbledAnswer(
                device, f"the subscription's socket was refused ({error})", "update RobotWare"
            ) from error
        except (OSError, TimeoutError, WebSocketException) as error:
            raise DeviceUnreachable(device, f"the subscription broke ({error})", "it is opened again") from error
        finally:
            self._connection = None
            with suppress(DeviceError):
                await self._client.delete(path.replace("/poll/", "/subscription/"))
        raise DeviceUnreachable(device, "the controller ended the subscription", "it is opened again by itself")

    async def _subscribe(self) -> str:
        """Path of the socket; the host name in the response is ignored, since it is the controller's own."""
        dialect = self._client.dialect
        assert dialect is not None
        names = (f"{dialect.controller_state};ctrlstate", "/rw/panel/opmode;opmode", "/rw/panel/speedratio;speedratio",
                 "/rw/rapid/execution;ctrlexecstate", "/rw/elog/0")  # fmt: skip
        form: dict[str, str | list[str]] = {"resources": [str(number) for number, _ in enumerate(names, 1)]}
        for number, name in enumerate(names, 1):
            form |= {str(number): name, f"{number}-p": MEDIUM}
        answer = await self._client.post("/subscription", {}, form)  # type: ignore[arg-type]
        path = urlsplit(str(answer.headers.get("location", ""))).path
        if not path.startswith("/poll/"):
            what = f"a subscription without an address ({path or 'none'})"
            raise GarbledAnswer(self._client.device, what, "update RobotWare")
        return path


log = logging.getLogger(__name__)

POLL_S = 2.0
"""Polling period of the panel beside the subscription, which may have fallen silent."""
MAX_SILENT_CHANGES = 2
"""Number of consecutive polls with changes but no event, after which the subscription is reopened."""
_FIELDS = {"ctrlstate": "controller", "opmode": "mode", "ctrlexecstate": "execution"}


class RwsLink(ControllerLink):
    """Owns session and subscription."""

    again = "it is looked for again by itself"

    def __init__(self, client: RwsClient, timing: Timing) -> None:
        super().__init__(client.device, timing)
        self._client, self._watch_backoff = client, Backoff(timing.chance)
        self._watch: Subscription | None = None
        self._last_values: dict[str, str] = {}
        self.newest_event = 0

    @property
    def watching(self) -> bool:
        return self._watch is not None and self._watch.is_open

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
        controller, mode, execution, speed = await asyncio.gather(
            self.one(dialect.controller_state),
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
                dialect = await self._client.find()
                async with asyncio.TaskGroup() as group:
                    group.create_task(self._poll_panel(dialect.name))
                    group.create_task(self._keep_watching())
            except* DeviceError as errors:
                error = errors.exceptions[0]
                self._connected.clear()
                self._report.down(f"{error.what}: {error.fix}" if isinstance(error, DeviceError) else str(error))
            await self._client.close()
            await self._timing.sleep(self._backoff.next_wait_s())

    async def _poll_panel(self, name: str) -> None:
        """Poll the panel; raises DeviceError when it cannot be read."""
        unreported = 0
        while True:
            state = await self.read_state()
            polled = {key: getattr(state, attribute) for key, attribute in _FIELDS.items()}
            differs = any(self._last_values.get(key) != value for key, value in polled.items())
            unreported = unreported + 1 if self.watching and differs else 0
            if unreported >= MAX_SILENT_CHANGES and self._watch is not None:
                log.warning("%s: the subscription reports no changes any more: it is opened again", self._client.device)
                await self._watch.end()
            if not self.watching:
                self._last_values.update(polled)
            self._report.up(f"connected over {name}: {state}")
            self._backoff.reset()
            self._connected.set()
            await self._timing.sleep(POLL_S)

    async def _keep_watching(self) -> None:
        """Keep a subscription open; a controller that refuses it is only polled."""
        while True:
            self._watch = Subscription(self._client, self._on_event)
            try:
                await self._watch.listen(self._watch_backoff.reset)
            except DeviceError as error:
                log.info("%s", error)
            await self._timing.sleep(self._watch_backoff.next_wait_s())

    def _on_event(self, values: dict[str, str]) -> None:
        self._last_values.update(values)
        if values.get("seqnum", "").isdecimal():
            self.newest_event = int(values["seqnum"])

"""One subscription to the controller's changes, reopened when it ends or falls silent."""

import html
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from urllib.parse import urlsplit

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidHandshake, InvalidURI, WebSocketException
from websockets.typing import Subprotocol

from drivers.errors import DeviceError, DeviceUnreachable, GarbledAnswer
from drivers.robots.abb.rws.client import RwsClient

OPEN_LIMIT_S = 5.0
MEDIUM = "1"
_EVENT = re.compile(r'<li class="([\w-]+)"[^>]*>')
_SPAN = re.compile(r'<span class="([\w-]+)">([^<]*)</span>')


@dataclass(frozen=True)
class RwsEvent:
    """One change. `kind` is ABB's class, such as pnl-ctrlstate-ev."""

    kind: str
    values: dict[str, str]


def events_in(message: str) -> list[RwsEvent]:
    """Events of one message, which is always XHTML."""
    begins = [*_EVENT.finditer(message)]
    ends = [*(begin.start() for begin in begins[1:]), len(message)][: len(begins)]
    return [
        RwsEvent(
            begin.group(1), {name: html.unescape(value) for name, value in _SPAN.findall(message, begin.end(), end)}
        )
        for begin, end in zip(begins, ends, strict=True)
    ]


class Subscription:
    """A subscription to the panel, the execution state and the event log."""

    def __init__(self, client: RwsClient, on_event: Callable[[RwsEvent], None]) -> None:
        self._client, self._on_event = client, on_event
        self._connection: ClientConnection | None = None

    @property
    def is_open(self) -> bool:
        """Whether the socket is open."""
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

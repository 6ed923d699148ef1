"""Changes that a controller reports by itself, over a WebSocket of Robot Web Services."""

import html
import re
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
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


def events_in(message: str) -> list[dict[str, str]]:
    """The values of each change that a message reports; it is always XHTML."""
    begins = [*_EVENT.finditer(message)]
    ends = [*(begin.start() for begin in begins[1:]), len(message)][: len(begins)]
    return [
        {name: html.unescape(value) for name, value in _SPAN.findall(message, begin.end(), end)}
        for begin, end in zip(begins, ends, strict=True)
    ]


@asynccontextmanager
async def subscribe(client: RwsClient) -> AsyncIterator[AsyncIterator[dict[str, str]]]:
    """Changes of the panel, of the execution state and of the event log, as they come. Raises DeviceError."""
    device, dialect = client.device, client.require_dialect()
    path = await _subscription(client)
    url, headers, tls = client.socket(path)
    try:
        with _socket_errors(device):
            connection = await connect(
                url,
                subprotocols=[Subprotocol(dialect.subprotocol)],
                additional_headers=headers,
                ssl=tls,
                compression=None,
                open_timeout=OPEN_LIMIT_S,
                close_timeout=1.0,
                ping_interval=None,  # RWS 2.0 answers no ping, and closes on any message
                proxy=None,
            )
        try:
            yield _events(device, connection)
        finally:
            await connection.close()
    finally:
        with suppress(DeviceError):
            await client.delete(path.replace("/poll/", "/subscription/"))


async def _events(device: str, connection: ClientConnection) -> AsyncIterator[dict[str, str]]:
    with _socket_errors(device):
        async for message in connection:
            for event in events_in(message if isinstance(message, str) else message.decode("utf-8", "replace")):
                yield event


@contextmanager
def _socket_errors(device: str) -> Iterator[None]:
    try:
        yield
    except (InvalidHandshake, InvalidURI) as error:
        raise GarbledAnswer(device, f"the subscription's socket was refused ({error})", "update RobotWare") from error
    except (OSError, TimeoutError, WebSocketException) as error:
        raise DeviceUnreachable(device, f"the subscription broke ({error})", "try it again") from error


async def _subscription(client: RwsClient) -> str:
    """Path of the socket; the host name in the response is ignored, since it is the controller's own."""
    names = (f"{client.require_dialect().controller_state};ctrlstate", "/rw/panel/opmode;opmode",
             "/rw/panel/speedratio;speedratio", "/rw/rapid/execution;ctrlexecstate", "/rw/elog/0")  # fmt: skip
    form: dict[str, str | list[str]] = {"resources": [str(number) for number, _ in enumerate(names, 1)]}
    for number, name in enumerate(names, 1):
        form |= {str(number): name, f"{number}-p": MEDIUM}
    answer = await client.post("/subscription", {}, form)  # type: ignore[arg-type]
    path = urlsplit(str(answer.headers.get("location", ""))).path
    if not path.startswith("/poll/"):
        what = f"a subscription without an address ({path or 'none'})"
        raise GarbledAnswer(client.device, what, "update RobotWare")
    return path
